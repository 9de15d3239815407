"""`--layout auto`: print the proposed layout of foreign tables, or write it with `--write-layout`."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import click

from skillframe.cli import emit_json


def proposed(
    files: Sequence[Path], settings: dict[str, Any], layout: Path | None, as_json: bool, command: str, *after: str
) -> int:
    """Print the command that reads each file, and return 1 unless every command is complete."""
    from skillframe_recordings.proposal.layouts import OF_ONE, merged, typed, write_layout
    from skillframe_recordings.proposal.reading import propose_reading

    found = [replace(propose_reading(path, **settings), command=(command,), after=after) for path in files]
    whole = all(proposal.whole for proposal in found)
    if as_json:
        emit_json([proposal.as_json() for proposal in found])
    for proposal in () if as_json else found:
        click.echo(f"{proposal.file}\n  type      {proposal.line}")
        for name in ("because", "undecided", "missing"):
            for text in getattr(proposal, name):
                click.echo(f"  {name:<10}{text}")
        if proposal.error:
            click.echo(f"  refused   {proposal.error}")
    if layout is not None and whole:
        own = {p.file: {k: v for k, v in p.reading.items() if k not in OF_ONE} for p in found}
        undecided = dict.fromkeys(text for p in found for text in p.undecided)
        told = [proposal.file for proposal in found]
        why = f"made by: skillframe check {shlex.join(told)} --layout auto --write-layout {layout}"
        write_layout(layout, merged(own), undecided, why)
        each = [w for k, v in found[0].reading.items() if k in OF_ONE for w in typed(k, v)]
        words = ["skillframe", *found[0].command, *told, "--layout", str(layout), *each, *found[0].after]
        click.echo(f"{layout}: written\n  type      {shlex.join(words)}", err=as_json)
        if found[0].command == ("check",):
            out = "demos/" if len(told) > 1 else "demo.npz"
            words = ["skillframe", "convert", *told, "--layout", str(layout), *each, "--out", out]
            click.echo(f"  or        {shlex.join(words)}", err=as_json)
    elif layout is not None:
        click.echo(f"{layout}: not written, since a line above cannot be typed as it stands", err=True)
    elif whole and not as_json:
        click.echo("--write-layout layout.toml stores this, and --layout layout.toml reads many files with it")
    return 0 if whole else 1

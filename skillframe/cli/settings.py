"""`skillframe settings`: everything that --set takes, with unit and default."""

from __future__ import annotations

import re
from typing import Any

import click

from skillframe.cli import names
from skillframe.cli.output import LIST_WIDTH, emit_json, table


@click.command()
@click.option("--world", shell_complete=names.worlds, help="Of this world only [all worlds].")
@click.option("--json", "as_json", is_flag=True, help="JSON alone on stdout.")
def command(world: str | None, as_json: bool) -> None:
    """List what --set takes in run, record and campaigns: a quantity's name, default and range, with units.

    A bare number is in SI units; 8mm, 5deg, 20N say their own. A number beyond the range is refused as a typing
    mistake. A learner's settings: skillframe plugins show NAME.

    \b
    Examples:
      skillframe settings --world peg_in_hole
      skillframe settings --json
    """
    from skillframe.api.settings import of_runs, of_trials, of_world
    from skillframe.extend.registry import registry

    worlds = [registry().world(world)] if world is not None else list(registry().records("world"))
    rows = [*of_runs(), *of_trials(), *(row for record in worlds for row in of_world(record))]
    if as_json:
        emit_json(rows)
        return
    lines = [
        (row.get("option") or row["name"], row["world"] or "any", *_figures(row), plain(row["about"])) for row in rows
    ]
    table(("setting", "world", "default", "range", "what it is"), lines, LIST_WIDTH)


def _figures(row: dict[str, Any]) -> tuple[str, str]:
    """Default and range as they would be typed."""
    from skillframe.config.ranges import Range, shown

    default = row["default"]
    number = isinstance(default, int | float) and not isinstance(default, bool)
    limits = None if row["range"] is None else Range(*row["range"])
    said = shown(default, row["unit"]) if number and row["unit"] else typed(default)
    return said, "" if limits is None else limits.words(row["unit"])


def plain(about: str) -> str:
    """A text about a quantity without the unit and range that stand in columns of their own."""
    return re.sub(r" \[[^\]]*\]", "", about)


def typed(value: Any) -> str:
    """A default as it would be typed. Nothing where something else decides."""
    if value is None:
        return ""
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:.6g}" if isinstance(value, float) else f"{value}"

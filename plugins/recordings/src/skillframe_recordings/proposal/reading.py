"""Proposed settings that read a foreign table, with reasons (header, values, units, orientation, wrench), and a trial.

Proposals are never applied: the user reads the reasons and types the command. Open questions name the assumption.
"""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from skillframe.demonstration import NUMBERS, Table
from skillframe.errors import InputError, SkillframeError
from skillframe.extend import format_of, read_demonstration
from skillframe_recordings.formats.foreign import npz_table
from skillframe_recordings.proposal.layouts import typed
from skillframe_recordings.proposal.table_analysis import Look, Said


@dataclass(frozen=True, slots=True, kw_only=True)
class Proposal:
    """A proposal for a table.

    Attributes:
        file: the table.
        settings: proposed reading settings by name; "" for a flag.
        because: reasons, a sentence each.
        undecided: open questions with assumptions.
        missing: what was not found; the line is then incomplete.
        error: why reading with the line fails; "" if it works or was not tried.
        command: words of the command.
        after: its last words.
    """

    file: str
    settings: dict[str, str] = field(default_factory=dict)
    because: list[str] = field(default_factory=list)
    undecided: list[str] = field(default_factory=list)
    missing: list[str] = field(default_factory=list)
    error: str = ""
    command: tuple[str, ...] = ("check",)
    after: tuple[str, ...] = ()

    @property
    def line(self) -> str:
        """The command that reads the table so."""
        words = ["skillframe", *self.command, self.file]
        for name, value in self.settings.items():
            words += typed(name, value or True)
        return shlex.join([*words, *self.after])

    @property
    def reading(self) -> dict[str, Any]:
        """The settings as `read_demonstration` takes them."""
        return {k: (float(v) if k in NUMBERS else v) if v else True for k, v in self.settings.items()}

    @property
    def whole(self) -> bool:
        """Whether the line can be typed as it is."""
        return not self.missing and not self.error

    def as_json(self) -> dict[str, Any]:
        """Return plain JSON values."""
        return {
            "file": self.file, "line": self.line, "settings": self.settings, "because": self.because,
            "undecided": self.undecided, "missing": self.missing, "error": self.error or None,
        }  # fmt: skip


def propose(table: Table, wrench: Table | None = None, given: Mapping[str, Any] | None = None) -> Proposal:
    """Return a proposal for a table, or two.

    Args:
        table: the pose's, with or without the wrench.
        wrench: the wrench's own, or None.
        given: given reading settings, which are kept.

    Raises:
        InputError: no column of a demonstration was recognised.
    """
    said = Said()
    known = {k: v for k, v in (given or {}).items() if v is not None and k not in ("columns", "wrench_columns")}
    look = Look(table, said, known, alone=wrench is None)
    if wrench is not None:
        look.take_wrench(wrench)
    look.judge_wrench(look.orientation())
    look.take_poses_at_rest()
    look.say_what_is_missing()
    first = {} if look.native else {"columns": look.spec}
    first |= {"units": ",".join(look.units)} if look.units else {}
    kept = {name: str(value) for name, value in known.items() if name not in ("units", "arm") or look.native}
    return Proposal(
        file=table.source, settings={**first, **said.settings, **kept}, because=said.because,
        undecided=said.undecided, missing=said.missing,
    )  # fmt: skip


def propose_reading(path: Path | str, **options: Any) -> Proposal:
    """Return a proposal for a file (`propose`), tested by reading.

    Args:
        path: the file.
        **options: known settings, as for `read_demonstration`; they are kept.

    Raises:
        InputError: no table, or no column of a demonstration.
    """
    given = {name: value for name, value in options.items() if name != "columns" and value is not None}
    wrench = given.get("wrench")
    found = propose(_table(Path(path), given), None if wrench is None else _table(Path(wrench), given), given)
    if not found.whole:
        return found
    try:
        read_demonstration(path, **{**found.reading, **{k: v for k, v in given.items() if k in found.settings}})
    except SkillframeError as error:
        return replace(found, error=str(error))
    return found


def _table(path: Path, options: dict[str, Any]) -> Table:
    form = format_of(path, reading=True, named_columns=True)
    if form.name == "npz":
        return npz_table(path, options)
    if form.table is None:
        raise InputError(path, f"is no table but a {form.name}", "leave --layout auto away")
    return form.table(path, options)

"""The line to type for a foreign table, with its reasons: header, values, units, attitude, wrench, in this order.

What is proposed is never applied: a person reads the reasons and types the line. What the data cannot tell is listed
with what was assumed.
"""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from skillframe.demonstration.proposal.look import Look, Said
from skillframe.demonstration.table import Table


@dataclass(frozen=True, slots=True, kw_only=True)
class Proposal:
    """What a table probably holds.

    Attributes:
        file: the table.
        settings: reading settings that are proposed, by name; "" for one that is a flag.
        because: reasons, a sentence each.
        undecided: what the data cannot tell, with what was assumed.
        missing: what was not found; with any of it the line is not whole.
        error: why the line cannot be read, if it was tried; "" if it can.
    """

    file: str
    settings: dict[str, str] = field(default_factory=dict)
    because: list[str] = field(default_factory=list)
    undecided: list[str] = field(default_factory=list)
    missing: list[str] = field(default_factory=list)
    error: str = ""

    @property
    def line(self) -> str:
        """The command that reads the table so."""
        words = ["skillframe", "demonstration", "check", self.file]
        for name, value in self.settings.items():
            words += [f"--{OPTIONS.get(name, name).replace('_', '-')}", *([value] if value else [])]
        return shlex.join(words)

    @property
    def whole(self) -> bool:
        """Whether the line can be typed as it stands."""
        return not self.missing and not self.error

    def as_json(self) -> dict[str, Any]:
        """Plain JSON values."""
        return {
            "file": self.file, "line": self.line, "settings": self.settings, "because": self.because,
            "undecided": self.undecided, "missing": self.missing, "error": self.error or None,
        }  # fmt: skip


OPTIONS = {"start": "from", "stop": "to"}
"""Names on the command line of settings that have another in scripts."""


def propose(table: Table, wrench: Table | None = None, given: Mapping[str, Any] | None = None) -> Proposal:
    """A proposal for a table, or two.

    Args:
        table: the pose's, with or without the wrench.
        wrench: the wrench's own, or None.
        given: reading settings that were given, which are kept.

    Raises:
        InputError: no column of a demonstration was recognised.
    """
    said = Said()
    known = {k: v for k, v in (given or {}).items() if v is not None and k not in ("columns", "wrench_columns")}
    look = Look(table, said, known, alone=wrench is None)
    if wrench is not None:
        look.take_wrench(wrench)
    look.judge_wrench(look.attitude())
    look.say_what_is_missing()
    first = {} if look.native else {"columns": look.spec}
    first |= {"units": ",".join(look.units)} if look.units else {}
    kept = {name: str(value) for name, value in known.items() if name != "units"}
    return Proposal(
        file=table.source, settings={**first, **said.settings, **kept}, because=said.because,
        undecided=said.undecided, missing=said.missing,
    )  # fmt: skip

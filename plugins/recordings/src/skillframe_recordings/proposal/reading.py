"""Proposed settings that read a foreign file, and a trial of them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from skillframe.errors import InputError, SkillframeError
from skillframe.extend import format_of, read_demonstration
from skillframe_recordings.formats.foreign import npz_table
from skillframe_recordings.proposal.propose import Proposal, propose

if TYPE_CHECKING:
    from skillframe.demonstration import Table


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

"""Whether demonstrations show one task: they share phases, end in the same one, and do not run the other way round."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from skillframe.demonstration.record import Demonstration
from skillframe.errors import InputError


def check_agreement(rows: Sequence[Mapping[str, Any]], demonstrations: Sequence[Demonstration]) -> None:
    """Refuse demonstrations that do not belong together.

    Args:
        rows: `demonstrations` of a segmentation.
        demonstrations: the same, for their names.

    Raises:
        InputError: one that shares no phase with any other, runs the other way round, or stops half-way.
    """
    labels = [list(row["labels"]) for row in rows]
    names = [d.source or f"demonstration {i + 1}" for i, d in enumerate(demonstrations)]
    for i, mine in enumerate(labels):
        others = [theirs for j, theirs in enumerate(labels) if j != i]
        if others and len(labels) > 1:
            _check_one(names[i], mine, others)


def _check_one(name: str, mine: list[int], others: Sequence[list[int]]) -> None:
    if not any(set(mine) & set(theirs) for theirs in others):
        raise InputError(
            name, f"shares no phase with the other demonstrations (its phases: {_told(mine)})",
            "leave it out, or segment it with demonstrations of the same task",
        )  # fmt: skip
    if all(mine[0] == theirs[-1] and mine[-1] == theirs[0] and mine[0] != mine[-1] for theirs in others):
        raise InputError(
            name, f"goes through its phases the other way round ({_told(mine)}) than the others ({_told(others[0])})",
            "leave it out, or record it again",
        )  # fmt: skip
    if all(theirs[-1] not in mine and mine[-1] in theirs for theirs in others):
        raise InputError(
            name, f"stops half-way: ends in phase {mine[-1] + 1}, where the others go on to phase {others[0][-1] + 1}",
            "leave it out, or record it to the end",
        )  # fmt: skip


def _told(labels: Sequence[int]) -> str:
    return " - ".join(str(label + 1) for label in labels)

"""Check that demonstrations show one task: they share phases, are complete, and have one order.

One is incomplete if it ends in a phase from which all others go on, in under three quarters of the shortest time that
they took from there to their ends; leaving after the task may differ.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from skillframe.demonstration import Demonstration
from skillframe.errors import InputError


def check_agreement(rows: Sequence[Mapping[str, Any]], demonstrations: Sequence[Demonstration]) -> None:
    """Refuse demonstrations that do not belong together.

    Args:
        rows: `demonstrations` of a segmentation.
        demonstrations: the same, for their names.

    Raises:
        InputError: one that shares no phase with any other, runs in reverse, or stops half-way.
    """
    labels = [list(row["labels"]) for row in rows]
    names = [d.source or f"demonstration {i + 1}" for i, d in enumerate(demonstrations)]
    for i, mine in enumerate(labels if len(labels) > 1 else []):
        name = names[i]
        others = [theirs for j, theirs in enumerate(labels) if j != i]
        if not any(set(mine) & set(theirs) for theirs in others):
            raise InputError(
                name, f"shares no phase with the other demonstrations (its phases: {_told(mine)})",
                "leave it out, or segment it with demonstrations of the same task",
            )  # fmt: skip
        if all(mine[0] == theirs[-1] and mine[-1] == theirs[0] and mine[0] != mine[-1] for theirs in others):
            raise InputError(
                name,
                f"goes through its phases the other way round ({_told(mine)}) than the others ({_told(others[0])})",
                "leave it out, or record it again",
            )  # fmt: skip
        last, rest = mine[-1], [row for j, row in enumerate(rows) if j != i]
        if any(theirs[-1] in mine or last not in theirs for theirs in others):
            continue
        if _time_from(rows[i], last) < 0.75 * min(_time_from(row, last) for row in rest):
            raise InputError(
                name, f"stops half-way: ends in phase {last + 1}, where the others go on to phase {others[0][-1] + 1}",
                "leave it out, or record it to the end",
            )  # fmt: skip


def _time_from(row: Mapping[str, Any], phase: int) -> float:
    first = row["labels"].index(phase)
    return float(row["end"] - [row["start"], *row["boundaries"]][first])


def _told(labels: Sequence[int]) -> str:
    return " - ".join(str(label + 1) for label in labels)

"""Boundaries moved by the user: "2:1=3.45" puts the first boundary of the second demonstration at 3.45 s."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from pathlib import PurePath
from typing import NamedTuple

from skillframe.errors import InputError, UnknownName
from skillframe.extend import Document
from skillframe_segmenter.settings import PHASE_MIN_S

OPTION = "--set-boundary"


class Move(NamedTuple):
    """Demonstration and boundary, counted from 0, and the new time [s]."""

    demonstration: int
    boundary: int
    time: float


def parse_move(text: str, names: Sequence[str]) -> Move:
    """A move from "DEMONSTRATION:BOUNDARY=SECONDS", the demonstration a number (from 1) or file name.

    Raises:
        InputError: not of that form, or not a time.
        UnknownName: no such demonstration.
    """
    head, equals, seconds = text.rpartition("=")
    name, colon, number = head.rpartition(":")
    try:
        time, boundary = float(seconds), int(number) - 1
    except ValueError:
        time, boundary = math.nan, -1
    if not (equals and colon and math.isfinite(time) and boundary >= 0):
        raise InputError(f"{OPTION} {text}", "is not DEMONSTRATION:BOUNDARY=SECONDS", "write for example 2:1=3.45")
    known = {str(i + 1): i for i in range(len(names))}
    known |= {alias: i for i, n in enumerate(names) if n for alias in (n, PurePath(n).name)}
    if name not in known:
        raise UnknownName("demonstration", name, known)
    return Move(known[name], boundary, time)


def moved(rows: Sequence[Document], moves: Sequence[Move], names: Sequence[str]) -> list[Document]:
    """Rows of `demonstrations` with boundaries moved.

    Returns:
        the rows, each with `found`, its `boundaries` and `labels` before, and changed ones with `set`, the numbers of
            the moved boundaries.

    Raises:
        InputError: a missing boundary, a time outside its neighbours, or too short a phase.
    """
    result = [
        {**row, "boundaries": list(row["boundaries"]), "found": {key: row[key] for key in ("boundaries", "labels")}}
        for row in rows
    ]
    for move in moves:
        where = names[move.demonstration] or f"demonstration {move.demonstration + 1}"
        cuts = result[move.demonstration]["boundaries"]
        if move.boundary >= len(cuts):
            there = ", ".join(f"{t:.2f} s" for t in cuts) or "none"
            raise InputError(where, f"has no boundary {move.boundary + 1} (there are: {there})", f"fix {OPTION}")
        cuts[move.boundary] = move.time
        result[move.demonstration]["set"] = sorted({*result[move.demonstration].get("set", []), move.boundary})
    for move in moves:
        row = result[move.demonstration]
        if any(b <= a for a, b in pairwise([row["start"], *row["boundaries"], row["end"]])):
            raise InputError(
                names[move.demonstration] or f"demonstration {move.demonstration + 1}",
                f"boundary {move.boundary + 1} cannot be at {move.time:g} s: boundaries stay inside and in order",
                f"it lasts from {row['start']:.2f} s to {row['end']:.2f} s; fix {OPTION}",
            )
    for move in moves:
        _check_length(result[move.demonstration], move, names)
    return result


def _check_length(row: Document, move: Move, names: Sequence[str]) -> None:
    edges = [row["start"], *row["boundaries"], row["end"]]
    before, here, after = edges[move.boundary : move.boundary + 3]
    shortest = min(here - before, after - here)
    if shortest < PHASE_MIN_S - 1e-6:  # of rounding
        first, last = math.ceil(100.0 * (before + PHASE_MIN_S) - 1e-4), math.floor(100.0 * (after - PHASE_MIN_S) + 1e-4)
        raise InputError(
            names[move.demonstration] or f"demonstration {move.demonstration + 1}",
            f"boundary {move.boundary + 1} at {here:g} s leaves a phase of {shortest:.3g} s, and one needs "
            f"{PHASE_MIN_S:g} s",
            f"put it from {first / 100:.2f} s to {last / 100:.2f} s" if first <= last else "move its neighbours too",
        )

"""`plan.jsonl`: what a folder's searches were about to run, written before it ran.

    {"stream": "border", "round": 3, "names": [...], "points": [[...]], "explored": 8, "rows": ..., "method": 3,
     "previous": ...}

A line holds a round's points in SI, the hash of the rows they were computed from, and the hash of the line before, so
that neither a point nor the order of lines can be changed unseen. Whoever resumes, replays or reports reads the plan;
`skillframe campaign check` computes it again. A torn last line was never acted upon and is cut off.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from skillframe.campaign.store import repair_tail
from skillframe.errors import InputError
from skillframe.files.documents import parse_json
from skillframe.frames import Float

PLAN = "plan.jsonl"
METHOD = 5
"""How searches pick. 1, before the surrogate climbed from two noises, was not written down; 2 took Sobol points on the
sphere for the ways of a breaking point; to 3 the surrogate was a regression of the labels; in 4 it was not always found
to its end."""
FIX = "a plan cannot be repaired: start again in another folder"
BEGIN = ""
"""What the first line says of the one before."""


class Round(NamedTuple):
    """A round.

    Attributes:
        stream: what its rows are: border, break or confirm.
        round: its number in the stream, from 1.
        points: (n, d) in SI.
        explored: how many of them, the first, are even over the ranges.
        rows: hash of the rows that they were computed from.
        method: how they were picked; another method than `METHOD` cannot be computed again.
    """

    stream: str
    round: int
    points: Float
    explored: int
    rows: str
    method: int = METHOD


class RoundPlan:
    """The plan of a folder.

    Attributes:
        entries: its rounds in their order.

    Raises:
        InputError: on construction, if a line is damaged or was changed.
    """

    def __init__(self, folder: Path, names: Sequence[str]) -> None:
        self._path, self._names = folder / PLAN, list(names)
        self._head = BEGIN
        self.entries: list[Round] = []
        content = self._path.read_bytes() if self._path.is_file() else b""
        for number, line in enumerate(content.split(b"\n")[:-1], start=1):
            self.entries.append(self._read(f"{self._path}: line {number}", line))
            self._head = _hash(line)

    @property
    def head(self) -> str:
        """Hash of the last line, and so of all of them."""
        return self._head

    def of(self, stream: str) -> list[Round]:
        """The rounds of a stream."""
        return [entry for entry in self.entries if entry.stream == stream]

    def _read(self, where: str, line: bytes) -> Round:
        record = parse_json(line, where, FIX)
        try:
            if record["previous"] != self._head or record["names"] != self._names:
                raise InputError(where, "does not follow from the line before: the plan was changed", FIX)
            points = np.array(record["points"], dtype=float).reshape(-1, len(self._names))
            stream, number = str(record["stream"]), int(record["round"])
            if number != len(self.of(stream)) + 1:
                raise ValueError
            method = int(record.get("method", 1))
            return Round(stream, number, points, int(record["explored"]), str(record["rows"]), method)
        except (KeyError, TypeError, ValueError):
            raise InputError(where, "is damaged", FIX) from None

    def append(self, stream: str, points: Float, explored: int, rows: str) -> Round:
        """Write the next round of a stream down, and wait until it is on the disk."""
        entry = Round(stream, len(self.of(stream)) + 1, points, explored, rows)
        record = {
            "stream": stream, "round": entry.round, "names": self._names, "points": points.tolist(),
            "explored": explored, "rows": rows, "method": METHOD, "previous": self._head,
        }  # fmt: skip
        line = json.dumps(record, allow_nan=False).encode()
        repair_tail(self._path)
        with self._path.open("ab") as file:
            file.write(line + b"\n")
            file.flush()
            os.fsync(file.fileno())
        self.entries.append(entry)
        self._head = _hash(line)
        return entry


def _hash(line: bytes) -> str:
    return hashlib.sha256(line).hexdigest()

"""`plan.jsonl`: the rounds of a folder's searches, each written before it runs.

    {"stream": "border", "round": 3, "names": [...], "points": [[...]], "explored": 8, "rows": ..., "method": 3,
     "previous": ...}

A line holds a round's points in SI, the hash of the rows that they were computed from, and the hash of the line before,
which protects points and order. Resume, replay and reports read the plan, and `skillframe certify check` recomputes it.
A torn last line never ran and is cut off.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from skillframe.campaign import repair_tail
from skillframe.errors import InputError
from skillframe.files.documents import parse_json
from skillframe.frames import Float

PLAN = "plan.jsonl"
METHOD = 5
"""Version of the picking algorithm; rounds of other versions cannot be recomputed."""
FIX = "a plan cannot be repaired: start again in another folder"
BEGIN = ""
"""Hash that the first line gives for its predecessor."""


class Round(NamedTuple):
    """A round of a search.

    Attributes:
        stream: border, break, confirm or matter.
        round: its number in the stream, from 1.
        points: (n, d) in SI.
        explored: how many of them, the first, fill the ranges evenly.
        rows: hash of the rows that they were computed from.
        method: version of the algorithm that picked them, see `METHOD`.
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
        entries: its rounds in order.

    Raises:
        InputError: on construction, if a line is damaged or was changed.
    """

    def __init__(self, folder: Path, names: Sequence[str]) -> None:
        self._path, self._names = folder / PLAN, list(names)
        self._head = BEGIN
        self.entries: list[Round] = []
        content = self._path.read_bytes() if self._path.is_file() else b""
        for number, line in enumerate(content.split(b"\n")[:-1], start=1):
            where = f"{self._path}: line {number}"
            record = parse_json(line, where, FIX)
            try:
                if record["previous"] != self._head or record["names"] != self._names:
                    raise InputError(where, "does not follow from the line before: the plan was changed", FIX)
                points = np.array(record["points"], dtype=float).reshape(-1, len(self._names))
                stream, method = str(record["stream"]), int(record.get("method", 1))
                if int(record["round"]) != len(self.of(stream)) + 1:
                    raise ValueError
                rows, explored = str(record["rows"]), int(record["explored"])
            except (KeyError, TypeError, ValueError):
                raise InputError(where, "is damaged", FIX) from None
            self.entries.append(Round(stream, len(self.of(stream)) + 1, points, explored, rows, method))
            self._head = _hash(line)

    @property
    def head(self) -> str:
        """Hash of the last line, which depends on all of them."""
        return self._head

    def of(self, stream: str) -> list[Round]:
        """Return the rounds of a stream."""
        return [entry for entry in self.entries if entry.stream == stream]

    def append(self, stream: str, points: Float, explored: int, rows: str) -> Round:
        """Append the next round of a stream and wait until it is on the disk."""
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

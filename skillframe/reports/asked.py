"""What a folder of `campaign certify`, `map` or `break` holds for a page: the question, its answers, and the trials."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skillframe.campaign.claims.certificate import CERTIFICATE
from skillframe.campaign.claims.matter import indices
from skillframe.campaign.claims.plan import PLAN
from skillframe.campaign.claims.procedure import CLAIM, FRESH, claims, read_claim
from skillframe.campaign.claims.question import LOOK, QUESTION, Question, read_question
from skillframe.campaign.claims.rounds import BORDER
from skillframe.campaign.claims.searches import BREAK, MATTER, found_in
from skillframe.campaign.claims.surrogate import Surrogate
from skillframe.campaign.provenance import file_hash
from skillframe.campaign.rows import TRUTH
from skillframe.campaign.store import RESULTS
from skillframe.errors import InputError
from skillframe.files.documents import read_json, read_text
from skillframe.frames import Float


@dataclass(frozen=True, slots=True, kw_only=True)
class Asked:
    """A question and what is known of it.

    Attributes:
        folder: as the user called it.
        question: what is asked.
        evidence: the campaign that carries the claim, or the trials that were looked at, inside the folder.
        predicate: of certificate.json, or None where there is none yet.
        claim: the last claim as written, or None.
        found: content of border.json, breaking.json and matter.json by stream, where they are there.
        points, works: scaled trials (n, d) that were looked at, and whether each succeeded.
        hashes: (file, sha256) of what the page rests on.
    """

    folder: str
    question: Question
    evidence: str
    predicate: Mapping[str, Any] | None
    claim: Mapping[str, Any] | None
    found: Mapping[str, Mapping[str, Any]]
    points: Float
    works: NDArray[np.bool_]
    hashes: tuple[tuple[str, str], ...] = field(default=())

    @property
    def names(self) -> list[str]:
        """The quantities, in the points' order."""
        return list(self.question.ranges)

    def surrogate(self) -> Surrogate | None:
        """The guess that the trials make, or None where they all ended alike."""
        if not len(self.works) or self.works.all() or not self.works.any():
            return None
        return Surrogate(self.points, self.works)

    def ranked(self, surrogate: Surrogate) -> list[int]:
        """The quantities' places, the one that matters most first."""
        return [int(i) for i in np.argsort(-indices(surrogate, len(self.names)), kind="stable")]


def is_asked(folder: Path) -> bool:
    """Whether a folder holds a question."""
    return (folder / QUESTION).is_file()


def read_asked(folder: Path) -> Asked:
    """The question of a folder.

    Raises:
        InputError: it is damaged.
    """
    question, places = read_question(folder), claims(folder)
    last = places[-1] if places else None
    tested = last is not None and (last / FRESH / RESULTS).is_file()
    content = read_json(folder / CERTIFICATE, "make it again with campaign certify") if _there(folder) else {}
    tables = [
        folder / LOOK / RESULTS,
        *sorted((folder / BORDER).glob(f"*/{RESULTS}"), key=lambda p: int(p.parent.name)),
    ]
    rows = [row for path in tables if path.is_file() for row in _rows(path, list(question.ranges))]
    streams = {stream: found_in(folder, stream) for stream in (BORDER, BREAK, MATTER)}
    files = [CERTIFICATE, PLAN, QUESTION, *([f"{last.name}/{CLAIM}"] if last else [])]
    return Asked(
        folder=folder.name or folder.resolve().name, question=question,
        evidence=f"{last.name}/{FRESH}" if tested and last else LOOK, predicate=content.get("predicate"),
        claim=read_claim(last) if last else None, found={key: value for key, value in streams.items() if value},
        points=question.scaled([row for row, _ in rows]), works=np.array([works for _, works in rows], dtype=bool),
        hashes=tuple((name, file_hash(folder / name)) for name in files if (folder / name).is_file()),
    )  # fmt: skip


def _there(folder: Path) -> bool:
    return (folder / CERTIFICATE).is_file()


def _rows(path: Path, names: list[str]) -> list[tuple[dict[str, Any], bool]]:
    """Quantities and outcome of each trial in a table."""
    try:
        return [
            ({name: float(row[name]) for name in names}, TRUTH[row["success"].lower()])
            for row in csv.DictReader(io.StringIO(read_text(path)))
        ]
    except (KeyError, ValueError, TypeError):
        raise InputError(path, "does not hold the trials of its question", "make it again") from None

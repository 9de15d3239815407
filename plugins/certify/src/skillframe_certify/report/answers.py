"""Content of a certificate's folder for a page: the question, its answers and the trials."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skillframe.campaign import RESULTS, TRUTH, file_hash, is_trial
from skillframe.errors import InputError, SkillframeError
from skillframe.files.documents import read_json, read_text
from skillframe.frames import Float
from skillframe_certify.certificate import CERTIFICATE, examine
from skillframe_certify.plan import PLAN
from skillframe_certify.procedure import CLAIM, FRESH, claims, read_claim
from skillframe_certify.question import LOOK, QUESTION, Question, read_question
from skillframe_certify.rounds import BORDER
from skillframe_certify.searches import BREAK, MATTER, found_in
from skillframe_certify.sensitivity import indices
from skillframe_certify.shape import AGAIN, read_shape
from skillframe_certify.surrogate import Surrogate


@dataclass(frozen=True, slots=True, kw_only=True)
class Asked:
    """A question and its results.

    Attributes:
        folder: its name.
        question: what is asked.
        evidence: folder, inside it, of the fresh trials, else of the exploratory ones.
        predicate: of the certificate, recomputed from the trials; None without a valid one.
        wrong: sentences on why an existing certificate is invalid.
        claim: the last claim as written, or None.
        found: content of border.json, breaking.json and matter.json by stream, if present.
        points, works: scaled trials (n, d) of look and border, and whether each succeeded.
        hashes: (file, sha256) of the page's sources.
    """

    folder: str
    question: Question
    evidence: str
    predicate: Mapping[str, Any] | None
    wrong: tuple[str, ...] = ()
    claim: Mapping[str, Any] | None
    found: Mapping[str, Mapping[str, Any]]
    points: Float
    works: NDArray[np.bool_]
    hashes: tuple[tuple[str, str], ...] = field(default=())

    @property
    def names(self) -> list[str]:
        """The quantities in the points' order."""
        return list(self.question.ranges)

    def surrogate(self) -> Surrogate | None:
        """Return the surrogate of the trials, or None if all ended alike."""
        if not len(self.works) or self.works.all() or not self.works.any():
            return None
        return Surrogate(self.points, self.works)

    def ranked(self, surrogate: Surrogate) -> list[int]:
        """Return the indices of the quantities, most influential first."""
        return [int(i) for i in np.argsort(-indices(surrogate, len(self.names)), kind="stable")]


def is_asked(folder: Path) -> bool:
    """Return whether a folder holds a question."""
    return (folder / QUESTION).is_file()


def look_of(folder: Path) -> Path:
    """Return the folder of the exploratory campaign."""
    return folder / LOOK


def read_asked(folder: Path) -> Asked:
    """Return the question of a folder and its results.

    Raises:
        InputError: a file is damaged.
    """
    question, places = read_question(folder), claims(folder)
    last = places[-1] if places else None
    tested = last is not None and (last / FRESH / RESULTS).is_file()
    predicate, wrong = _checked(folder)
    tables = [
        folder / LOOK / RESULTS,
        *sorted((folder / BORDER).glob(f"*/{RESULTS}"), key=lambda p: int(p.parent.name)),
    ]
    rows = [row for path in tables if path.is_file() for row in _rows(path, list(question.ranges))]
    streams = {stream: found_in(folder, stream) for stream in (BORDER, BREAK, MATTER)}
    files = [CERTIFICATE, PLAN, QUESTION, *([f"{last.name}/{CLAIM}"] if last else [])]
    return Asked(
        folder=folder.name or folder.resolve().name, question=question,
        evidence=f"{last.name}/{FRESH}" if tested and last else LOOK, predicate=predicate, wrong=wrong,
        claim=read_claim(last) if last else None, found={key: value for key, value in streams.items() if value},
        points=question.scaled([row for row, _ in rows]), works=np.array([works for _, works in rows], dtype=bool),
        hashes=tuple((name, file_hash(folder / name)) for name in files if (folder / name).is_file()),
    )  # fmt: skip


def _checked(folder: Path) -> tuple[Mapping[str, Any] | None, tuple[str, ...]]:
    """A certificate's predicate, or the reasons why it is invalid.

    Raises:
        InputError: certificate.json has the wrong shape.
    """
    path = folder / CERTIFICATE
    if not path.is_file():
        return None, ()
    read_shape(read_json(path, AGAIN), path)
    try:
        found = examine(folder)
    except SkillframeError as error:
        return None, (f"it cannot be checked: {error}",)
    return (None, found.wrong) if found.wrong else (found.predicate, ())


def _rows(path: Path, names: list[str]) -> list[tuple[dict[str, Any], bool]]:
    try:
        return [
            ({name: float(row[name]) for name in names}, TRUTH[row["success"].lower()])
            for row in csv.DictReader(io.StringIO(read_text(path)))
            if is_trial(row)
        ]
    except (KeyError, ValueError, TypeError):
        raise InputError(path, "does not hold the trials of its question", "make it again") from None

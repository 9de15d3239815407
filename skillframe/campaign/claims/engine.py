"""How trials run for a question, and what comes back of them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.campaign.folder import Describe, campaign_hash, load
from skillframe.campaign.rows import Row
from skillframe.campaign.runner import Options, Progress
from skillframe.campaign.store import ordered, read_content
from skillframe.campaign.trouble import Evaluate
from skillframe.errors import InputError
from skillframe.frames import Float


class Engine(NamedTuple):
    """How trials run.

    Attributes:
        evaluate: a chunk of them.
        describe: a scene, as `campaign.folder.prepare` asks.
        params: the world's parameter dataclass.
        options: workers and the like.
    """

    evaluate: Evaluate
    describe: Describe
    params: type
    options: Options


class Looked(NamedTuple):
    """Trials that were looked at: scaled points (n, d), and whether each succeeded (n,)."""

    points: Float
    works: NDArray[np.bool_]

    def with_more(self, more: Looked) -> Looked:
        """These trials, then others."""
        return Looked(np.concatenate([self.points, more.points]), np.concatenate([self.works, more.works]))


Notify = Callable[[Progress], None]
Say = Callable[[str], None]
"""Told, in a sentence, how far a question is answered."""


def rows_of_campaign(folder: Path, params: type | None = None) -> list[Row]:
    """All rows of a complete campaign in the order of its trials.

    Raises:
        InputError: rows are missing, damaged or another campaign's.
    """
    spec = load(folder, params)
    rows = list(ordered(spec, read_content(folder, campaign_hash(spec), spec).done))
    if len(rows) != spec.trials:
        raise InputError(folder, f"has {len(rows)} of {spec.trials} trials", "go on with the command that began it")
    return rows


def succeeded(rows: list[Row]) -> NDArray[np.bool_]:
    """(n,) whether each row succeeded."""
    return np.array([row["success"] for row in rows], dtype=bool)

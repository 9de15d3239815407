"""How trials of a question run, and their outcomes."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.campaign import (
    CampaignSpec,
    Describe,
    Evaluate,
    Options,
    Progress,
    Row,
    campaign_hash,
    is_trial,
    load,
    ordered,
    read_content,
)
from skillframe.errors import InputError
from skillframe.frames import Float


class Engine(NamedTuple):
    """Functions that run trials.

    Attributes:
        evaluate: runs a chunk of trials.
        describe: describes a scene, as `campaign.folder.prepare` requires.
        params: the world's parameter dataclass.
        options: workers and the like.
        starts: returns for each trial of a campaign a sentence on a collision at its start, or ""; None if unavailable.
    """

    evaluate: Evaluate
    describe: Describe
    params: type
    options: Options
    starts: Callable[[CampaignSpec], list[str]] | None = None


class Looked(NamedTuple):
    """Trials and their outcomes.

    Attributes:
        points: (n, d) scaled.
        works: (n,) whether each succeeded.
        refused: (n,) which began in collision and are not trials; None for none.
    """

    points: Float
    works: NDArray[np.bool_]
    refused: NDArray[np.bool_] | None = None

    @property
    def none(self) -> NDArray[np.bool_]:
        """(n,) which are not trials."""
        return np.zeros(len(self.works), dtype=bool) if self.refused is None else self.refused

    @property
    def fails(self) -> NDArray[np.bool_]:
        """(n,) which trials failed. Refused starts did not."""
        return ~self.works & ~self.none

    @property
    def counts(self) -> dict[str, int]:
        """Numbers of trials, successes and refused starts."""
        refused = int(self.none.sum())
        return {"trials": len(self.works) - refused, "successes": int(self.works.sum()), "refused": refused}

    def require_trials(self) -> Looked:
        """Return these trials. Raises `InputError` if every start was refused."""
        if self.none.all():
            raise InputError("vary", f"all {len(self.works)} explored starts are inside something",
                             "narrow the ranges, or begin further away with [set] start.offset_z")  # fmt: skip
        return self

    def with_more(self, more: Looked) -> Looked:
        """Return these trials followed by others."""
        points, works = np.concatenate([self.points, more.points]), np.concatenate([self.works, more.works])
        return Looked(points, works, np.concatenate([self.none, more.none]))


Notify = Callable[[Progress], None]
Say = Callable[[str], None]
"""Receives sentences on the progress of a search."""


def rows_of_campaign(folder: Path, params: type | None = None) -> list[Row]:
    """Return all rows of a complete campaign in the order of its trials.

    Raises:
        InputError: rows are missing, damaged or of another campaign.
    """
    spec = load(folder, params)
    rows = list(ordered(spec, read_content(folder, campaign_hash(spec), spec).done))
    if len(rows) != spec.trials:
        raise InputError(folder, f"has {len(rows)} of {spec.trials} trials", "go on with the command that began it")
    return rows


def ends_of(rows: list[Row]) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return (n,) whether each row succeeded, and which rows are not trials."""
    works = np.array([row["success"] for row in rows], dtype=bool)
    return works, np.array([not is_trial(row) for row in rows], dtype=bool)

r"""Where the border of success lies, from trials that are picked near it.

After the first trials, each round fits the surrogate, takes three quarters of its points where they tell most of the
border and a quarter from the Sobol sequence, which goes on where the first trials ended and finds what the surrogate
does not expect. It ends once the surrogate, found to its end, expects to be wrong on less than `CLOSE` of the set in
two rounds running, or at the budget. Batches are small: a large one picks its last points from a guess that its first
ones would have changed.

Rows that were picked so are no sample: no rate, interval or test may be made of them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Generator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.campaign.claims.engine import Looked, Say
from skillframe.campaign.claims.surrogate import Surrogate
from skillframe.frames import Float

BUDGET = {1: 160, 2: 544, 3: 1024, 4: 2048}
"""Trials after which the search ends in any case; our choice, from runs on synthetic truths."""
BATCH = {1: 16, 2: 32, 3: 64, 4: 128}
"""Points of a round, and an eighth of the budget at most. Half as many ended some searches before they had found all
of the set, and batches that grow took a quarter more trials (truths of tests/figures/test_searches.py)."""
EXPLORED = 4
"""Every EXPLORED-th point of a round is the Sobol sequence's next."""
CANDIDATES, CLOUD = 2048, 8192
CLOSE, RUNNING = 0.05, 2
ISLANDS = 3.0
"""Rule of three: what none of n even points met is with 95 % confidence at most 3 / n of the whole."""


class ToTry(NamedTuple):
    """Points to try: (n, d), the first `explored` of them even over the ranges whatever came before."""

    points: Float
    explored: int


class Border(NamedTuple):
    """What a search came to.

    Attributes:
        trials: all that were looked at.
        explored: how many of them are even over the ranges.
        doubt: volume that is expected to be predicted wrong, over that of the set: the mean of min(p, 1 - p) over the
            mean of p, p being how sure it is that most trials succeed; see `doubt_of`.
        settled: whether it ended by itself, and not at the budget.
        share: of the ranges' volume in which trials are predicted to succeed.
        edges: (d, 2) whether the predicted set reaches the low and the high end of each range.
    """

    trials: int
    explored: int
    doubt: float
    settled: bool
    share: float
    edges: tuple[tuple[bool, bool], ...]


Sobol = Callable[[int, int], Float]
"""Points first .. last - 1 of the sequence whose beginning was looked at, (n, d)."""


def cloud(dimension: int, count: int = CLOUD, seed: int = 0) -> Float:
    """(count, d) even points in the scaled ranges."""
    from scipy.stats import qmc

    points: Float = 2.0 * qmc.Sobol(dimension, scramble=True, rng=np.random.default_rng(seed)).random(count) - 1.0
    return points


def batch_size(dimension: int, budget: int) -> int:
    """Points of a round: `BATCH`, and an eighth of the budget at most."""
    return min(BATCH[dimension], max(EXPLORED, budget // 8 // EXPLORED * EXPLORED))


def search(
    seen: Looked, explored: int, sobol: Sobol, budget: int, say: Say = lambda text: None
) -> Generator[ToTry, Looked, Border]:
    """Yields what to try and is sent how it ended.

    Args:
        seen: trials so far, at least one.
        explored: how many of them are the Sobol sequence's first.
        sobol: the points that follow.
        budget: trials in all.
        say: told how far it is.
    """
    dimension = seen.points.shape[1]
    even, number, calm = cloud(dimension), 0, 0
    batch, surrogate = batch_size(dimension, budget), Surrogate(seen.points, seen.works)
    sure = surrogate.above(even)
    while len(seen.works) < budget and calm < RUNNING:
        number += 1
        count = min(batch, budget - len(seen.works))
        share = math.ceil(count / EXPLORED)
        offered = cloud(dimension, CANDIDATES, number)
        picks = offered[surrogate.telling(offered, count - share)]
        ended = yield ToTry(np.concatenate([sobol(explored, explored + share), picks]), share)
        seen, explored = seen.with_more(ended), explored + share
        surrogate = Surrogate(seen.points, seen.works)
        sure = surrogate.above(even)
        doubt = doubt_of(sure, seen.works)
        calm = calm + 1 if doubt < CLOSE and surrogate.settled else 0
        say(_progress(doubt, len(seen.works), to_go(doubt, calm, len(seen.works), batch, budget)))
    share_that_works, edges = float(np.mean(sure > 0.5)), edges_of(surrogate, dimension)
    return Border(len(seen.works), explored, doubt_of(sure, seen.works), calm >= RUNNING, share_that_works, edges)


def doubt_of(sure: Float, works: NDArray[np.bool_]) -> float:
    """`Border.doubt`, at most 1.

    It is 1 where some trials work and no place is predicted to: what was seen to work is taken for noise, and no border
    is known. Where no trial works it is the share of the ranges that is expected to.

    Args:
        sure: (m,) at even points, how sure it is that most trials succeed.
        works: (n,) whether each trial succeeded.
    """
    if not works.any():
        return float(np.mean(sure))
    return float(np.mean(np.minimum(sure, 1.0 - sure)) / np.mean(sure))


def to_go(doubt: float, calm: int, trials: int, batch: int, budget: int) -> int:
    """A guess of the trials that are left: the error falls as one over the trials, and the end takes calm rounds."""
    if calm >= RUNNING:
        return 0
    rounds = batch * (RUNNING - calm)
    falling = trials * (doubt / CLOSE - 1.0) if doubt > CLOSE else 0.0
    return max(0, min(max(rounds, math.ceil(falling / 8) * 8), budget - trials))


def _progress(doubt: float, trials: int, left: int) -> str:
    within = f"border within {100.0 * max(doubt, 0.001):.2g} % after {trials} trials"
    return f"{within}, about {left} trials to go" if left else within


def edges_of(surrogate: Surrogate, dimension: int) -> tuple[tuple[bool, bool], ...]:
    """Whether trials are predicted to succeed somewhere at the low and the high end of each range."""
    found = []
    for i in range(dimension):
        face = cloud(dimension, 1024)
        ends = []
        for end in (-1.0, 1.0):
            face[:, i] = end
            ends.append(bool(np.any(surrogate.mean(face) > 0.0)))
        found.append((ends[0], ends[1]))
    return tuple(found)

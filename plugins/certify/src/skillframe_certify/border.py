r"""Adaptive search for the border between success and failure.

Each round fits the surrogate. Three quarters of its points reduce the border's uncertainty most; the rest continue the
first trials' Sobol sequence, to find regions that the surrogate misses. The search ends when a converged surrogate
expects errors on less than `CLOSE` of the success set in two consecutive rounds, or at the budget.

The picked trials are not a random sample: no rate, interval or test may be computed from them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Generator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float
from skillframe_certify.engine import Looked, Say
from skillframe_certify.surrogate import Surrogate

BUDGET = {1: 160, 2: 544, 3: 1024, 4: 2048}
"""Most trials of a search by dimension, enough to settle on the synthetic sets of tests/figures/test_searches.py."""
EXPLORED = 4
"""Every EXPLORED-th point of a round continues the Sobol sequence."""
CANDIDATES = 2048
CLOSE, RUNNING = 0.05, 2


class ToTry(NamedTuple):
    """Points to try, (n, d). The first `explored` of them fill the ranges evenly."""

    points: Float
    explored: int


class Border(NamedTuple):
    """Result of a border search.

    Attributes:
        trials: number of all trials used.
        explored: how many of them fill the ranges evenly.
        doubt: expected volume of wrong predictions over that of the success set: mean of min(p, 1 - p) over mean of p,
            where p is the probability that most trials succeed at a point; see `doubt_of`.
        settled: whether the search converged before its budget.
        share: of the ranges' volume in which success is predicted.
        edges: (d, 2) whether the predicted set reaches the low and the high end of each range.
    """

    trials: int
    explored: int
    doubt: float
    settled: bool
    share: float
    edges: tuple[tuple[bool, bool], ...]


Sobol = Callable[[int, int], Float]
"""Points first .. last - 1 of the exploratory Sobol sequence, (n, d)."""


def cloud(dimension: int, count: int = 8192, seed: int = 0) -> Float:
    """Return (count, d) even points in the scaled ranges."""
    from scipy.stats import qmc

    points: Float = 2.0 * qmc.Sobol(dimension, scramble=True, rng=np.random.default_rng(seed)).random(count) - 1.0
    return points


def batch_size(dimension: int, budget: int) -> int:
    """Return the number of points of a round, at most an eighth of the budget.

    Smaller rounds may end before all of the set is found.
    """
    return min({1: 16, 2: 32, 3: 64, 4: 128}[dimension], max(EXPLORED, budget // 8 // EXPLORED * EXPLORED))


def search(
    seen: Looked, explored: int, sobol: Sobol, budget: int, say: Say = lambda text: None
) -> Generator[ToTry, Looked, Border]:
    """Search the border: yield points to try, receive their outcomes.

    Args:
        seen: trials so far, at least one.
        explored: how many of them begin the Sobol sequence.
        sobol: the points that follow.
        budget: trials in all.
        say: receives the progress.
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
        left = to_go(doubt, calm, len(seen.works), batch, budget)
        within = f"border within {100.0 * max(doubt, 0.001):.2g} % after {len(seen.works)} trials"
        say(f"{within}, about {left} trials to go" if left else within)
    share_that_works, edges = float(np.mean(sure > 0.5)), edges_of(surrogate, dimension)
    return Border(len(seen.works), explored, doubt_of(sure, seen.works), calm >= RUNNING, share_that_works, edges)


def doubt_of(sure: Float, works: NDArray[np.bool_]) -> float:
    """Return `Border.doubt`, at most 1.

    It is 1 if some trials succeed but success is predicted nowhere, since no border is known then. If no trial
    succeeds, it is the predicted share of success.

    Args:
        sure: (m,) probability at even points that most trials succeed.
        works: (n,) whether each trial succeeded.
    """
    if not works.any():
        return float(np.mean(sure))
    return float(np.mean(np.minimum(sure, 1.0 - sure)) / np.mean(sure))


def to_go(doubt: float, calm: int, trials: int, batch: int, budget: int) -> int:
    """Estimate the remaining trials, for an error that falls as 1 / trials and `RUNNING` calm rounds at the end."""
    if calm >= RUNNING:
        return 0
    rounds = batch * (RUNNING - calm)
    falling = trials * (doubt / CLOSE - 1.0) if doubt > CLOSE else 0.0
    return max(0, min(max(rounds, math.ceil(falling / 8) * 8), budget - trials))


def edges_of(surrogate: Surrogate, dimension: int) -> tuple[tuple[bool, bool], ...]:
    """Return whether success is predicted somewhere at the low and the high end of each range."""
    found = []
    for i in range(dimension):
        face = cloud(dimension, 1024)
        ends = []
        for end in (-1.0, 1.0):
            face[:, i] = end
            ends.append(bool(np.any(surrogate.mean(face) > 0.0)))
        found.append((ends[0], ends[1]))
    return tuple(found)

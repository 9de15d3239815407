r"""The claim and its test.

Nested boxes are fixed first, all with the claim that the success probability is at least p. Then n independent trials
are sampled in the largest. From the smallest box on, each is tested by the one-sided exact binomial test at the full
alpha, up to the first failure (fixed-sequence testing: Maurer, Hothorn and Lehmacher 1995; Angelopoulos et al. 2021,
"Learn then test", arXiv 2110.01052). The probability of any false certificate is at most alpha, however the boxes were
proposed.

A folder's k-th claim is tested at alpha / 2^(k-1) with its own fresh trials. The certificate states the sum, 1.5 alpha
after two claims.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float
from skillframe_certify.box import Box

SHARES = (0.7, 0.85, 1.0)
"""Volumes of the nested boxes relative to the largest; the smallest still holds enough trials to pass."""


class Tested(NamedTuple):
    """Test result of a box.

    Attributes:
        box: scaled.
        trials: number of trials in it.
        failures: how many of them failed.
        passed: the test passed and no start in the box was refused.
        refused: number of starts in collision, which are not trials.
    """

    box: Box
    trials: int
    failures: int
    passed: bool
    refused: int = 0


def family(box: Box) -> tuple[Box, ...]:
    """Return the nested boxes, smallest first."""
    return tuple(box.shrunk(share) for share in SHARES)


def passes(failures: int, trials: int, rate: float, alpha: float) -> bool:
    """Return whether so few failures have probability alpha at most if the success probability is `rate`."""
    from scipy.special import bdtr  # as scipy.stats.binom.cdf, which takes half a second to load

    return bool(trials > 0 and bdtr(failures, trials, 1.0 - rate) <= alpha)


def most_failures(trials: int, rate: float, alpha: float) -> int:
    """Return the largest number of failures that still passes, or -1."""
    from scipy.stats import binom

    most = int(binom.ppf(alpha, trials, 1.0 - rate))
    return next((k for k in range(most, -1, -1) if passes(k, trials, rate, alpha)), -1)


def fresh_trials(rate: float, alpha: float) -> int:
    """Return the number of trials to sample in the largest box.

    The smallest box's share of them passes with probability 0.95 if failures are 5 times rarer than allowed.
    """
    from scipy.stats import binom

    good = (1.0 - rate) / 5.0
    low, high = 1, 100_000
    while low < high:  # power rises with n up to small saw-teeth, which cost a trial or two
        middle = (low + high) // 2
        if binom.cdf(most_failures(middle, rate, alpha), middle, good) >= 0.95:
            high = middle
        else:
            low = middle + 1
    return math.ceil(low / SHARES[0])


def judge(
    boxes: Sequence[Box], points: Float, works: NDArray[np.bool_], rate: float, alpha: float,
    refused: NDArray[np.bool_] | None = None,
) -> tuple[Tested, ...]:  # fmt: skip
    """Test nested boxes in order, up to the first that fails.

    Args:
        boxes: smallest first.
        points: (n, d) fresh trials, scaled.
        works: (n,) whether they succeeded.
        rate: claimed success probability.
        alpha: level of each test.
        refused: (n,) which starts were in collision; None for none. They are not trials, and a box that holds one
            fails.
    """
    tested: list[Tested] = []
    none = np.zeros(len(works), dtype=bool) if refused is None else refused
    for box in boxes:
        inside, gone = box.holds(points) & ~none, int(np.sum(box.holds(points) & none))
        trials, failures = int(inside.sum()), int(np.sum(~works[inside]))
        tested.append(Tested(box, trials, failures, not gone and passes(failures, trials, rate, alpha), gone))
        if not tested[-1].passed:
            break
    return tuple(tested)


def certified(tested: Sequence[Tested]) -> Tested | None:
    """Return the largest box that passed."""
    return next((each for each in reversed(tested) if each.passed), None)

r"""What is claimed, before it is tested, and the test.

A family of nested boxes is fixed first, each with the same claim: the skill succeeds there with probability p at least.
Then n trials are drawn independently in the largest. From the smallest box to the largest, each is tested with the
trials that fell into it by the one-sided exact binomial test at the full alpha; the first that fails ends the sequence
(fixed-sequence testing: Maurer, Hothorn and Lehmacher 1995; as in Angelopoulos et al. 2021, "Learn then test",
arXiv 2110.01052). The chance of any false certificate is then alpha at most, whatever proposed the boxes.

A folder's k-th claim is tested at alpha / 2^(k-1) with fresh trials of its own: after two, the chance that any of the
two is falsely certified is 1.5 alpha at most, and the certificate says so.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.campaign.claims.box import Box
from skillframe.frames import Float

SHARES = (0.7, 0.85, 1.0)
"""Volumes of the nested boxes over the largest one's; our choice: the smallest still holds trials enough to pass."""
MARGIN, POWER = 5.0, 0.95
"""A claim is planned so that a skill that fails MARGIN times more seldom than is allowed passes with POWER; ours."""
MOST_FRESH = 100_000


class Tested(NamedTuple):
    """A box after its trials.

    Attributes:
        box: scaled.
        trials: how many fell into it.
        failures: how many of them failed.
        passed: the test at its level.
    """

    box: Box
    trials: int
    failures: int
    passed: bool


def family(box: Box) -> tuple[Box, ...]:
    """The nested boxes, the smallest first."""
    return tuple(box.shrunk(share) for share in SHARES)


def passes(failures: int, trials: int, rate: float, alpha: float) -> bool:
    """Whether so few failures would come with probability alpha at most if the success probability were `rate`."""
    from scipy.stats import binom

    return bool(trials > 0 and binom.cdf(failures, trials, 1.0 - rate) <= alpha)


def most_failures(trials: int, rate: float, alpha: float) -> int:
    """The largest number of failures that still passes, or -1 if none does."""
    from scipy.stats import binom

    most = int(binom.ppf(alpha, trials, 1.0 - rate))
    return next((k for k in range(most, -1, -1) if passes(k, trials, rate, alpha)), -1)


def fresh_trials(rate: float, alpha: float) -> int:
    """How many trials to draw in the largest box.

    Such that the smallest box's share of them passes with probability `POWER` for a skill that fails `MARGIN` times
    more seldom than is allowed.
    """
    from scipy.stats import binom

    good = (1.0 - rate) / MARGIN
    low, high = 1, MOST_FRESH
    while low < high:  # power rises with n but for small saw-teeth, which cost a trial or two
        middle = (low + high) // 2
        if binom.cdf(most_failures(middle, rate, alpha), middle, good) >= POWER:
            high = middle
        else:
            low = middle + 1
    return math.ceil(low / SHARES[0])


def judge(
    boxes: Sequence[Box], points: Float, works: NDArray[np.bool_], rate: float, alpha: float
) -> tuple[Tested, ...]:
    """Test nested boxes in their order, up to the first that fails.

    Args:
        boxes: the smallest first.
        points: (n, d) fresh trials, scaled.
        works: (n,) whether they succeeded.
        rate: that is claimed.
        alpha: of each test.
    """
    tested: list[Tested] = []
    for box in boxes:
        inside = box.holds(points)
        trials, failures = int(inside.sum()), int(np.sum(~works[inside]))
        tested.append(Tested(box, trials, failures, passes(failures, trials, rate, alpha)))
        if not tested[-1].passed:
            break
    return tuple(tested)


def certified(tested: Sequence[Tested]) -> Tested | None:
    """The largest box that passed."""
    return next((each for each in reversed(tested) if each.passed), None)

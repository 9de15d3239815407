r"""How sure a success rate is: intervals for a fixed plan, intervals one may look at all the time, and paired tests.

Fixed number of trials: the exact two-sided interval of Clopper and Pearson (1934), the alpha/2 quantiles of beta
distributions. Looked at after every trial, that interval is wrong far more often than it says; stopping early uses the
beta-mixture confidence sequence instead (Robbins 1970): with the prior Beta(a, b), a = b = 1/2, of the alternative,

    M_n(p) = B(s + a, f + b) / ( B(a, b) p^s (1 - p)^f )

is a martingale of mean 1 at the true p, so by Ville's inequality {p : M_n(p) < 1/alpha} holds the truth at all n at
once with probability 1 - alpha. Two skills on the same draws are compared on the trials where they differ (McNemar
1947): w that only the first wins, l that only the second wins, exactly binomial with 1/2 if they are equal; peeked at,
by the same martingale at p = 1/2. Several pairs are corrected together by Holm's step-down method (1979), which needs
nothing of how the p-values depend on each other.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from skillframe.frames import Float

CLOPPER_PEARSON = "Clopper-Pearson (exact, two-sided, fixed number of trials)"
SEQUENCE = "beta(1/2,1/2)-mixture confidence sequence (two-sided, valid at every look)"
MCNEMAR = "McNemar (exact, two-sided, fixed number of trials)"
MCNEMAR_SEQUENTIAL = "sequential McNemar (beta(1/2,1/2) mixture, valid at every look)"
PRIOR = 0.5
"""a = b of the mixture: Jeffreys' prior, sharpest of those measured where nearly all trials succeed."""


class Interval(NamedTuple):
    """Bounds of a success probability."""

    low: float
    high: float

    @property
    def width(self) -> float:
        """High minus low."""
        return self.high - self.low


def clopper_pearson(successes: int, trials: int, alpha: float = 0.05) -> Interval:
    """Exact two-sided interval of level 1 - alpha for a number of trials that was fixed beforehand."""
    from scipy.special import betaincinv  # what scipy.stats.beta.ppf gives, without the second that takes to load

    s, f = successes, trials - successes
    low = float(betaincinv(s, f + 1, alpha / 2)) if s else 0.0
    high = float(betaincinv(s + 1, f, 1 - alpha / 2)) if f else 1.0
    return Interval(low, high)


def log_mixture(successes: int, failures: int, probability: float) -> float:
    """Logarithm of M_n(p), the evidence against p being the success probability."""
    return float(log_mixtures(successes, failures, probability))


def log_mixtures(successes: ArrayLike, failures: ArrayLike, probability: float) -> Float:
    """`log_mixture` of several counts, (n,) each. Counts that are expected need not be whole."""
    from scipy.special import betaln, xlog1py, xlogy

    won, lost = np.asarray(successes, dtype=float), np.asarray(failures, dtype=float)
    gain = betaln(won + PRIOR, lost + PRIOR) - betaln(PRIOR, PRIOR)
    result: Float = gain - xlogy(won, probability) - xlog1py(lost, -probability)
    return result


def confidence_sequence(successes: int, trials: int, alpha: float = 0.05) -> Interval:
    """Two-sided interval of level 1 - alpha that holds at all numbers of trials at once.

    log M is convex in p with its minimum at s/n, so each bound is the one root on its side.
    """
    from scipy.optimize import brentq

    if trials == 0:
        return Interval(0.0, 1.0)
    s, f = successes, trials - successes
    rate = s / trials

    def excess(p: float) -> float:
        return log_mixture(s, f, p) + math.log(alpha)

    tiny = 1e-300  # log M stays finite here, and no bound that matters lies nearer to 0 or 1
    low = brentq(excess, tiny, rate, xtol=1e-12) if s and excess(tiny) > 0.0 else 0.0
    near_one = 1.0 - 1e-16
    high = brentq(excess, rate, near_one, xtol=1e-12) if f and excess(near_one) > 0.0 else 1.0
    return Interval(float(low), float(high))


def mcnemar(only_first: int, only_second: int) -> float:
    """Exact two-sided p-value of "both skills are equally good", for a number of trials fixed beforehand."""
    from scipy.stats import binomtest

    n = only_first + only_second
    return float(binomtest(only_first, n, 0.5).pvalue) if n else 1.0


def mcnemar_sequential(only_first: int, only_second: int) -> float:
    """p-value of "both skills are equally good" that may be looked at after every trial: min(1, 1/M_n(1/2))."""
    return float(mcnemar_sequentials(only_first, only_second))


def mcnemar_sequentials(only_first: ArrayLike, only_second: ArrayLike) -> Float:
    """`mcnemar_sequential` of several counts, (n,) each. Counts that are expected need not be whole."""
    result: Float = np.minimum(1.0, np.exp(-log_mixtures(only_first, only_second, 0.5)))
    return result


def holm(p_values: Sequence[float]) -> list[float]:
    """p-values (k,) corrected so that any of k true hypotheses is below alpha with probability alpha at most.

    The i-th smallest (i = 0 ...) is multiplied by k - i, and no corrected value is below one that comes before it.
    """
    corrected, largest = [0.0] * len(p_values), 0.0
    for i, place in enumerate(sorted(range(len(p_values)), key=p_values.__getitem__)):
        largest = max(largest, min(1.0, (len(p_values) - i) * p_values[place]))
        corrected[place] = largest
    return corrected


def correction(pairs: int) -> str:
    """What was done for several pairs, in words."""
    return f"Holm over {pairs} pairs" if pairs > 1 else "none, there is one pair"

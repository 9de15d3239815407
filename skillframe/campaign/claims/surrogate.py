r"""A smooth guess of where a skill works, from trials that did and did not: a Gaussian process classifier.

A trial at x succeeds with probability Phi(f(x)), Phi being the normal distribution function and f a hidden function of
the d quantities. The covariance of f is the Matern one of order 5/2, with one length l_i per quantity and an amplitude
a (Rasmussen and Williams 2006, "Gaussian processes for machine learning", equation 4.17),

    k(r) = a^2 (1 + sqrt(5) r + 5 r^2 / 3) exp(-sqrt(5) r),      r^2 = sum ((x_i - x'_i) / l_i)^2,

so that a sharp border is a smooth f that passes 0 steeply. What labels say of it is found by `propagation`. Lengths and
amplitude maximise the evidence of `laplace` over fixed ladders, one coordinate after the other, from two places: from
one alone the climb may end on a lower hill. The mean of f before any trial is 0, that is "unknown". Ladders and
beginnings are our choice. Nothing that is claimed rests on it: it proposes, fresh trials decide.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular
from scipy.special import log_ndtr, ndtr

from skillframe.campaign.claims.laplace import JITTER, evidence
from skillframe.campaign.claims.propagation import posterior
from skillframe.frames import Float

LENGTHS = tuple(float(v) for v in np.geomspace(0.05, 6.0, 14))
AMPLITUDES = tuple(float(2**i) for i in range(7))
FROM = ((1.0, 16.0), (0.3, 4.0))
"""Length and amplitude where the climbs to the largest evidence begin."""
MOST_ROWS = 320
"""Rows by which lengths and amplitude are chosen, the first ones and as many from first to last: the first alone may
have met too little of the set, and the others lie near its border. More cost their third power."""
MOST_KNOWN = 2048
"""Trials that it knows, the last ones: points that were picked come last, and cost grows with the third power."""
BLOCK = 1024
"""Points that are asked about at a time."""
ROUNDS = 3
DECIMALS = 6
"""Digits of a gain, or of how sure a place is, that count."""
DOUBTED = 512
"""Candidates among which points are picked; ours, from runs on synthetic truths. All 2048 pick no better."""


class Surrogate:
    """The guess.

    Attributes:
        lengths: (d,) of the quantities, in their scaled units.
        amplitude: standard deviation of f before any trial.
        settled: whether what the labels say of f was found to its end (`propagation`).

    Args:
        points: (n, d) of the trials, each quantity scaled to -1 to 1 over its range.
        works: (n,) whether the trial succeeded.
    """

    def __init__(self, points: Float, works: NDArray[np.bool_]) -> None:
        points, labels = points[-MOST_KNOWN:], np.where(works[-MOST_KNOWN:], 1.0, -1.0)
        self.lengths, self.amplitude = _chosen(points, labels)
        self._points = points
        self._known = posterior(self._covariance(points, points), labels)
        self.settled = self._known.settled

    def mean(self, points: Float) -> Float:
        """(m,) means of f at (m, d) points: above 0 where it works, below where it does not."""
        return _by_blocks(lambda some: self._covariance(some, self._points) @ self._known.weights, points)

    def deviation(self, points: Float) -> Float:
        """(m,) standard deviations of f at (m, d) points."""
        variance = _by_blocks(lambda some: self.amplitude**2 - np.sum(self._whitened(some) ** 2, axis=0), points)
        result: Float = np.sqrt(np.maximum(variance, 0.0))
        return result

    def success(self, points: Float) -> Float:
        """(m,) success probabilities at (m, d) points, over all that f may be."""
        result: Float = ndtr(self.mean(points) / np.sqrt(1.0 + self.deviation(points) ** 2))
        return result

    def above(self, points: Float) -> Float:
        """(m,) how sure it is that f is above 0 at (m, d) points, which is that most trials succeed there."""
        result: Float = ndtr(self.mean(points) / np.maximum(self.deviation(points), JITTER * self.amplitude))
        return result

    def _covariance(self, first: Float, second: Float) -> Float:
        return self.amplitude**2 * covariance(first, second, self.lengths)

    def _whitened(self, points: Float) -> Float:
        """(n, m): what the trials tell of f at the points, whose squares add up to the variance taken away."""
        cross = self._known.root[:, None] * self._covariance(self._points, points)
        result: Float = solve_triangular(self._known.factor, cross, lower=True, check_finite=False)
        return result

    def telling(self, candidates: Float, count: int) -> NDArray[np.intp]:
        """Which of (m, d) even candidates to try next to learn where the border lies, (count,) indices.

        Wanted is a small sum of p (1 - p) over the candidates, p = Phi(mean / s) being how sure it is that f is above 0
        (the stepwise uncertainty reduction of Bect et al. 2012, "Sequential design of computer experiments for the
        estimation of a probability of failure", Statistics and Computing 22). To first order in what a label at c
        moves the mean (ours), it takes from it

            sum_i phi(m_i / s_i)^2 / s_i^2 g_c C_ic^2,      g = phi(z)^2 / ((1 + s^2) Phi(z) Phi(-z)),
            z = m / sqrt(1 + s^2).

        C is the covariance of f, and g_c C_cc^2 the variance of what the label does to the mean at c. Points are picked
        greedily: each shrinks C as a label does in the mean, and leaves m. Only the `DOUBTED` candidates count whose
        sign is the least sure. Gains are rounded and ties go to the smaller index, so that last bits of other
        processors pick the same.
        """
        sure = np.round(np.abs(self.above(candidates) - 0.5), DECIMALS)
        chosen = np.sort(np.argsort(sure, kind="stable")[: max(DOUBTED, count)])
        there = candidates[chosen]
        half, mean = self._whitened(there), self.mean(there)
        spread = self._covariance(there, there) - half.T @ half
        picked: list[int] = []
        for _ in range(count):
            variance = np.maximum(np.diag(spread), JITTER * self.amplitude**2)
            at = mean / np.sqrt(1.0 + variance)
            share = np.exp(-(at**2) - log_ndtr(at) - log_ndtr(-at)) / (2.0 * np.pi * (1.0 + variance))
            doubt = np.exp(-(mean**2) / variance) / (2.0 * np.pi * variance)
            gain = np.round(doubt @ spread**2 * share, DECIMALS)
            gain[picked] = -np.inf
            best = int(np.argmax(gain))
            column = np.sqrt(share[best]) * spread[:, best]
            spread = spread - column[:, None] * column
            picked.append(best)
        result: NDArray[np.intp] = chosen[picked]
        return result


def _by_blocks(of: Callable[[Float], Float], points: Float) -> Float:
    """What is asked of (m, d) points, some at a time: 8192 of them and 2048 trials would take a gigabyte."""
    return np.concatenate([of(points[i : i + BLOCK]) for i in range(0, len(points), BLOCK)])


def covariance(first: Float, second: Float, lengths: Float) -> Float:
    """Matern 5/2 covariance (n, m) of (n, d) and (m, d) points, of amplitude 1."""
    a, b = first / lengths, second / lengths
    squared = np.maximum((a**2).sum(1)[:, None] + (b**2).sum(1) - 2.0 * a @ b.T, 0.0)
    r = np.sqrt(5.0 * squared)
    result: Float = (1.0 + r + r**2 / 3.0) * np.exp(-r)
    return result


def _chosen(points: Float, labels: Float) -> tuple[Float, float]:
    """Lengths (d,) and amplitude on the ladders: of what some rows find best, what explains all of them best."""
    count = len(points)
    evenly = np.unique(np.linspace(0, count - 1, MOST_ROWS).round().astype(int))
    samples = [evenly] if count <= MOST_ROWS else [np.arange(MOST_ROWS), evenly]
    found = [max((_climbed(points[s], labels[s], *start) for start in FROM), key=lambda one: one[0]) for s in samples]
    if len(found) > 1:
        found.sort(key=lambda one: _evidence(points, labels, *one[1:]))
    _, lengths, amplitude = found[-1]
    return lengths, amplitude


def _climbed(points: Float, labels: Float, length: float, amplitude: float) -> tuple[float, Float, float]:
    """A local maximum of the evidence, its lengths (d,) and its amplitude, one coordinate after the other."""
    dimension = points.shape[1]
    ladders = [LENGTHS] * dimension + [AMPLITUDES]
    places = [_nearest(LENGTHS, length)] * dimension + [_nearest(AMPLITUDES, amplitude)]

    def at(rungs: list[int]) -> tuple[Float, float]:
        return np.array([LENGTHS[i] for i in rungs[:-1]]), AMPLITUDES[rungs[-1]]

    best = _evidence(points, labels, *at(places))
    for _ in range(ROUNDS):
        before = best
        for i, ladder in enumerate(ladders):
            for step in (-1, 1):
                while 0 <= places[i] + step < len(ladder):
                    tried = [*places[:i], places[i] + step, *places[i + 1 :]]
                    found = _evidence(points, labels, *at(tried))
                    if found <= best:
                        break
                    best, places = found, tried
        if best == before:
            break
    return best, *at(places)


def _nearest(ladder: tuple[float, ...], value: float) -> int:
    return ladder.index(min(ladder, key=lambda rung: abs(rung - value)))


def _evidence(points: Float, labels: Float, lengths: Float, amplitude: float) -> float:
    try:
        return evidence(amplitude**2 * covariance(points, points, lengths), labels)
    except np.linalg.LinAlgError:
        return -np.inf

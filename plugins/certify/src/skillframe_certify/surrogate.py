r"""Smooth prediction of success from trials: a Gaussian process classifier.

A trial at x succeeds with probability Phi(f(x)), with the normal distribution function Phi and a hidden function f of
the d quantities, whose prior mean is 0. Its covariance is the Matern one of order 5/2, with lengths l_i and amplitude a
(Rasmussen and Williams 2006, "Gaussian processes for machine learning", equation 4.17),

    k(r) = a^2 (1 + sqrt(5) r + 5 r^2 / 3) exp(-sqrt(5) r),      r^2 = sum ((x_i - x'_i) / l_i)^2.

Lengths and amplitude maximise the evidence over fixed grids by coordinate ascent from two starts, against local maxima.
No claim rests on the surrogate.

*Posterior.* Labels y are 1 and -1, f has covariance K at the n trials, and p(y | f) = Phi(y f). Expectation propagation
replaces each label by a normal distribution of f, of precision tau_i and centre nu_i / tau_i, that matches the mean and
variance of f with the exact label (Minka 2001; Rasmussen and Williams, section 3.6). Means and variances are nearly
exact (Kuss and Rasmussen 2005, JMLR 6). Parallel updates need one factorisation a sweep, and damping, because full
steps oscillate. The step adapts, since a fixed one can cycle.

*Evidence.* Laplace's approximation: Newton's method finds the posterior's mode, and the curvature there gives the
evidence (Rasmussen and Williams, algorithm 3.1, derivatives from equation 3.16). It only ranks covariances: where
labels are certain, the mode lies far below the mean.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cholesky, solve_triangular
from scipy.special import log_ndtr, ndtr

from skillframe.frames import Float

LENGTHS = tuple(float(v) for v in np.geomspace(0.05, 6.0, 14))
AMPLITUDES = tuple(float(2**i) for i in range(7))
MOST_ROWS = 320
"""Rows that choose lengths and amplitude: the first ones, which are even, or as many over all. The cost is cubic."""
MOST_KNOWN = 2048
"""Most trials in use, the last ones: picked points come last, and the cost is cubic."""
BLOCK = 1024
"""Points predicted at a time."""
DECIMALS = 6
"""Decimals of a gain or of a probability that are compared."""

JITTER = 1e-6
"""Share of the variance added to the diagonal, so that coincident trials keep K regular."""
CLOSE, MOST_SWEEPS = 1e-5, 200
"""Sweeps end when no label would move a mean by more than this share of its deviation, usually after thirty."""


class Surrogate:
    """The fitted surrogate.

    Attributes:
        lengths: (d,) of the quantities, in their scaled units.
        amplitude: prior standard deviation of f.
        settled: whether the posterior converged.

    Args:
        points: (n, d) of the trials, each quantity scaled to -1 to 1 over its range.
        works: (n,) whether the trial succeeded.
    """

    def __init__(self, points: Float, works: NDArray[np.bool_]) -> None:
        points, labels = points[-MOST_KNOWN:], np.where(works[-MOST_KNOWN:], 1.0, -1.0)
        count = len(points)
        evenly = np.unique(np.linspace(0, count - 1, MOST_ROWS).round().astype(int))
        samples = [evenly] if count <= MOST_ROWS else [np.arange(MOST_ROWS), evenly]
        found = [_climbed(points[s], labels[s]) for s in samples]
        if len(found) > 1:
            found.sort(key=lambda one: _evidence(points, labels, *one[1:]))
        _, lengths, amplitude = found[-1]
        self.lengths, self.amplitude = lengths, amplitude
        self._points = points
        self._known = posterior(self._covariance(points, points), labels)
        self.settled = self._known.settled

    def mean(self, points: Float) -> Float:
        """Return (m,) means of f at (m, d) points, positive where success is likely."""
        return _by_blocks(lambda some: self._covariance(some, self._points) @ self._known.weights, points)

    def deviation(self, points: Float) -> Float:
        """Return (m,) standard deviations of f at (m, d) points."""
        variance = _by_blocks(lambda some: self.amplitude**2 - np.sum(self._whitened(some) ** 2, axis=0), points)
        result: Float = np.sqrt(np.maximum(variance, 0.0))
        return result

    def success(self, points: Float) -> Float:
        """Return (m,) success probabilities at (m, d) points, averaged over f."""
        result: Float = ndtr(self.mean(points) / np.sqrt(1.0 + self.deviation(points) ** 2))
        return result

    def above(self, points: Float) -> Float:
        """Return (m,) probabilities that f > 0 at (m, d) points, so that most trials succeed there."""
        result: Float = ndtr(self.mean(points) / np.maximum(self.deviation(points), JITTER * self.amplitude))
        return result

    def _covariance(self, first: Float, second: Float) -> Float:
        return self.amplitude**2 * covariance(first, second, self.lengths)

    def _whitened(self, points: Float) -> Float:
        """(n, m) values whose squares sum to the variance that the trials remove at each point."""
        cross = self._known.root[:, None] * self._covariance(self._points, points)
        result: Float = solve_triangular(self._known.factor, cross, lower=True, check_finite=False)
        return result

    def telling(self, candidates: Float, count: int) -> NDArray[np.intp]:
        """Return the (count,) indices of the (m, d) even candidates that best locate the border.

        The points shall minimise the sum of p (1 - p) over the candidates, with p = Phi(mean / s) the probability that
        f > 0 (the stepwise uncertainty reduction of Bect et al. 2012, "Sequential design of computer experiments for
        the estimation of a probability of failure", Statistics and Computing 22). To first order in the change of the
        mean, a label at c reduces it by

            sum_i phi(m_i / s_i)^2 / s_i^2 g_c C_ic^2,      g = phi(z)^2 / ((1 + s^2) Phi(z) Phi(-z)),
            z = m / sqrt(1 + s^2).

        C is the covariance of f, and g_c C_cc^2 the variance of the label's effect on the mean at c. Points are picked
        greedily: each shrinks C as a label does on average, and keeps m. Only the `DOUBTED` candidates with the least
        certain sign count. Gains are rounded and ties go to the smaller index, so that all processors pick the same.
        """
        sure = np.round(np.abs(self.above(candidates) - 0.5), DECIMALS)
        chosen = np.sort(np.argsort(sure, kind="stable")[: max(512, count)])
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
    """Evaluate (m, d) points in blocks: 8192 of them and 2048 trials would take a gigabyte at once."""
    return np.concatenate([of(points[i : i + BLOCK]) for i in range(0, len(points), BLOCK)])


def covariance(first: Float, second: Float, lengths: Float) -> Float:
    """Return the Matern 5/2 covariance (n, m) of (n, d) and (m, d) points, of amplitude 1."""
    a, b = first / lengths, second / lengths
    squared = np.maximum((a**2).sum(1)[:, None] + (b**2).sum(1) - 2.0 * a @ b.T, 0.0)
    r = np.sqrt(5.0 * squared)
    result: Float = (1.0 + r + r**2 / 3.0) * np.exp(-r)
    return result


def _climbed(points: Float, labels: Float) -> tuple[float, Float, float]:
    """The evidence's larger local maximum from two starts, its lengths (d,) and amplitude, by coordinate ascent."""
    ladders = [LENGTHS] * points.shape[1] + [AMPLITUDES]

    def at(rungs: tuple[int, ...]) -> tuple[Float, float]:
        return np.array([LENGTHS[i] for i in rungs[:-1]]), AMPLITUDES[rungs[-1]]

    @cache  # ascents come back to their neighbours, and meet each other's
    def reached(rungs: tuple[int, ...]) -> float:
        return _evidence(points, labels, *at(rungs))

    found = []
    for length, amplitude in ((1.0, 16.0), (0.3, 4.0)):
        places = (*[_nearest(LENGTHS, length)] * points.shape[1], _nearest(AMPLITUDES, amplitude))
        for _ in range(3):
            before = places
            for i, ladder in enumerate(ladders):
                for step in (-1, 1):
                    while 0 <= places[i] + step < len(ladder):
                        tried = (*places[:i], places[i] + step, *places[i + 1 :])
                        if reached(tried) <= reached(places):
                            break
                        places = tried
            if places == before:
                break
        found.append(places)
    best = max(found, key=reached)
    return reached(best), *at(best)


def _nearest(ladder: tuple[float, ...], value: float) -> int:
    return ladder.index(min(ladder, key=lambda rung: abs(rung - value)))


def _evidence(points: Float, labels: Float, lengths: Float, amplitude: float) -> float:
    try:
        return evidence(amplitude**2 * covariance(points, points, lengths), labels)
    except np.linalg.LinAlgError:
        return -np.inf


class Posterior(NamedTuple):
    """Posterior of f at the trials.

    Attributes:
        weights: (n,) of the trials' covariances in the mean of f elsewhere.
        root: (n,) square roots of the precisions tau.
        factor: (n, n) lower Cholesky factor of I + tau^1/2 K tau^1/2.
        settled: whether the sweeps converged; otherwise the other values are less accurate.
    """

    weights: Float
    root: Float
    factor: Float
    settled: bool


def posterior(gram: Float, labels: Float) -> Posterior:
    """Return the posterior.

    Args:
        gram: (n, n) covariance K of f at the trials.
        labels: (n,) of 1 and -1.

    Raises:
        numpy.linalg.LinAlgError: K is not positive definite.
    """
    count = len(labels)
    gram = gram + JITTER * gram[0, 0] * np.eye(count)
    precision, pull, settled = np.zeros(count), np.zeros(count), False
    share, before = 0.6, np.inf
    for _ in range(MOST_SWEEPS):
        root = np.sqrt(precision)
        factor = factor_of(gram, root)
        half = solve_triangular(factor, root[:, None] * gram, lower=True, check_finite=False)
        variance, mean = np.diag(gram) - np.sum(half**2, axis=0), gram @ pull - half.T @ (half @ pull)
        without = 1.0 / variance - precision
        spread, centre = 1.0 / without, (mean / variance - pull) / without
        scale = np.sqrt(1.0 + spread)
        at = labels * centre / scale
        ratio = hazard(at)
        exact = centre + labels * spread * ratio / scale
        left = spread - spread**2 * ratio * (at + ratio) / (1.0 + spread)
        moved = float(np.max(np.abs(exact - mean) / np.sqrt(variance)))
        wanted, drawn = np.maximum(1.0 / left - without, 0.0), exact / left - centre * without
        if settled := moved < CLOSE:
            break
        share = max(0.1, 0.8 * share) if moved > before else min(0.6, 1.02 * share)
        precision, pull, before = precision + share * (wanted - precision), pull + share * (drawn - pull), moved
    return Posterior(pull - root * solved(factor, root * (gram @ pull)), root, factor, settled)


def evidence(gram: Float, labels: Float) -> float:
    """Return the logarithm of the labels' approximate probability.

    Args:
        gram: (n, n) covariance K of f at the trials.
        labels: (n,) of 1 and -1.

    Raises:
        numpy.linalg.LinAlgError: K is not positive definite.
    """
    gram = gram + JITTER * gram[0, 0] * np.eye(len(labels))
    _, best, curvature = mode(gram, labels)
    return best - float(np.log(np.diag(factor_of(gram, np.sqrt(curvature)))).sum())


def mode(gram: Float, labels: Float) -> tuple[Float, float, Float]:
    """Mode (n,) of p(y | f) p(f), its logarithm up to a constant, and (n,) minus the curvature of log p(y | f)."""
    weights, hidden = np.zeros(len(labels)), np.zeros(len(labels))
    best = _objective(weights, hidden, labels)
    for _ in range(50):
        slope, curvature = _slope(hidden, labels)
        root = np.sqrt(curvature)
        factor, target = factor_of(gram, root), curvature * hidden + slope
        step = target - root * solved(factor, root * (gram @ target)) - weights
        along, share = gram @ step, 1.0
        reached = _objective(weights + step, hidden + along, labels)
        while reached < best and share > 1e-10:
            share /= 2.0
            reached = _objective(weights + share * step, hidden + share * along, labels)
        if reached - best <= 1e-10 * max(1.0, abs(best)):
            break
        best, weights, hidden = reached, weights + share * step, hidden + share * along
    return hidden, best, _slope(hidden, labels)[1]


def hazard(at: Float) -> Float:
    """(n,) phi / Phi, accurate far below 0."""
    result: Float = np.exp(-0.5 * at**2 - log_ndtr(at)) / np.sqrt(2.0 * np.pi)
    return result


def _slope(hidden: Float, labels: Float) -> tuple[Float, Float]:
    """(n,) slope of log p(y | f), and minus its curvature."""
    at = labels * hidden
    ratio = hazard(at)
    curvature: Float = np.maximum(ratio * (ratio + at), 0.0)
    return labels * ratio, curvature


def factor_of(gram: Float, root: Float) -> Float:
    """Lower Cholesky factor (n, n) of I + R K R, with the diagonal matrix R of `root` (n,)."""
    matrix = root[:, None] * gram * root
    matrix.flat[:: len(root) + 1] += 1.0
    return np.asarray(cholesky(matrix.T, lower=True, overwrite_a=True, check_finite=False))  # .T: LAPACK's own order


def solved(factor: Float, right: Float) -> Float:
    """Solution (n,) of L L^T x = right for a lower Cholesky factor L (n, n)."""
    half = solve_triangular(factor, right, lower=True, check_finite=False)
    result: Float = solve_triangular(factor, half, lower=True, trans=1, check_finite=False)
    return result


def _objective(weights: Float, hidden: Float, labels: Float) -> float:
    """Log p(y | f) p(f) up to a constant, with f = K weights."""
    return float(-0.5 * weights @ hidden + log_ndtr(labels * hidden).sum())

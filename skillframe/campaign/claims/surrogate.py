r"""A smooth guess of where a skill works, from trials that did and did not: least-squares Gaussian process on labels.

Labels y are 1 and -1. With the Matern covariance of order 5/2, one length l_i per quantity (Rasmussen and Williams
2006, "Gaussian processes for machine learning", equation 4.17),

    k(r) = (1 + sqrt(5) r + 5 r^2 / 3) exp(-sqrt(5) r),      r^2 = sum ((x_i - x'_i) / l_i)^2,

and noise variance s^2 on the labels, the mean at x is k(x, X) (K + s^2 I)^-1 y. Lengths and noise maximise the marginal
likelihood (their equation 2.30) over a fixed ladder, one coordinate after the other, from two noises: from one alone
the climb may end on a lower hill, where lengths are so short that no trial tells of its neighbours. Prior mean 0, that
is "unknown", and variance 1 are our choice. Nothing that is claimed rests on it: it proposes, fresh trials decide.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve, solve_triangular

from skillframe.frames import Float

LENGTHS = tuple(float(v) for v in np.geomspace(0.05, 4.0, 13))
NOISES = (1e-3, 1e-2, 0.1, 0.5)
"""Of the labels' variance."""
FROM = (NOISES[1], NOISES[-1])
"""Where the climbs to the largest likelihood begin."""
MOST_ROWS = 320
"""Rows by which lengths and noise are chosen; more hardly change them, and cost their third power."""
ROUNDS = 3
CONFIDENCE, DECIMALS = 1.96, 6
"""Deviations to either side in which the border may lie, and the digits of a score that count."""


class Surrogate:
    """The guess.

    Attributes:
        lengths: (d,) of the quantities, in their scaled units.
        noise: variance of the labels.

    Args:
        points: (n, d) of the trials, each quantity scaled to -1 to 1 over its range.
        works: (n,) whether the trial succeeded.
    """

    def __init__(self, points: Float, works: NDArray[np.bool_]) -> None:
        labels = np.where(works, 1.0, -1.0)
        self.lengths, self.noise = _chosen(points[:MOST_ROWS], labels[:MOST_ROWS])
        self._points = points
        gram = covariance(points, points, self.lengths) + self.noise * np.eye(len(points))
        self._factor = cho_factor(gram, lower=True)
        self._weights = cho_solve(self._factor, labels)

    def mean(self, points: Float) -> Float:
        """(m,) means at (m, d) points: towards 1 where it works, towards -1 where it does not."""
        result: Float = covariance(points, self._points, self.lengths) @ self._weights
        return result

    def deviation(self, points: Float) -> Float:
        """(m,) standard deviations of the guess at (m, d) points, the labels' noise left out."""
        result: Float = np.sqrt(np.maximum(1.0 - np.sum(self._whitened(points) ** 2, axis=0), 0.0))
        return result

    def _whitened(self, points: Float) -> Float:
        """(n, m): the covariance of trials and points, whitened by that of the trials."""
        cross = covariance(self._points, points, self.lengths)
        result: Float = solve_triangular(self._factor[0], cross, lower=True, check_finite=False)
        return result

    def straddle(self, candidates: Float, count: int) -> NDArray[np.intp]:
        """Which of (m, d) candidates to try next to learn where the border lies, (count,) indices.

        The straddle score 1.96 s - |mean| (Bryan et al. 2005, "Active learning for identifying function threshold
        boundaries") is taken greedily: a picked point shrinks the deviations s of the others and leaves the mean.
        Scores are rounded and ties go to the smaller index, so that last bits of other processors pick the same.
        """
        half, mean = self._whitened(candidates), np.abs(self.mean(candidates))
        variance = 1.0 - np.sum(half**2, axis=0)
        picked: list[int] = []
        known: list[Float] = []
        for _ in range(count):
            score = np.round(CONFIDENCE * np.sqrt(np.maximum(variance, 0.0)) - mean, DECIMALS)
            score[picked] = -np.inf
            best = int(np.argmax(score))
            column = covariance(candidates, candidates[best : best + 1], self.lengths)[:, 0] - half.T @ half[:, best]
            for before in known:
                column = column - before * before[best]
            column = column / np.sqrt(max(variance[best], 0.0) + self.noise)
            variance = variance - column**2
            known.append(column)
            picked.append(best)
        return np.array(picked, dtype=np.intp)


def covariance(first: Float, second: Float, lengths: Float) -> Float:
    """Matern 5/2 covariance (n, m) of (n, d) and (m, d) points."""
    a, b = first / lengths, second / lengths
    squared = np.maximum((a**2).sum(1)[:, None] + (b**2).sum(1) - 2.0 * a @ b.T, 0.0)
    r = np.sqrt(5.0 * squared)
    result: Float = (1.0 + r + r**2 / 3.0) * np.exp(-r)
    return result


def _chosen(points: Float, labels: Float) -> tuple[Float, float]:
    """Lengths (d,) and noise of the largest marginal likelihood on the ladder, of climbs from little and much noise."""
    found = (_climbed(points, labels, noise) for noise in FROM)
    _, lengths, noise = max(found, key=lambda one: one[0])
    return lengths, noise


def _climbed(points: Float, labels: Float, noise: float) -> tuple[float, Float, float]:
    """A local maximum of the likelihood, its lengths (d,) and its noise, one coordinate after the other."""
    places = [LENGTHS.index(min(LENGTHS, key=lambda v: abs(v - 1.0)))] * points.shape[1]

    def lengths(at: list[int]) -> Float:
        return np.array([LENGTHS[i] for i in at])

    best = _likelihood(points, labels, lengths(places), noise)
    for _ in range(ROUNDS):
        before = best
        for i in range(len(places)):
            for step in range(len(LENGTHS)):
                tried = [*places[:i], step, *places[i + 1 :]]
                found = _likelihood(points, labels, lengths(tried), noise)
                if found > best:
                    best, places = found, tried
        for tried_noise in NOISES:
            found = _likelihood(points, labels, lengths(places), tried_noise)
            if found > best:
                best, noise = found, tried_noise
        if best == before:
            break
    return best, lengths(places), noise


def _likelihood(points: Float, labels: Float, lengths: Float, noise: float) -> float:
    """Logarithm of the marginal likelihood, but for a constant."""
    try:
        factor = np.linalg.cholesky(covariance(points, points, lengths) + noise * np.eye(len(points)))
    except np.linalg.LinAlgError:
        return -np.inf
    whitened = solve_triangular(factor, labels, lower=True, check_finite=False)
    return float(-0.5 * whitened @ whitened - np.log(np.diag(factor)).sum())

r"""Whether a run is one of those that were certified, and which quantities would explain it: statistics of figures.

Two scores of strangeness are compared with those of N simulated runs of the certificate's box. If the run is a further
sample of the same distribution, all N + 1 are exchangeable, so that the rank of its score is uniform whatever the
distribution (conformal prediction; Vovk, Gammerman and Shafer, Algorithmic Learning in a Random World, 2005):

    p = #{i : s_i >= s} / (N + 1), the run itself included                                                      (1)

- in the box's quantities: quantities are estimated from the figures by a regression on other runs, over a wider box
  (split conformal); s is the largest distance of an estimate beyond the box, in half widths of that estimate.
- in any figure: s sums how far each figure lies beyond the range of all others, in widths of that range.

Both are tested at half the level (Bonferroni), p = min(1, 2 min(p_box, p_any)).

The regression is ridge regression in all monomials of the figures up to the second degree, by the kernel (1 + x.y)^2.
Its residuals when each run is left out have the closed form r_i = a_i / (G^-1)_ii with G = K + l I and a = G^-1 y; they
choose l, and their 90 % quantile is the half width of an estimate.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from skillframe.frames import Float


class Regression:
    """Estimates quantities from figures.

    Attributes:
        coverage: share of simulated runs whose quantity lies within the half width of its estimate.
        alike: fewest runs whose residuals give a half width, so that it is the second largest of them at least.

    Args:
        figures: (N, F) of simulated runs, NaN where a run has none.
        quantities: (N, Q) of the same runs.
        measured: index of a quantity, and of the figure that measures it without a model; None: there is none.
    """

    coverage, alike = 0.9, 19

    def __init__(self, figures: Float, quantities: Float, measured: tuple[int, int] | None = None) -> None:
        self._measured = measured
        known = np.isfinite(figures).any(axis=0)
        self._known = np.flatnonzero(known)
        some = figures[:, self._known]
        self._middle, self._scale = np.nanmedian(some, axis=0), np.nanstd(some, axis=0)
        self._scale[self._scale == 0.0] = 1.0
        self._seen = self._rows(figures)
        self._mean = quantities.mean(axis=0)
        spread = quantities - self._mean
        values, vectors = np.linalg.eigh((1.0 + self._seen @ self._seen.T) ** 2)
        self._weights, self._off = np.zeros_like(spread), np.full_like(spread, np.inf)
        ridges = 10.0 ** np.arange(-3.0, 4.0, 0.5)  # of figures of unit variance
        for share in 1.0 / (values + ridges[:, None]):  # eigenvalues of G^-1 for each l
            weights = vectors @ (share[:, None] * (vectors.T @ spread))
            off = np.abs(weights / (vectors**2 @ share)[:, None])
            better = np.mean(off**2, axis=0) < np.mean(self._off**2, axis=0)
            self._weights[:, better], self._off[:, better] = weights[:, better], off[:, better]
        if measured is not None:
            direct = np.abs(figures[:, measured[1]] - quantities[:, measured[0]])
            self._off[:, measured[0]] = np.where(np.isfinite(direct), direct, self._off[:, measured[0]])

    def half_width(self, figures: Float) -> Float:
        """Half widths (Q,) of the estimates for figures (F,), from runs that have the same figures.

        A run that never slides says less about friction than one that does. Of too few such runs the largest residual
        counts, if it is more than that of all runs.
        """
        missing = self._rows(figures[None])[0, len(self._known) :]
        alike = self._off[(self._seen[:, len(self._known) :] == missing).all(axis=1)]
        off = np.sort(alike if len(alike) >= self.alike else self._off, axis=0)
        usual: Float = off[min(math.ceil(self.coverage * (len(off) + 1)), len(off)) - 1]
        return np.maximum(usual, alike.max(axis=0)) if 0 < len(alike) < self.alike else usual

    def _rows(self, figures: Float) -> Float:
        scaled = (figures[:, self._known] - self._middle) / self._scale
        missing = ~np.isfinite(scaled)
        rows: Float = np.hstack([np.where(missing, 0.0, scaled), missing])
        return rows / math.sqrt(rows.shape[1])

    def estimate(self, figures: Float) -> Float:
        """Estimates (n, Q) for figures (n, F)."""
        result: Float = self._mean + (1.0 + self._rows(figures) @ self._seen.T) ** 2 @ self._weights
        if self._measured is not None:
            direct = figures[:, self._measured[1]]
            result[:, self._measured[0]] = np.where(np.isfinite(direct), direct, result[:, self._measured[0]])
        return result


class Verdict(NamedTuple):
    """A run against simulated ones: both p-values, and p of both together."""

    p_box: float
    p_any: float

    @property
    def p(self) -> float:
        """Probability of such a rank or a higher one, if the run is one of those that were certified."""
        return min(1.0, 2.0 * min(self.p_box, self.p_any))


def beyond(figures: Float) -> Float:
    """For each run of (N, F) how far its figures lie beyond the range of all others', in widths of that range (N,).

    A run that lacks a figure which all others have, or has one that all others lack, is one width beyond.
    """
    missing = np.isnan(figures).astype(float)
    total = np.zeros(len(figures))
    for given in figures.T:
        known = np.isfinite(given)
        column = np.where(known, given, np.median(given[known]) if known.any() else 0.0)
        low, high = _others(column, np.minimum), _others(column, np.maximum)
        out = np.maximum(np.maximum(low - column, column - high), 0.0)
        total += np.where(high > low, out / np.where(high > low, high - low, 1.0), out > 0.0)
    for column in missing.T:
        total += np.abs(column - column.mean()) > 1.0 - 1.5 / len(column)
    return total


def _others(column: Float, least: np.ufunc) -> Float:
    """For each row the smallest (or largest) of all other rows."""
    ahead = least.accumulate(column)
    behind = least.accumulate(column[::-1])[::-1]
    edge = np.inf if least is np.minimum else -np.inf
    result: Float = least(np.r_[edge, ahead[:-1]], np.r_[behind[1:], edge])
    return result


def held(reference: Float, run: Float, low: Float, high: Float, regression: Regression) -> Verdict:
    """Compare a run with simulated ones.

    Args:
        reference: (N, F) figures of simulated runs of the box, which `regression` has not seen.
        run: (F,) figures of the run.
        low: (Q,) lower ends of the box.
        high: (Q,) its upper ends.
        regression: of its quantities.
    """
    both = np.vstack([reference, run])
    estimate, half = regression.estimate(both), np.array([regression.half_width(each) for each in both])
    far = (np.maximum(low - estimate, estimate - high) / half).max(axis=1)
    return Verdict(_rank(far), _rank(beyond(both)))


def _rank(scores: Float) -> float:
    """Equation (1) for the last of the scores."""
    return float(np.mean(scores >= scores[-1] - 1e-12 * np.abs(scores[-1])))

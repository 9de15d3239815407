r"""Where a demonstration changes, before any model: the cuts of least cost, and their segments in K groups.

    min over cuts of  sum over segments sum |x - mean|^2  +  penalty per cut

by dynamic programming (Jackson et al. 2005; exact), on [u, a/2], segments of at least four windows, with the penalty
6 max(s^2, 0.02) ln n and s^2 the median variance within eight windows (ours). A demonstration longer than 400 windows
is looked at in groups of several. The means of all segments are then put into K groups (Lloyd's k-means, weighted by
length, started at the means farthest apart): one of the two places that the phase model starts from.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float

SHORTEST, MOST = 4, 400
Labels = NDArray[np.intp]


def cuts(x: Float) -> list[int]:
    """Inner cuts of a signal (T, n), in increasing order."""
    group = -(-len(x) // MOST)
    if group > 1:
        whole = len(x) // group
        return [group * c for c in cuts(x[: whole * group].reshape(whole, group, -1).mean(axis=1))]
    if len(x) < 2 * SHORTEST:
        return []
    return _least_cost(x, 6.0 * max(_local_variance(x), 0.02) * np.log(len(x)))


def _local_variance(x: Float, width: int = 8) -> float:
    if len(x) < width:
        return float(x.var(axis=0).sum())
    sums, squares = _cumulated(x)
    mean = (sums[width:] - sums[:-width]) / width
    return float(np.median((squares[width:] - squares[:-width]) / width - (mean * mean).sum(axis=-1)))


def _cumulated(x: Float) -> tuple[Float, Float]:
    """Running sums (T + 1, n) of x and (T + 1,) of |x|^2."""
    sums = np.concatenate([np.zeros((1, x.shape[1])), np.cumsum(x, axis=0)])
    return sums, np.concatenate([[0.0], np.cumsum((x * x).sum(axis=1))])


def _least_cost(x: Float, penalty: float) -> list[int]:
    sums, squares = _cumulated(x)
    best, last = np.full(len(x) + 1, np.inf), np.zeros(len(x) + 1, dtype=np.intp)
    best[0] = -penalty
    for t in range(SHORTEST, len(x) + 1):
        s = np.arange(0, t - SHORTEST + 1)
        difference = sums[t] - sums[s]
        cost = best[s] + squares[t] - squares[s] - (difference * difference).sum(axis=1) / (t - s) + penalty
        last[t] = int(cost.argmin())
        best[t] = cost[last[t]]
    found, t = list[int](), len(x)
    while last[t] > 0:
        t = int(last[t])
        found.append(t)
    return found[::-1]


def grouped(signals: Sequence[Float], phases: int) -> list[Labels] | None:
    """Labels of every window from K groups of segments; None if there are fewer segments than groups."""
    bounds = [np.array([0, *cuts(x), len(x)]) for x in signals]
    sizes = np.concatenate([np.diff(b) for b in bounds]).astype(float)
    sums = np.concatenate([np.add.reduceat(x, b[:-1], axis=0) for x, b in zip(signals, bounds, strict=True)])
    if len(sizes) < phases:
        return None
    groups = _k_means(sums / sizes[:, None], sizes, phases)
    result, first = list[Labels](), 0
    for b in bounds:
        count = len(b) - 1
        result.append(np.repeat(groups[first : first + count], np.diff(b)))
        first += count
    return result


def _k_means(points: Float, weight: Float, k: int) -> Labels:
    centres = points[[int(weight.argmax())]]
    while len(centres) < k:
        far = _distances(points, centres).min(axis=1) * weight
        centres = np.vstack([centres, points[[int(far.argmax())]]])
    groups = _distances(points, centres).argmin(axis=1)
    for _ in range(50):
        for j in np.unique(groups):
            mine = groups == j
            centres[j] = (weight[mine, None] * points[mine]).sum(axis=0) / weight[mine].sum()
        again = _distances(points, centres).argmin(axis=1)
        if np.array_equal(again, groups):
            break
        groups = again
    result: Labels = groups.astype(np.intp)
    return result


def _distances(points: Float, centres: Float) -> Float:
    result: Float = ((points[:, None] - centres) ** 2).sum(axis=-1)
    return result

r"""Change points of a demonstration: the cuts of least cost, and their segments in K groups.

    min over cuts of  sum over segments sum |x - mean|^2  +  penalty per cut

by dynamic programming (Jackson et al. 2005; exact), on [u, a/2], segments of at least four windows, with the penalty 6
max(s^2, 0.02) ln n and s^2 the median variance within eight windows. Windows are grouped beyond 400. K-means (Lloyd,
weighted by length, started at the farthest means) then groups the segments, one of the two starts of the phase model.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float

SHORTEST = 4
Labels = NDArray[np.intp]


def cuts(x: Float) -> list[int]:
    """Inner cuts of a signal (T, n), increasing."""
    group = -(-len(x) // 400)
    if group > 1:
        whole = len(x) // group
        return [group * c for c in cuts(x[: whole * group].reshape(whole, group, -1).mean(axis=1))]
    if len(x) < 2 * SHORTEST:
        return []
    return _least_cost(x, 6.0 * max(local_variance(x), 0.02) * np.log(len(x)))


def local_variance(x: Float, width: int = 8) -> float:
    """Median variance of rows (T, d) over stretches of `width`."""
    if len(x) < width:
        return float(x.var(axis=0).sum())
    sums, squares = _cumulated(x)
    mean = (sums[width:] - sums[:-width]) / width
    return float(np.median((squares[width:] - squares[:-width]) / width - (mean * mean).sum(axis=-1)))


def _cumulated(x: Float) -> tuple[Float, Float]:
    sums = np.concatenate([np.zeros((1, x.shape[1])), np.cumsum(x, axis=0)])
    return sums, np.concatenate([[0.0], np.cumsum((x * x).sum(axis=1))])


def _least_cost(x: Float, penalty: float) -> list[int]:
    cost = _costs(x)
    best, last = np.full(len(x) + 1, np.inf), np.zeros(len(x) + 1, dtype=np.intp)
    best[0] = -penalty
    for t in range(SHORTEST, len(x) + 1):
        ways = best[: t - SHORTEST + 1] + cost[t, : t - SHORTEST + 1]
        last[t] = ways.argmin()
        best[t] = ways[last[t]] + penalty
    found, t = list[int](), len(x)
    while last[t] > 0:
        t = int(last[t])
        found.append(t)
    return found[::-1]


def _costs(x: Float) -> Float:
    """(T + 1, T + 1) cost of the segment that ends before its row's window and begins with its column's."""
    sums, squares = _cumulated(x - x.mean(axis=0))
    products = sums @ sums.T
    size = np.diag(products)
    edge = np.arange(len(sums))
    length = np.maximum(edge[:, None] - edge, 1)
    result: Float = squares[:, None] - squares - (size[:, None] + size - 2.0 * products) / length
    return result


class Segments(NamedTuple):
    """Windows (S,) and means (S, n) of all segments."""

    sizes: NDArray[np.intp]
    means: Float


def segments(signals: Sequence[Float]) -> Segments:
    """Segments of signals (T, n), one after the other."""
    some = [x for x in signals if len(x)]
    bounds = [np.array([0, *cuts(x), len(x)]) for x in some]
    sizes = np.concatenate([np.diff(b) for b in bounds])
    sums = np.concatenate([np.add.reduceat(x, b[:-1], axis=0) for x, b in zip(some, bounds, strict=True)])
    return Segments(sizes, sums / sizes[:, None])


def grouped(found: Segments, phases: int) -> Labels | None:
    """Labels of every window from K groups of segments, or None with fewer segments than groups."""
    if len(found.sizes) < phases:
        return None
    return np.repeat(_k_means(found.means, found.sizes.astype(float), phases), found.sizes)


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

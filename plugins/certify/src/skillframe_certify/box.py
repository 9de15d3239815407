r"""Largest box in which nearly every predicted trial works, by peeling and pasting (PRIM).

Friedman and Fisher 1999, Statistics and Computing 9: repeatedly remove the 5 % of points at one side that leaves the
largest share of successes, until few enough fail, then move sides out again while that stays true. Peel an even cloud
of predictions: picked trials do not have the declared density.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float


class Box(NamedTuple):
    """A box in scaled quantities: low and high (d,)."""

    low: Float
    high: Float

    def holds(self, points: Float) -> NDArray[np.bool_]:
        """Return (m,) whether (m, d) points lie inside or on the border."""
        inside: NDArray[np.bool_] = np.all((points >= self.low) & (points <= self.high), axis=1)
        return inside

    def shrunk(self, share: float) -> Box:
        """Return the box about the same centre with a share of the volume."""
        middle, half = (self.low + self.high) / 2.0, (self.high - self.low) / 2.0
        half = half * share ** (1.0 / len(half))
        return Box(middle - half, middle + half)

    def at(self, point: Float) -> Float:
        """Map a point (d,) of the whole range into this box."""
        result: Float = self.low + (point + 1.0) * (self.high - self.low) / 2.0
        return result

    @property
    def share(self) -> float:
        """Volume over that of the whole range."""
        return float(np.prod((self.high - self.low) / 2.0))


def peel(cloud: Float, works: NDArray[np.bool_], most_failures: float) -> Box | None:
    """Return the proposed box, or None if no box with enough points works.

    Args:
        cloud: (m, d) even points, scaled to -1 to 1.
        works: (m,) predicted successes.
        most_failures: largest share of predicted failures in the box.
    """
    box = Box(np.full(cloud.shape[1], -1.0), np.full(cloud.shape[1], 1.0))
    inside = np.ones(len(cloud), dtype=bool)
    while np.mean(~works[inside]) > most_failures:
        box = _peeled(box, cloud[inside], works[inside])
        inside = box.holds(cloud)
        if inside.sum() < 64:  # fewer do not support a proposal
            return None
    return _pasted(box, cloud, works, most_failures)


def _peeled(box: Box, points: Float, works: NDArray[np.bool_]) -> Box:
    """Cut off the edge, of 2 d, whose removal leaves the largest share of successes."""
    tried: list[tuple[float, Box]] = []
    for i in range(points.shape[1]):
        low, high = np.quantile(points[:, i], [0.05, 1.0 - 0.05])
        for kept, cut in (
            (points[:, i] > low, Box(_with(box.low, i, low), box.high)),
            (points[:, i] < high, Box(box.low, _with(box.high, i, high))),
        ):
            tried.append((float(works[kept].mean()) if kept.any() else 0.0, cut))
    return max(tried, key=lambda pair: pair[0])[1]


def _pasted(box: Box, cloud: Float, works: NDArray[np.bool_], most_failures: float) -> Box:
    moved, step = True, 0.02  # a hundredth of the whole range
    while moved:
        moved = False
        for i in range(cloud.shape[1]):
            for wider in (
                Box(_with(box.low, i, max(-1.0, box.low[i] - step)), box.high),
                Box(box.low, _with(box.high, i, min(1.0, box.high[i] + step))),
            ):
                if wider.share > box.share and np.mean(~works[wider.holds(cloud)]) <= most_failures:
                    box, moved = wider, True
    return box


def _with(values: Float, index: int, value: float) -> Float:
    result = values.copy()
    result[index] = value
    return result

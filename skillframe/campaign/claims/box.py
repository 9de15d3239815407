r"""A box in which nearly every predicted trial works: peel a cloud of labelled points, then let it grow again.

PRIM (Friedman and Fisher 1999, "Bump hunting in high-dimensional data", Statistics and Computing 9): begin with the
whole range; cut off the five per cent of the points inside, on one side of one quantity, whose absence leaves the
largest share that works; stop once few enough fail; then push out each side as long as that stays so. Peel the
surrogate's cloud, not the trials themselves: where trials were picked, their density is not the declared one.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float

PEEL = 0.05
LEAST = 64
"""Points of the cloud that a box has to hold; a smaller one says nothing."""
STEP = 0.02
"""By which a side is pushed out again, of the whole range of 2."""


class Box(NamedTuple):
    """A box in scaled quantities: low and high (d,)."""

    low: Float
    high: Float

    def holds(self, points: Float) -> NDArray[np.bool_]:
        """(m,) whether (m, d) points lie inside, the borders included."""
        inside: NDArray[np.bool_] = np.all((points >= self.low) & (points <= self.high), axis=1)
        return inside

    def shrunk(self, share: float) -> Box:
        """The box about the same centre with a share of the volume."""
        middle, half = (self.low + self.high) / 2.0, (self.high - self.low) / 2.0
        half = half * share ** (1.0 / len(half))
        return Box(middle - half, middle + half)

    @property
    def share(self) -> float:
        """Its volume over that of the whole range."""
        return float(np.prod((self.high - self.low) / 2.0))


def peel(cloud: Float, works: NDArray[np.bool_], most_failures: float) -> Box | None:
    """The proposed box, or None where no box of enough points works.

    Args:
        cloud: (m, d) points that fill the range evenly, scaled to -1 to 1.
        works: (m,) what is predicted of them.
        most_failures: largest share of predicted failures in the box.
    """
    box = Box(np.full(cloud.shape[1], -1.0), np.full(cloud.shape[1], 1.0))
    inside = np.ones(len(cloud), dtype=bool)
    while np.mean(~works[inside]) > most_failures:
        box = _peeled(box, cloud[inside], works[inside])
        inside = box.holds(cloud)
        if inside.sum() < LEAST:
            return None
    return _pasted(box, cloud, works, most_failures)


def _peeled(box: Box, points: Float, works: NDArray[np.bool_]) -> Box:
    """The box without the one of its 2 d edges whose absence leaves the largest share that works."""
    tried: list[tuple[float, Box]] = []
    for i in range(points.shape[1]):
        low, high = np.quantile(points[:, i], [PEEL, 1.0 - PEEL])
        for kept, cut in (
            (points[:, i] > low, Box(_with(box.low, i, low), box.high)),
            (points[:, i] < high, Box(box.low, _with(box.high, i, high))),
        ):
            tried.append((float(works[kept].mean()) if kept.any() else 0.0, cut))
    return max(tried, key=lambda pair: pair[0])[1]


def _pasted(box: Box, cloud: Float, works: NDArray[np.bool_], most_failures: float) -> Box:
    """The box with its sides pushed out in turn as long as few enough fail inside."""
    moved = True
    while moved:
        moved = False
        for i in range(cloud.shape[1]):
            for wider in (
                Box(_with(box.low, i, max(-1.0, box.low[i] - STEP)), box.high),
                Box(box.low, _with(box.high, i, min(1.0, box.high[i] + STEP))),
            ):
                if wider.share > box.share and np.mean(~works[wider.holds(cloud)]) <= most_failures:
                    box, moved = wider, True
    return box


def _with(values: Float, index: int, value: float) -> Float:
    result = values.copy()
    result[index] = value
    return result

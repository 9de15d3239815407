"""Jumps of the tool point: two recordings in one, or a pose that was lost and found again.

A tool has mass, so that the way of one sample is nearly the mean of the ways before and after it. What a way has
beyond that mean, r, is -J/2, J, -J/2 around a jump by J, where a tool that stops or starts leaves J/2, -J/2. It is a
jump if r has that shape to a third, J is at least 2 mm and ten times what nineteen in twenty of the others are. So is
a way of 20 mm and more at 10 m/s and more. Only samples with a new pose count, since a recorder may hold it; a gap of
the clock is none, and a pose that stood still before it is a stall's. The attitude is judged at reading. All of this
is our choice.
"""

from __future__ import annotations

import numpy as np

from skillframe.demonstration.checks import GAP
from skillframe.demonstration.faults.fault import JUMP, Flaw
from skillframe.demonstration.stalls import POSE, starts
from skillframe.frames import Float, norm

LEAST, RATIO, QUANTILE, SHAPE = 0.002, 10.0, 0.95, 1.0 / 3.0
FASTEST, FAR, FEWEST = 10.0, 0.02, 8


def jumps(time: Float, pose: Float) -> list[Flaw]:
    """Jumps of the tool point.

    Args:
        time: (T,) [s].
        pose: (T, 7) position [m] and quaternion.
    """
    fresh = starts(pose)
    if len(fresh) < FEWEST:
        return []
    t, way = time[fresh], np.diff(pose[fresh, :3], axis=0)
    dt = np.diff(t)
    short = dt < GAP * float(np.median(dt))
    even = short[1:-1] & short[2:] & short[:-2]
    beyond = way[1:-1] - 0.5 * (way[2:] + way[:-2])
    size = norm(beyond)
    large = np.flatnonzero((size > max(LEAST, RATIO * float(np.quantile(size, QUANTILE)))) & even)
    found = {int(k) + 1: float(size[k]) for k in large if _has_the_shape(beyond, int(k), float(size[k]))}
    length = norm(way)
    found |= {int(k): float(length[k]) for k in np.flatnonzero((length > FASTEST * dt) & (length > FAR) & short)}
    return [Flaw(JUMP, POSE, float(time[fresh[k + 1] - 1]), float(t[k + 1]), found[k]) for k in sorted(found)]


def _has_the_shape(beyond: Float, k: int, size: float) -> bool:
    """Whether the neighbours have minus half of it."""
    near = [beyond[i] for i in (k - 1, k + 1) if 0 <= i < len(beyond)]
    return all(norm(side + 0.5 * beyond[k]) < SHAPE * size for side in near)

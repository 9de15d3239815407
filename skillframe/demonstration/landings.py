"""Which spikes of a force are a tool that lands: short, but nothing that damage to a recording looks like.

A rigid tool that meets something hard is stopped within milliseconds, and the force that does it stands out of its
neighbours as a broken sample does. Two things tell them apart (thresholds are our choice). The force rises and falls
through samples of its own, while a broken sample stands alone. And the tool is stopped by it: with n the force's
direction, and v- and v+ the tool's velocity right before and after,

    -n v- > 5 mm/s,     n (v+ - v-) >= -n v- / 4,     both beyond three standard deviations of the velocities.

A quarter, because a part that lands on its edge goes on turning about it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skillframe.demonstration.record import Demonstration
from skillframe.frames import Float, norm

Indices = NDArray[np.intp]
AROUND = 9
"""Samples before a spike that give the force's level there."""
CORE, FLANK, NOISE = 0.6, 0.1, 3.0
"""Of the peak: what belongs to it, and the least of a flank, which also exceeds so many standard deviations."""
SEEN_S, FEWEST = 0.03, 5
"""Time and samples over which a velocity is taken."""
SLOWEST, STOPPED, SURE = 0.005, 0.25, 3.0
"""Approach [m/s], share of it that is lost at least, and standard deviations of the velocities."""


def landings(d: Demonstration, spikes: Indices, sigma: float) -> Indices:
    """Those of some spikes at which the tool landed.

    Args:
        d: the recording.
        spikes: (K,) samples that stand out, in order.
        sigma: standard deviation of the force [N].
    """
    groups = np.split(spikes, np.flatnonzero(np.diff(spikes) > 2) + 1) if spikes.size else []
    landed = [group for group in groups if _landed(d, int(group[0]), int(group[-1]), sigma)]
    return np.concatenate(landed) if landed else np.empty(0, dtype=np.intp)


def _landed(d: Demonstration, first: int, last: int, sigma: float) -> bool:
    """Whether the tool landed between two samples."""
    before = d.wrench[max(first - 2 - AROUND, 0) : max(first - 2, 1), :3]
    low, high = max(first - 3, 0), min(last + 4, len(d.time))
    pulse = d.wrench[low:high, :3] - np.median(before, axis=0)
    return _has_flank(norm(pulse), sigma) and _stops(d, first, last, pulse.sum(axis=0))


def _has_flank(size: Float, sigma: float) -> bool:
    """Whether the largest of (T,) is reached or left through a sample between noise and peak."""
    core = np.flatnonzero(size >= CORE * size.max())
    least = max(FLANK * float(size.max()), NOISE * sigma)
    sides = (int(core[0]) - 1, int(core[-1]) + 1)
    return any(0 <= i < len(size) and least <= size[i] for i in sides)


def _stops(d: Demonstration, first: int, last: int, force: Float) -> bool:
    """Whether the tool moves against a force (3,) before two samples, and not any more after them."""
    length, along = norm(force), d.position @ force
    if not length > 0.0:
        return False
    count = max(FEWEST, round(SEEN_S * d.rate))
    earlier, later = slice(max(first - 1 - count, 0), max(first - 1, 0)), slice(last + 2, last + 2 + count)
    before, after = (_speed(d.time[part], along[part] / length) for part in (earlier, later))
    approach, lost = -before[0], after[0] - before[0]
    least = max(SLOWEST, SURE * before[1])
    return approach > least and lost >= STOPPED * approach and lost > SURE * float(np.hypot(before[1], after[1]))


def _speed(time: Float, place: Float) -> tuple[float, float]:
    """Slope of a line through (T,) places [m/s] and its standard deviation. Of too few, nothing is sure."""
    if len(time) < FEWEST:
        return 0.0, np.inf
    t = time - time.mean()
    slope = float(t @ place / (t @ t))
    rest = place - place.mean() - slope * t
    return slope, float(np.sqrt(rest @ rest / (len(t) - 2) / (t @ t)))

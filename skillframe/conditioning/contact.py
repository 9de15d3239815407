r"""Where a recording touches and where it does not, with thresholds from its own noise.

The force is in contact where it leaves its free-air level by more than \(\max(6 \sigma, 1\,N, 0.1 F_{99})\), \(\sigma\)
being the typical scatter of the force vector and \(F_{99}\) its 99th percentile (inertia and what is left of the weight
count in proportion to how hard the task presses), until it falls below half of that; intervals closer than 50 ms are
one, shorter ones are spikes. The free-air level is the mean of the first 0.25 s, that is, a recording is taken to
start in free air unless another stretch is named. All of this is our choice.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from skillframe.conditioning.noise import NoiseFigures
from skillframe.frames import Float, norm

SIGMAS, LEAST_FORCE, SHARE = 6.0, 1.0, 0.1
HOLD, LEVEL_TIME, MARGIN = 0.05, 0.25, 0.1


class Contact(NamedTuple):
    """One interval in contact.

    Attributes:
        start: first sample in contact [s].
        stop: last sample in contact [s].
        peak: largest force above the free-air level [N].
    """

    start: float
    stop: float
    peak: float


def contact_threshold(noise: NoiseFigures, strength: Float) -> float:
    """Force above the free-air level that counts as contact [N], from the noise and all strengths (T,) [N]."""
    scatter = float(np.sqrt((noise.typical[:3] ** 2).sum()))
    return max(SIGMAS * scatter, LEAST_FORCE, SHARE * float(np.quantile(strength, 0.99)))


def free_air_level(time: Float, wrench: Float, stretch: tuple[float, float] | None = None) -> Float:
    """Mean wrench (6,) of the stretch [s], or of the first 0.25 s."""
    start, stop = stretch or (float(time[0]), float(time[0]) + LEVEL_TIME)
    inside = (time >= start) & (time <= stop)
    result: Float = wrench[inside].mean(axis=0)
    return result


def contact_intervals(time: Float, wrench: Float, noise: NoiseFigures, level: Float) -> list[Contact]:
    """Intervals in contact, in order.

    Args:
        time: (T,) [s].
        wrench: (T, 6) [N, Nm].
        noise: of the same recording.
        level: (6,) free-air level.
    """
    strength = norm(wrench[:, :3] - level[:3])
    threshold = contact_threshold(noise, strength)
    pieces = _runs(strength > 0.5 * threshold)
    merged: list[tuple[int, int]] = []
    for first, last in pieces:
        if merged and time[first] - time[merged[-1][1]] < HOLD:
            merged[-1] = (merged[-1][0], last)
        else:
            merged.append((first, last))
    result = []
    for first, last in merged:
        above = np.flatnonzero(strength[first : last + 1] > threshold)
        if above.size and time[last] - time[first] >= HOLD:
            begin = first + int(above[0])
            result.append(Contact(float(time[begin]), float(time[last]), float(strength[begin : last + 1].max())))
    return result


def _runs(mask: np.ndarray[tuple[int], np.dtype[np.bool_]]) -> list[tuple[int, int]]:
    """First and last index of every run of True."""
    edges = np.flatnonzero(np.diff(np.r_[False, mask, False].astype(np.int8)))
    return [(int(a), int(b) - 1) for a, b in edges.reshape(-1, 2)]


def first_free_air(time: Float, wrench: Float, noise: NoiseFigures) -> tuple[float, float]:
    """The stretch from the start to 0.1 s before the first contact [s], to the end if there is none."""
    contacts = contact_intervals(time, wrench, noise, free_air_level(time, wrench))
    return float(time[0]), float(time[-1]) if not contacts else contacts[0].start - MARGIN

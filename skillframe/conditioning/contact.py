r"""Where a recording touches and where it does not, with thresholds from its own noise.

The force is in contact where it leaves its free-air level by more than \(\max(6 \sigma, 1\,N, 0.1 F_{99})\), \(\sigma\)
being the typical scatter of the force vector and \(F_{99}\) its 99th percentile (inertia and what is left of the weight
count in proportion to how hard the task presses), until it falls below half of that; intervals closer than 50 ms are
one, shorter ones are spikes. Where the noise alone sets the bound, the force is averaged first, over as many samples as
bring it down to the others, 50 ms at most: else a noisy sensor's contact would count as free air. What scatter the
averaged force has left below that bound is measured, since vibration averages less than white noise does. The free-air
level is the mean of the first 0.25 s, that is, a recording is taken to start in free air unless another stretch is
named. A stall (`demonstration.stalls`) is neither: it ends a contact, and what follows it shows no onset. All of
this is our choice.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.conditioning.noise import NoiseFigures, scatter_left
from skillframe.errors import InputError
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
    return max(SIGMAS * _scatter(noise), _least(strength))


def _scatter(noise: NoiseFigures) -> float:
    return float(np.sqrt((noise.typical[:3] ** 2).sum()))


def _least(strength: Float) -> float:
    return max(LEAST_FORCE, SHARE * float(np.quantile(strength, 0.99)))


def contact_strength(
    time: Float, wrench: Float, noise: NoiseFigures, level: Float, alive: NDArray[np.bool_] | None = None
) -> tuple[Float, float]:
    """Force above the free-air level (T,), averaged where noise asks for it, and the bound of contact [N].

    Args:
        time: (T,) [s].
        wrench: (T, 6) [N, Nm].
        noise: of the same recording.
        level: (6,) free-air level.
        alive: (T,) where the sensor did not stall, elsewhere there is no force; all if not given.
    """
    force = wrench[:, :3] - level[:3]
    if alive is not None:
        force = np.where(alive[:, None], force, 0.0)
    strength = norm(force)
    most = max(1, round(HOLD / float(np.median(np.diff(time)))))
    width = int(np.clip(np.ceil((SIGMAS * _scatter(noise) / _least(strength)) ** 2), 1, min(most, len(time))))
    if width == 1:
        return strength, contact_threshold(noise, strength)
    total = np.concatenate([np.zeros((1, 3)), np.cumsum(force, axis=0)])
    first = np.clip(np.arange(len(time)) - width // 2, 0, len(time) - width)
    force = (total[first + width] - total[first]) / width
    strength = norm(force)
    bound = max(SIGMAS * _scatter(noise) / float(np.sqrt(width)), _least(strength))
    free = strength < bound if alive is None else alive & (strength < bound)
    return strength, max(bound, SIGMAS * scatter_left(time, force, free))


def free_air_level(time: Float, wrench: Float, stretch: tuple[float, float] | None = None) -> Float:
    """Mean wrench (6,) of the stretch [s], or of the first 0.25 s."""
    start, stop = stretch or (float(time[0]), float(time[0]) + LEVEL_TIME)
    inside = (time >= start) & (time <= stop)
    result: Float = wrench[inside].mean(axis=0)
    return result


def contact_intervals(
    time: Float, wrench: Float, noise: NoiseFigures, level: Float, alive: NDArray[np.bool_] | None = None
) -> list[Contact]:
    """Intervals in contact, in order.

    Args:
        time: (T,) [s].
        wrench: (T, 6) [N, Nm].
        noise: of the same recording.
        level: (6,) free-air level.
        alive: (T,) where the sensor did not stall; all if not given.
    """
    strength, threshold = contact_strength(time, wrench, noise, level, alive)
    touching = strength > 0.5 * threshold
    pieces = _runs(touching if alive is None else touching & alive)
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


def first_free_air(
    time: Float, wrench: Float, noise: NoiseFigures, alive: NDArray[np.bool_] | None = None, where: str = "recording"
) -> tuple[float, float]:
    """The stretch from the start to 0.1 s before the first contact [s], or to the first stall, or else to the end.

    Raises:
        InputError: the recording begins with a stall, so that what follows may be contact.
    """
    stalled = np.zeros(0, dtype=int) if alive is None else np.flatnonzero(~alive)
    if stalled.size and time[stalled[0]] - time[0] < LEVEL_TIME:
        raise InputError(
            where,
            f"the wrench repeats one value (or shows another fault) from {time[stalled[0]]:.2f} s on, and what follows "
            "may be contact already: no free air is known",
            "name a stretch without contact (--free-air FROM,TO), or leave the bias (--no-bias)",
        )  # fmt: skip
    contacts = contact_intervals(time, wrench, noise, free_air_level(time, wrench), alive)
    ends = [float(time[-1])]
    ends += [contacts[0].start - MARGIN] if contacts else []
    ends += [float(time[stalled[0] - 1])] if stalled.size else []
    return float(time[0]), min(ends)

r"""Contact intervals of a recording, with thresholds from its own noise.

The force is in contact once it leaves its free-air level by more than \(\max(6 \sigma, 1\,N, 0.1 F_{99})\), until it
falls below half of that. \(\sigma\) is the typical scatter of the force vector, and \(F_{99}\) the 99th percentile of
its size, in proportion to which inertia and residual weight grow. Intervals closer than 50 ms are joined; shorter ones
are spikes. Where noise sets the threshold, the force is averaged first, over at most 50 ms.

The free-air level is the mean of the first 0.25 s, unless another stretch is given. A vibration is no contact: in every
interval the force, averaged twice over 0.25 s (or the interval, if shorter), must exceed a half sine as long as the
interval and as high as the threshold, averaged alike. A stall (`demonstration.stalls`) ends a contact.

Noise of a recorded wrench, from its quiet stretches.

The scatter about a straight line within windows of 0.25 s, as the median over the quietest quarter of the windows, so
that contact and motion do not count.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.demonstration.faults.fault import Flaw
from skillframe.demonstration.faults.find import alive as alive_samples
from skillframe.demonstration.faults.find import faults, pressing
from skillframe.demonstration.record import Demonstration
from skillframe.demonstration.stalls import Stall, stalls
from skillframe.errors import InputError
from skillframe.frames import Float, norm

SIGMAS = 6.0
HOLD, LEVEL_TIME = 0.05, 0.25  #: least duration of a contact, and of free air before it [s]


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


class ContactEvidence(NamedTuple):
    """The contacts of a demonstration and their basis.

    Attributes:
        contacts: in order.
        stalls: stretches that repeat one value.
        faults: stretches that are no valid measurement.
        alive: (T,) samples with a valid wrench.
        pressing: (T,) samples that may be in contact: those alive, and those that saturate.
        noise: of the wrench; zeros where no stretch is long enough.
        level: (6,) mean wrench of the first 0.25 s, taken as free air [N, Nm].
    """

    contacts: list[Contact]
    stalls: list[Stall]
    faults: list[Flaw]
    alive: NDArray[np.bool_]
    pressing: NDArray[np.bool_]
    noise: NoiseFigures
    level: Float


def contact_evidence(demonstration: Demonstration) -> ContactEvidence:
    """Find the contacts of a demonstration."""
    d = demonstration
    held = stalls(d)
    flaws = faults(d, held)
    live = alive_samples(d, held, flaws)
    may = pressing(d, live, flaws)
    noise = NoiseFigures(np.zeros(6), np.zeros(6))
    if len(d) >= LEAST_SAMPLES and has_window(d.time, live):
        noise = noise_figures(d.time, d.wrench, live)
    level = free_air_level(d.time[live], d.wrench[live]) if np.any(live) else np.zeros(6)
    contacts = contact_intervals(d.time, d.wrench, noise, level, may)
    return ContactEvidence(contacts, held, flaws, live, may, noise, level)


def contact_threshold(noise: NoiseFigures, strength: Float) -> float:
    """Force above the free-air level that counts as contact [N], from the noise and all strengths (T,) [N]."""
    return max(SIGMAS * _scatter(noise), _least(strength))


def _scatter(noise: NoiseFigures) -> float:
    return float(np.sqrt((noise.typical[:3] ** 2).sum()))


def _least(strength: Float) -> float:
    return max(1.0, 0.1 * float(np.quantile(strength, 0.99)))


def contact_strength(
    time: Float, wrench: Float, noise: NoiseFigures, level: Float, alive: NDArray[np.bool_] | None = None
) -> tuple[Float, float]:
    """Force above the free-air level (T,), averaged where noise requires it, and the threshold of contact [N].

    Args:
        time: (T,) [s].
        wrench: (T, 6) [N, Nm].
        noise: of the same recording.
        level: (6,) free-air level.
        alive: (T,) where the sensor did not stall (force is zero elsewhere); all by default.
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
    """Intervals in contact, in order. Arguments as `contact_strength`."""
    strength, threshold = contact_strength(time, wrench, noise, level, alive)
    touching = strength > 0.5 * threshold
    touching = touching if alive is None else touching & alive
    edges = np.flatnonzero(np.diff(np.r_[False, touching, False].astype(np.int8))).reshape(-1, 2)
    merged: list[tuple[int, int]] = []
    for first, last in ((int(a), int(b) - 1) for a, b in edges):
        if merged and time[first] - time[merged[-1][1]] < HOLD:
            merged[-1] = (merged[-1][0], last)
        else:
            merged.append((first, last))
    result = []
    for first, last in merged:
        above = np.flatnonzero(strength[first : last + 1] > threshold)
        lasts = time[last] - time[first] >= HOLD and _lasts(time, wrench[first : last + 1, :3] - level[:3], threshold)
        if above.size and lasts:
            begin = first + int(above[0])
            result.append(Contact(float(time[begin]), float(time[last]), float(strength[begin : last + 1].max())))
    return result


def _lasts(time: Float, force: Float, bound: float) -> bool:
    """Whether the force of an interval (T, 3) is more than a vibration."""
    count = len(force)
    width = min(count, max(1, round(0.25 / float(np.median(np.diff(time))))))
    for _ in range(2 if width < count else 1):
        total = np.concatenate([np.zeros((1, 3)), np.cumsum(force, axis=0)])
        force = (total[width:] - total[:-width]) / width if len(force) >= width else force
        bound *= float(np.sinc(0.5 * width / count))
    return float(norm(force).max()) > bound


WINDOW, LEAST_SAMPLES = 0.25, 10  #: of a noise figure: stretch [s] and samples
FLOOR = np.repeat([1e-4, 1e-6], 3)
"""Least noise assumed [N, Nm]; simulated or filtered channels need a positive figure too."""


class NoiseFigures(NamedTuple):
    """Scatter of a wrench.

    Attributes:
        quiet: (6,) standard deviation in the quietest quarter of the windows [N, Nm].
        typical: (6,) median over all windows: with motion and vibration [N, Nm].
    """

    quiet: Float
    typical: Float


def noise_figures(time: Float, wrench: Float, alive: NDArray[np.bool_] | None = None) -> NoiseFigures:
    """Noise of a recorded wrench.

    Args:
        time: (T,) [s].
        wrench: (T, 6) [N, Nm].
        alive: (T,) where the sensor did not stall; windows with a stall are excluded. All by default.

    Raises:
        InputError: fewer than ten samples, or no window without a stall.
    """
    _, _, scatter, quietest = _quiet(time, wrench, alive)
    return NoiseFigures(np.median(scatter[quietest], axis=0), np.median(scatter, axis=0))


def window_rows(
    time: Float, wrench: Float, alive: NDArray[np.bool_] | None = None
) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
    """Rows (K, W) of the windows of `noise_figures`, and a mask (K,) of the quietest quarter."""
    width, live, _, quietest = _quiet(time, wrench, alive)
    quiet = np.zeros(len(live), dtype=bool)
    quiet[quietest] = True
    return live[:, None] * width + np.arange(width), quiet


def _quiet(
    time: Float, wrench: Float, alive: NDArray[np.bool_] | None
) -> tuple[int, NDArray[np.intp], Float, NDArray[np.intp]]:
    """Samples in a window, the windows that count, their scatter (K, 6), and the quietest quarter."""
    if len(time) < LEAST_SAMPLES:
        raise InputError(
            "wrench", f"{len(time)} samples are too few for noise figures", f"give at least {LEAST_SAMPLES}"
        )
    width, live = _windows(time, alive)
    if not len(live):
        raise InputError(
            "wrench", f"repeats one value in every {WINDOW:g} s, so that nothing shows its noise",
            "check the sensor's connection, and record again",
        )  # fmt: skip
    scatter = detrended_std(_cut(np.asarray(wrench, dtype=float), width)[live])
    rank = (scatter / np.maximum(np.median(scatter, axis=0), FLOOR)).sum(axis=1)
    return width, live, scatter, np.argsort(rank, kind="stable")[: max(1, len(live) // 4)]


def _windows(time: Float, alive: NDArray[np.bool_] | None) -> tuple[int, NDArray[np.intp]]:
    """Samples in a window, and the windows without a stall."""
    width = int(np.clip(round(WINDOW / float(np.median(np.diff(time)))), LEAST_SAMPLES, len(time)))
    live = np.ones(len(time), dtype=bool) if alive is None else alive
    return width, np.flatnonzero(_cut(live, width).all(axis=1))


def _cut(samples: NDArray[Any], width: int) -> NDArray[Any]:
    """Samples (T, ...) as windows (K, width, ...), without an incomplete last one."""
    count = len(samples) // width
    return samples[: count * width].reshape(count, width, *samples.shape[1:])


def has_window(time: Float, alive: NDArray[np.bool_]) -> bool:
    """Whether a stretch without stall is long enough for noise figures."""
    return bool(len(_windows(time, alive)[1]))


def scatter_left(time: Float, force: Float, alive: NDArray[np.bool_] | None = None) -> float:
    """Typical scatter of an averaged force (T, 3): the median length over the windows [N]."""
    width, live = _windows(time, alive)
    return float(np.median(np.linalg.norm(detrended_std(_cut(force, width)[live]), axis=1))) if len(live) else 0.0


def detrended_std(windows: Float) -> Float:
    """Standard deviation (K, C) about the best straight line within windows (K, W, C), unbiased for white noise."""
    width = windows.shape[1]
    ramp = np.linspace(-1.0, 1.0, width)[:, None]
    centred = windows - windows.mean(axis=1, keepdims=True)
    slope = (centred * ramp).sum(axis=1, keepdims=True) / (ramp**2).sum()
    result: Float = np.sqrt(((centred - slope * ramp) ** 2).sum(axis=1) / (width - 2))
    return result

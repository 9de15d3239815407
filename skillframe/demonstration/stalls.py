r"""Stalls: stretches in which a sensor or a pose repeats one value bit for bit although the world went on.

A working sensor has noise, so its channels do not repeat for long. Excluded are

- a recorder faster than its sensor: a stall is ten times longer than the 90 % quantile of the file's runs, and at least
  0.25 s, the window of free air and noise;
- a simulation without noise, where the rest of the file has no white noise (1 mN, 0.01 mNm);
- exactly zero in every channel, as from a simulation or a dead zone in free air;
- a coarse sensor (resolution q, the least difference of two values): a held value within 2 q of the levels before and
  after it, or of one of them where q exceeds 0.3 of the noise of the rest;
- a recording declared to be without contact (`contact = false`).

A single channel stalls after 1 s while others change, unless the other two of the force, or of the torque, take at most
nine pairs of values: then the force rests on a coarse sensor. A pose may stand still; its stall ends in a jump, five
times the 95 % quantile of the steps, and at least 0.5 mm or 0.2 degrees. A stall that the metadata name (`stalls`) is
kept, because a smoothed wrench no longer shows it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.demonstration.columns import WRENCH
from skillframe.demonstration.content_cache import Once
from skillframe.demonstration.record import Demonstration
from skillframe.errors import InputError
from skillframe.frames import Float, matrix_from_quaternion, norm, rotation_vector

KEY = "stalls"
"""Metadata key of stalls found when the recording was first read: [{what, start, stop}] [s]."""
POSE = "pose"  #: name of a stall of the whole pose
LEAST_TIME = 0.25
LEAST_NOISE = np.repeat([1e-3, 1e-5], 3)  # [N, Nm]
LEVEL_TIME = 0.25


class Stall(NamedTuple):
    """One stretch that repeats a value.

    Attributes:
        what: "wrench", one of its channels (fx ... tz), or "pose".
        start, stop: first and last sample that repeat it [s].
    """

    what: str
    start: float
    stop: float

    def words(self) -> str:
        """The stall as a clause."""
        return f"the {self.what} repeats one value bit for bit from {self.start:.2f} to {self.stop:.2f} s"


def stalls(demonstration: Demonstration) -> list[Stall]:
    """All stalls of a demonstration, by start: those of its metadata and those of its samples."""
    d = demonstration
    return every_stall(d.time, np.concatenate([d.position, d.quaternion], axis=1), d.wrench, d.meta, d.source)


def every_stall(time: Float, pose: Float, wrench: Float, meta: Mapping[str, Any], source: str = "") -> list[Stall]:
    """Stalls from metadata and samples. Arguments as `find`."""
    known = kept_stalls(meta, source)
    shown = find(time, pose, wrench, meta)
    known += [s for s in shown if not any(k.what == s.what and k.start <= s.stop and s.start <= k.stop for k in known)]
    return sorted((s for s in known if s.stop > time[0] and s.start < time[-1]), key=lambda s: (s.start, s.what))


def kept_stalls(meta: Mapping[str, Any], source: str = "") -> list[Stall]:
    """The stalls that metadata name.

    Raises:
        InputError: they are not a list of {what, start, stop}.
    """
    try:
        result = [Stall(str(s["what"]), float(s["start"]), float(s["stop"])) for s in meta.get(KEY, [])]
    except (TypeError, KeyError, ValueError):
        raise InputError(
            f"{source or 'metadata'}: {KEY}", f"is no list of stalls: {meta[KEY]!r}",
            "give [{what, start, stop}] with what = wrench, a channel or pose, and times in seconds",
        ) from None  # fmt: skip
    for stall in result:
        if stall.what not in ("wrench", POSE, *WRENCH) or not stall.start <= stall.stop:
            raise InputError(f"{source or 'metadata'}: {KEY}", f"holds {stall}", "give what, start <= stop")
    return result


def moved(meta: Mapping[str, Any], seconds: float, source: str = "") -> dict[str, Any]:
    """Metadata whose stalls are shifted with the clock."""
    found = [Stall(s.what, s.start + seconds, s.stop + seconds) for s in kept_stalls(meta, source)]
    return {**meta, KEY: as_meta(found)} if found else dict(meta)


def as_meta(found: Sequence[Stall]) -> list[dict[str, Any]]:
    """Plain values for metadata and `--json`."""
    return [stall._asdict() for stall in found]


def find(time: Float, pose: Float, wrench: Float, meta: Mapping[str, Any]) -> list[Stall]:
    """Stalls of samples (T,) [s], (T, 7), (T, 6). The wrench must be as measured: rotation hides constant values."""
    return _FOUND(time, pose, wrench, without_contact=meta.get("contact") is False)


def _find(time: Float, pose: Float, wrench: Float, *, without_contact: bool) -> list[Stall]:
    result = [Stall(POSE, *_span(time, run)) for run in _long(time, pose, LEAST_TIME) if _jumps(pose, run)]
    if without_contact:
        return result
    whole = _held(time, wrench, LEAST_TIME, LEAST_NOISE)
    result += [Stall("wrench", *_span(time, run)) for run in whole]
    free = np.ones(len(time), dtype=bool)
    for first, last in whole:
        free[first : last + 1] = False
    for i, name in enumerate(WRENCH):
        runs = _held(time, wrench[:, i : i + 1], 1.0, LEAST_NOISE[i : i + 1])
        others = wrench[:, [k for k in range(i - i % 3, i - i % 3 + 3) if k != i]]
        runs = [
            (a, b)
            for a, b in runs
            if free[a : b + 1].all() and not (1 < len(np.unique(others[a : b + 1], axis=0)) <= 9)
        ]
        result += [Stall(name, *_span(time, run)) for run in runs]
    return sorted(result, key=lambda s: (s.start, s.what))


_FOUND = Once(_find)


def _span(time: Float, run: tuple[int, int]) -> tuple[float, float]:
    return float(time[run[0]]), float(time[run[1]])


def starts(values: Float) -> NDArray[np.intp]:
    """Samples at which a new value of (T, n) begins, including the first."""
    changes = np.any(values[1:] != values[:-1], axis=1)
    return np.concatenate([[0], np.flatnonzero(changes) + 1])


def _long(time: Float, values: Float, least: float) -> list[tuple[int, int]]:
    """First and last sample of every run that is long for the file."""
    first = starts(values)
    if len(first) < 20:
        return []
    ends = np.append(first[1:], len(time)) - 1
    period = float(np.median(np.diff(time)))
    held = time[ends] - time[first]
    limit = max(least, 10.0 * (float(np.quantile(held, 0.9)) + period))
    return [(int(first[k]), int(ends[k])) for k in np.flatnonzero(held >= limit)]


def _held(time: Float, values: Float, least: float, least_noise: Float) -> list[tuple[int, int]]:
    """Long runs of values (T, n) that neither a simulation nor the resolution explains."""
    runs = [run for run in _long(time, values, least) if np.any(values[run[0]])]
    if not runs:
        return []
    noise, step = _noise_and_resolution(values)
    if not np.any(noise > least_noise):
        return []
    return [run for run in runs if not _resolved(time, values, run, step, noise)]


def explained(time: Float, values: Float, run: tuple[int, int]) -> bool:
    """Whether the resolution of a sensor (T, n) explains a run from a first to a last sample."""
    noise, step = _noise_and_resolution(values)
    return _resolved(time, values, run, step, noise)


def _noise_and_resolution(values: Float) -> tuple[Float, Float]:
    fresh = values[starts(values)]
    return np.array([white_noise(column) for column in fresh.T]), np.array([resolution(column) for column in fresh.T])


def white_noise(values: Float) -> float:
    """Standard deviation of white noise on a smooth signal (T,), by its second differences."""
    second = values[2:] - 2.0 * values[1:-1] + values[:-2]
    return float(np.median(np.abs(second))) / (0.6745 * float(np.sqrt(6.0))) if len(second) else 0.0


def resolution(values: Float) -> float:
    """The least difference of two values, infinite for a single value."""
    apart = np.diff(np.unique(values))
    return float(apart.min()) if apart.size else np.inf


def _resolved(time: Float, values: Float, run: tuple[int, int], step: Float, noise: Float) -> bool:
    first, last = run
    before = values[(time >= time[first] - LEVEL_TIME) & (time < time[first])]
    after = values[(time > time[last]) & (time <= time[last] + LEVEL_TIME)]
    near = [np.abs(np.median(side, axis=0) - values[first]) <= 2.0 * step for side in (before, after) if len(side)]
    coarse = step >= 0.3 * noise
    every, some = np.all(near, axis=0), np.any(near, axis=0) | (len(near) < 2)
    return bool(np.all(every | (coarse & some)))


def _jumps(pose: Float, run: tuple[int, int]) -> bool:
    fresh = pose[starts(pose)]
    if run[1] + 1 >= len(pose):
        return False
    moved, turned = _steps(fresh)
    (leap,), (turn,) = _steps(pose[run[1] : run[1] + 2])
    most = 5.0 * np.quantile(moved, 0.95), 5.0 * np.quantile(turned, 0.95)
    return bool(leap > max(5e-4, most[0]) or turn > max(np.deg2rad(0.2), most[1]))


def _steps(pose: Float) -> tuple[Float, Float]:
    """Distance [m] and angle [rad] from each sample (T, 7) to the next."""
    rotation = matrix_from_quaternion(pose[:, 3:])
    return norm(np.diff(pose[:, :3], axis=0)), norm(rotation_vector(np.swapaxes(rotation[:-1], -1, -2) @ rotation[1:]))

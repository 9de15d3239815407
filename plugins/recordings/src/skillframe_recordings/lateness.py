r"""Delay between wrench and pose clocks: the shift at which motion explains the wrench best.

With X the changes over 20 ms of position, direction of motion and orientation, and F those of the force, clipped at the
98 % quantile, the share of F that X explains is

    s(d) = |P_X F(t + d)|^2 / |F(t + d)|^2,        P_X the projection on X,

for d within 0.7 s. The clocks differ only if s has one narrow peak within 0.6 s: at least 0.25 above its median,
between 0.9 samples and 0.4 s wide, with everything 0.25 s away below 0.6 of its height, and at least 0.03 s from 0,
where a tenth of its height is lost. Both halves of the changes must peak within 0.06 s of it, since a clock shifts all
events alike and a teacher's habits do not.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.demonstration import Demonstration, alive
from skillframe.frames import Float, norm
from skillframe_recordings.thresholds import AUDIT

RATE, SPAN = AUDIT.late_rate_hz, AUDIT.late_span


class Lateness(NamedTuple):
    """Delay of the wrench relative to the pose.

    Attributes:
        seconds: positive if the wrench is late; rounded to 0.01 s.
        here, best: explained share of the force's changes as recorded, and shifted.
    """

    seconds: float
    here: float
    best: float

    @property
    def counts(self) -> bool:
        """Whether the delay exceeds its uncertainty."""
        return abs(self.seconds) >= AUDIT.late_s

    def words(self) -> str:
        """Return a warning."""
        way = "after" if self.seconds > 0.0 else "before"
        shares = f"{self.best:.0%} of its changes if shifted, {self.here:.0%} as it is"
        return (
            f"clocks: the wrench comes {abs(self.seconds):.2f} s {way} the motion, which explains {shares}; "
            f"--set wrench-shift={-self.seconds:.2f} cures it"
        )


def lateness(demonstration: Demonstration, live: NDArray[np.bool_] | None = None) -> Lateness | None:
    """Return the delay of the wrench, or None if undetermined.

    Args:
        demonstration: as read.
        live: (T,) valid sensor samples; None detects them.
    """
    d = demonstration
    clock_is_sound = AUDIT.slow_hz <= d.rate <= AUDIT.fast_hz and d.duration * d.rate < AUDIT.gaps * len(d)
    if not clock_is_sound or d.duration < AUDIT.late_duration_s or d.meta.get("contact") is False:
        return None
    compared = _compared(d, live)
    if compared is None:
        return None
    motion, force = compared
    found = _peak(_shares(motion, force), AUDIT.late_narrow * RATE / d.rate)
    if found is None or not found.counts:
        return found
    spent = np.cumsum((force**2).sum(axis=1))
    first = (spent <= 0.5 * spent[-1])[:, None]
    peaks = [int(np.argmax(_shares(motion, np.where(half, force, 0.0)))) for half in (first, ~first)]
    agree = all(abs(peak - SPAN - found.seconds * RATE) <= AUDIT.late_halves for peak in peaks)
    return found if agree else None


def lateness_shares(demonstration: Demonstration) -> Float:
    """Return s(d) (71,) for shifts d from -0.7 to 0.7 s, empty without motion or force changes.

    Args:
        demonstration: as read, 4 s or longer.
    """
    compared = _compared(demonstration, None)
    return np.zeros(0) if compared is None else _shares(*compared)


def _compared(d: Demonstration, live: NDArray[np.bool_] | None) -> tuple[Float, Float] | None:
    """Changes of motion (T, n) and force (T, 3), or None if either is constant."""
    time = np.arange(d.time[0], d.time[-1], 1.0 / RATE)
    position = np.stack([np.interp(time, d.time, column) for column in d.position.T], axis=1)
    speed = np.gradient(position, time, axis=0)
    way = speed / np.maximum(norm(speed)[:, None], AUDIT.late_speed_m_s)
    nearest = np.clip(np.searchsorted(d.time, time), 0, len(d) - 1)
    orientation = d.pose.rotation[nearest].reshape(-1, 9)
    changes = _clipped(np.diff(np.hstack([position, way, orientation]), axis=0))
    size = changes.std(axis=0)
    motion = np.asarray((changes - changes.mean(axis=0))[:, size > 1e-9] / size[size > 1e-9])
    width = max(1, round(d.rate / RATE))  # the force is averaged over 20 ms, and zero during stalls
    total = np.concatenate([np.zeros((1, 3)), np.cumsum(d.wrench[:, :3], axis=0)])
    first = np.clip(np.arange(len(d)) - width // 2, 0, len(d) - width)
    mean = (total[first + width] - total[first]) / width
    pushes = np.stack([np.interp(time, d.time, column) for column in mean.T], axis=1)
    there = np.interp(time, d.time, (alive(d) if live is None else live).astype(float)) >= 1.0
    force = np.where((there[1:] & there[:-1])[:, None], _clipped(np.diff(pushes, axis=0)), 0.0)
    return (motion, force) if motion.shape[1] and np.any(force) else None


def _clipped(changes: Float) -> Float:
    most = np.quantile(np.abs(changes), AUDIT.late_clip, axis=0)
    return np.clip(changes, -most, most)


def _shares(motion: Float, force: Float) -> Float:
    """s(d) for d = -SPAN ... SPAN samples."""
    kept = slice(SPAN, len(motion) - SPAN)
    left, size, _ = np.linalg.svd(motion[kept] - motion[kept].mean(axis=0), full_matrices=False)
    basis = left[:, size > 1e-6 * size[0]]
    result = np.zeros(2 * SPAN + 1)
    for i in range(2 * SPAN + 1):
        part = force[i : i + len(basis)]
        part = part - part.mean(axis=0)
        result[i] = ((basis.T @ part) ** 2).sum() / max(float((part**2).sum()), 1e-12)
    return result


def _peak(share: Float, narrowest: float) -> Lateness | None:
    best, level = int(np.argmax(share)), float(np.median(share))
    height = float(share[best]) - level
    if not AUDIT.late_edge <= best < len(share) - AUDIT.late_edge or height < AUDIT.late_height:
        return None
    below = np.flatnonzero(share <= level + 0.5 * height)
    width = below[below > best].min(initial=len(share)) - below[below < best].max(initial=-1) - 1
    away = np.abs(np.arange(len(share)) - best) > AUDIT.late_away_s * RATE
    if (
        width < narrowest
        or width / RATE > AUDIT.late_width_s
        or np.any(share[away] - level > AUDIT.late_second * height)
    ):
        return None
    before, middle, after = share[best - 1 : best + 2]
    bend = before - 2.0 * middle + after
    finer = 0.5 * (before - after) / bend if bend < 0.0 else 0.0
    here = float(share[SPAN])
    seconds = float(best - SPAN + finer) / RATE
    lost = (share[best] - here) / height >= AUDIT.late_gain
    return Lateness(round(seconds, 2) if lost else 0.0, here, float(share[best]))

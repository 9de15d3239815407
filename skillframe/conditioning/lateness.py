r"""Whether wrench and pose are of one clock: the shift at which the motion explains the wrench best.

A force changes when the tool touches, slides another way, presses further or turns. With the changes over 20 ms of
position, direction of motion and attitude as columns of X, and those of the force as F, the share of F that X explains,

    s(d) = |P_X F(t + d)|^2 / |F(t + d)|^2,        P_X the projection on X,

is looked at for d within 0.7 s. Large changes are clipped at the 98 % quantile, so that no spike or jump decides. The
clocks are said to differ only if s has one narrow peak within 0.6 s: at least 0.15 above its median, no wider than
0.4 s at half of its height, all else 0.25 s and more away from it below 0.6 of its height, and itself 0.03 s or more
away from 0, where a tenth of its height is lost. Else nothing is said, since people also push before they move. All of
this is our choice.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.demonstration.faults.find import alive
from skillframe.demonstration.record import Demonstration
from skillframe.frames import Float, norm

RATE, SPAN, LEAST_TIME = 50.0, 35, 4.0
"""Samples a second that are compared, how many of them each way, and the shortest recording [s]."""
CLIP, SLOWEST = 0.98, 0.01
HEIGHT, WIDTH, AROUND, SECOND = 0.15, 0.4, 0.25, 0.6
LEAST_SHIFT, LEAST_GAIN = 0.03, 0.1
EDGE = 5
LOWEST, HIGHEST, MOST_GAPS = 5.0, 2e4, 10.0
"""Rates [Hz] of a clock whose unit is right, and how much longer than its samples a recording may be."""


class Lateness(NamedTuple):
    """How late the wrench is against the pose.

    Attributes:
        seconds: positive where the wrench comes late; to the nearest hundredth.
        here, best: share of the force's changes that the motion explains as recorded, and if shifted.
    """

    seconds: float
    here: float
    best: float

    @property
    def counts(self) -> bool:
        """Whether the clocks differ by more than the estimate's own uncertainty."""
        return abs(self.seconds) >= LEAST_SHIFT

    def words(self) -> str:
        """As a sentence says it."""
        way = "after" if self.seconds > 0.0 else "before"
        shares = f"{self.best:.0%} of its changes if shifted, {self.here:.0%} as it is"
        return (
            f"clocks: the wrench comes {abs(self.seconds):.2f} s {way} the motion, which explains {shares}; "
            f"--wrench-shift {-self.seconds:.2f} cures it"
        )


def lateness(demonstration: Demonstration, live: NDArray[np.bool_] | None = None) -> Lateness | None:
    """How late the wrench is, or None where the recording does not tell.

    Args:
        demonstration: as read.
        live: (T,) where its sensor is alive; looked for if not given.
    """
    d = demonstration
    clock_is_sound = LOWEST <= d.rate <= HIGHEST and d.duration * d.rate < MOST_GAPS * len(d)
    if not clock_is_sound or d.duration < LEAST_TIME or d.meta.get("contact") is False:
        return None
    share = lateness_shares(d, live)
    return _peak(share) if len(share) else None


def lateness_shares(demonstration: Demonstration, live: NDArray[np.bool_] | None = None) -> Float:
    """The share s(d) (71,) of the force's changes that the motion explains, for shifts d from -0.7 to 0.7 s.

    Empty where nothing moves or no force changes.

    Args:
        demonstration: as read, 4 s or longer.
        live: (T,) where its sensor is alive; looked for if not given.
    """
    d = demonstration
    time = np.arange(d.time[0], d.time[-1], 1.0 / RATE)
    motion, force = _motion(d, time), _force(d, time, alive(d) if live is None else live)
    if motion.shape[1] == 0 or not np.any(force):
        return np.zeros(0)
    return _shares(motion, force)


def _motion(d: Demonstration, time: Float) -> Float:
    """Changes (T - 1, n) of position, direction of motion and attitude, scaled, of columns that change."""
    position = np.stack([np.interp(time, d.time, column) for column in d.position.T], axis=1)
    speed = np.gradient(position, time, axis=0)
    way = speed / np.maximum(norm(speed)[:, None], SLOWEST)
    nearest = np.clip(np.searchsorted(d.time, time), 0, len(d) - 1)
    attitude = d.pose.rotation[nearest].reshape(-1, 9)
    changes = _clipped(np.diff(np.hstack([position, way, attitude]), axis=0))
    size = changes.std(axis=0)
    return np.asarray((changes - changes.mean(axis=0))[:, size > 1e-9] / size[size > 1e-9])


def _force(d: Demonstration, time: Float, live: NDArray[np.bool_]) -> Float:
    """Changes (T - 1, 3) of the force, averaged over 20 ms. Zero where the wrench stalls."""
    width = max(1, round(d.rate / RATE))
    total = np.concatenate([np.zeros((1, 3)), np.cumsum(d.wrench[:, :3], axis=0)])
    first = np.clip(np.arange(len(d)) - width // 2, 0, len(d) - width)
    mean = (total[first + width] - total[first]) / width
    force = np.stack([np.interp(time, d.time, column) for column in mean.T], axis=1)
    there = np.interp(time, d.time, live.astype(float)) >= 1.0
    return np.where((there[1:] & there[:-1])[:, None], _clipped(np.diff(force, axis=0)), 0.0)


def _clipped(changes: Float) -> Float:
    most = np.quantile(np.abs(changes), CLIP, axis=0)
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


def _peak(share: Float) -> Lateness | None:
    """Its peak, if it is one that a difference of clocks makes."""
    best, level = int(np.argmax(share)), float(np.median(share))
    height = float(share[best]) - level
    if not EDGE <= best < len(share) - EDGE or height < HEIGHT:
        return None
    below = np.flatnonzero(share <= level + 0.5 * height)
    width = below[below > best].min(initial=len(share)) - below[below < best].max(initial=-1) - 1
    away = np.abs(np.arange(len(share)) - best) > AROUND * RATE
    if width / RATE > WIDTH or np.any(share[away] - level > SECOND * height):
        return None
    before, middle, after = share[best - 1 : best + 2]
    bend = before - 2.0 * middle + after
    finer = 0.5 * (before - after) / bend if bend < 0.0 else 0.0
    here = float(share[SPAN])
    seconds = float(best - SPAN + finer) / RATE
    lost = (share[best] - here) / height >= LEAST_GAIN
    return Lateness(round(seconds, 2) if lost else 0.0, here, float(share[best]))

"""Figures of a run's contact: what a real run and simulated ones are compared by.

They use the tip's motion, the measured force and the time since the first touch. None needs a model of the fixture.

Friction without a model: where the tip slides, Coulomb's law gives the force of the environment on the tool, f, in
terms of the direction of motion s,

    mu = -f.s / |f - (f.s) s|                                                                                   (1)

as long as the tip touches one face. f and s are means over the same half second: noise of 50 um in a measured position
is more than a slow tip moves in 50 ms.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skillframe.execution import Trace
from skillframe.frames import Float, matrix_from_quaternion, rotation_vector

AXES = "xyz"
NAMES = (
    "friction",
    *(f"direction of sliding, {axis}" for axis in AXES),
    *(f"direction of the force in sliding, {axis}" for axis in AXES),
    *(f"first touch, {axis}" for axis in AXES),
    *(f"end, {axis}" for axis in AXES),
    *(f"turn about {axis}" for axis in AXES),
    "log time, touch to end",
    "log mean force, touch to end",
)
"""The figures of `figures`, in its order; positions and axes are the base's."""
FRICTION = NAMES.index("friction")
"""Index of the median of equation (1)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Contact:
    """What counts as contact and as sliding.

    Attributes:
        touch_n: force of a contact [N]; several times the noise of a filtered wrist sensor.
        touch_s: time for which the first touch has to last [s], longer than a spike.
        slide_m_s: least speed of a sliding tip [m/s]; below it, noise of the position gives the direction.
        half_s: half of the time over which motion and force are averaged [s].
        bend_rad: largest turn of the motion between both halves [rad]; a tip that leaves a face or arrives turns more.
        even: least ratio of the ways of both halves; a tip that stops or begins to slide has less.
        least_s: shortest time of sliding that has figures [s].
    """

    touch_n: float = 4.0
    touch_s: float = 0.05
    slide_m_s: float = 1e-3
    half_s: float = 0.25
    bend_rad: float = 0.32
    even: float = 0.5
    least_s: float = 0.1


CONTACT = Contact()


def tip_path(trace: Trace) -> Float:
    """Measured positions (T, 3) in base [m] of the tool's tip, or of the controlled point if the tool has no tip."""
    center = np.asarray(trace.meta.get("center_of_compliance") or [0.0] * 3, dtype=float)
    tip = np.asarray((trace.meta.get("frames") or {}).get("tip", center), dtype=float)
    result: Float = trace.position + matrix_from_quaternion(trace.quaternion) @ (tip - center)
    return result


class Sliding:
    """Where a trace's tip slides over one face: in contact and in one direction all through the averaging time.

    Attributes:
        at: (T,) whether the tip slides in a sample.
        motion: (k, 3) directions of motion there.
        force: (k, 3) mean forces there [N].
        friction: (k,) by equation (1).
    """

    def __init__(self, trace: Trace) -> None:
        time, path, force = trace.time, tip_path(trace), trace.wrench[:, :3]
        half = max(1, round(CONTACT.half_s * (len(time) - 1) / max(time[-1] - time[0], CONTACT.half_s)))
        middle = np.arange(half, len(time) - half)
        before, after = path[middle] - path[middle - half], path[middle + half] - path[middle]
        velocity = (before + after) / (time[middle + half] - time[middle - half])[:, None]
        speed = _size(velocity)
        touches = np.r_[0, np.cumsum(_size(force) > CONTACT.touch_n)]
        total = np.vstack([np.zeros(3), np.cumsum(force, axis=0)])
        window = 2 * half + 1
        one, other = _size(before), _size(after)
        even = np.minimum(one, other) > CONTACT.even * np.maximum(one, other)
        straight = np.sum(before * after, axis=1) > np.cos(CONTACT.bend_rad) * one * other
        slides = (touches[middle + half + 1] - touches[middle - half] == window) & straight & even
        slides &= speed > CONTACT.slide_m_s
        at = middle[slides]
        self.at: NDArray[np.bool_] = np.isin(np.arange(len(time)), at)
        self.motion = velocity[slides] / speed[slides, None]
        self.force = (total[at + half + 1] - total[at - half]) / window
        along = np.sum(self.force * self.motion, axis=1)
        self.friction: Float = -along / _size(self.force - along[:, None] * self.motion)


def first_touch(trace: Trace) -> int | None:
    """Index of the first sample of a contact that lasts, or None."""
    touch = _size(trace.wrench[:, :3]) > CONTACT.touch_n
    begins = np.flatnonzero(touch & ~np.r_[False, touch[:-1]])
    ends = np.r_[np.flatnonzero(~touch), len(touch)]
    for begin in begins:
        end = min(ends[np.searchsorted(ends, begin)], len(touch) - 1)
        if trace.time[end] - trace.time[begin] >= CONTACT.touch_s:
            return int(begin)
    return None


def figures(trace: Trace) -> Float:
    """The figures of a trace, NaN where it has none: friction of a run that hardly slides, the touch of one without."""
    found, path, sliding, touch = np.full(len(NAMES), np.nan), tip_path(trace), Sliding(trace), first_touch(trace)
    period = (trace.time[-1] - trace.time[0]) / (len(trace.time) - 1)
    if len(sliding.friction) * period >= CONTACT.least_s:
        found[FRICTION] = np.median(sliding.friction)
        found[1:4] = sliding.motion.mean(axis=0)
        found[4:7] = (sliding.force / _size(sliding.force)[:, None]).mean(axis=0)
    first, last = matrix_from_quaternion(trace.quaternion[[0, -1]])
    found[10:13], found[13:16] = path[-1], rotation_vector((last @ first.T)[None])[0]
    if touch is not None:
        found[7:10] = path[touch]
        found[16] = np.log(trace.time[-1] - trace.time[touch] + period)
        found[17] = np.log(_size(trace.wrench[touch:, :3]).mean())
    return found


def _size(vectors: Float) -> Float:
    result: Float = np.linalg.norm(vectors, axis=1)
    return result

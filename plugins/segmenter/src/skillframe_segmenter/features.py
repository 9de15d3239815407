r"""Features of a phase model: directions of motion and contact, softly normalised to length below one.

    soft(x, x0) = x / sqrt(|x|^2 + x0^2)
    u = [soft(v, v_r / 4), soft(w, w_r / 4)]      a = [soft(F, F_0), soft(T, T_0)]      phi = [a, |a_F|, |a_T|, 1]

An LMC is a direction, not a speed, and a contact a direction of force, not its size; rest and free air are near zero
instead of random unit vectors. The scales are

    v_r = max(P80 |v|, 1 mm/s),    w_r = max(P80 |w|, P80 |v| / 0.2 m, 1 deg/s)             per demonstration
    F_0 = max(0.2 P90 |F|, 1.5 s_F),    T_0 = max(0.2 P90 |T|, 1.5 s_T, F_0 10 mm)          over all of them

with P80 and P90 percentiles and s the noise from second differences, 1.4826 median|x_2 - 2 x_1 + x_0| / sqrt 6.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from skillframe.frames import Float, norm
from skillframe_segmenter.windows import Windows


class Scales(NamedTuple):
    """Scales of soft normalisation: speed, turning speed, force and torque [m/s, rad/s, N, Nm]."""

    speed: float
    turning: float
    force: float
    torque: float


class Features(NamedTuple):
    """Features of one demonstration, W windows.

    Attributes:
        motion: (W, 6) u.
        contact: (W, 6) a.
    """

    motion: Float
    contact: Float

    @property
    def regressors(self) -> Float:
        """(W, 9) phi."""
        return regressors(self.contact)


def soft(x: Float, scale: float) -> Float:
    """X (..., 3) softly normalised."""
    result: Float = x / np.sqrt((x * x).sum(-1, keepdims=True) + scale * scale)
    return result


def soft_pair(x: Float, first: float, second: float) -> Float:
    """Both halves of x (..., 6) softly normalised."""
    return np.concatenate([soft(x[..., :3], first), soft(x[..., 3:], second)], axis=-1)


def regressors(contact: Float) -> Float:
    """Phi (..., 9) of contacts a (..., 6)."""
    one = np.ones((*contact.shape[:-1], 1))
    return np.concatenate([contact, norm(contact[..., :3])[..., None], norm(contact[..., 3:])[..., None], one], axis=-1)


def scales(demonstrations: Sequence[Windows]) -> list[Scales]:
    """Scales of each demonstration, force and torque those of all."""
    wrench = [w.wrench for w in demonstrations]
    force = max(0.2 * _percentile(wrench, slice(0, 3), 90), 1.5 * _noise(wrench, slice(0, 3)), 1e-9)
    # the force at an arm of 10 mm at least
    torque = max(0.2 * _percentile(wrench, slice(3, 6), 90), 1.5 * _noise(wrench, slice(3, 6)), force * 0.01)
    speeds = [typical_speeds(demonstrations, w) for w in demonstrations]
    return [Scales(0.25 * speed, 0.25 * turning, force, torque) for speed, turning in speeds]


def typical_speeds(demonstrations: Sequence[Windows], one: Windows) -> tuple[float, float]:
    """V_r and w_r of one of the demonstrations [m/s, rad/s]."""
    typical = _percentile([w.motion for w in demonstrations], slice(0, 3), 80)
    # at least the typical speed at a lever of 0.2 m, 1 degree/s, and 1 mm/s
    turning = max(_percentile([one.motion], slice(3, 6), 80), typical / 0.2, np.deg2rad(1.0))
    return max(_percentile([one.motion], slice(0, 3), 80), 1e-3), turning


def features(demonstration: Windows, scale: Scales) -> Features:
    """U and a of a demonstration."""
    return Features(
        soft_pair(demonstration.motion, scale.speed, scale.turning),
        soft_pair(demonstration.wrench, scale.force, scale.torque),
    )


def typical_scales(each: Sequence[Scales]) -> Scales:
    """Median scales, for a new demonstration or run."""
    return Scales(*(float(np.median(values)) for values in zip(*each, strict=True)))


def _percentile(parts: Sequence[Float], columns: slice, q: float) -> float:
    return float(np.percentile(np.concatenate([norm(p[:, columns]) for p in parts]), q))


def _noise(parts: Sequence[Float], columns: slice) -> float:
    second = np.concatenate([p[2:, columns] - 2.0 * p[1:-1, columns] + p[:-2, columns] for p in parts])
    return float(norm(1.4826 * np.median(np.abs(second), axis=0) / np.sqrt(6.0)))

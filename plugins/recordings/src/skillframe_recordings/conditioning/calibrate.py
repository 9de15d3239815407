r"""Calibration of a force sensor in free air: bias, weight, mounting and gravity with uncertainties.

See equation (1) of `demonstration.calibration`. For known gravity, the force is linear in the bias and a matrix A = m
|g| M^T, whose nearest rotation (Arun, Huang and Blostein 1987) starts a least squares fit of bias, weight, mounting
(rotation vector) and gravity's direction (two angles). The torque is linear in its bias and c. Covariances are s^2 (J^T
J)^-1 with the residual s, times the residual's autocorrelation time.

Fitted mounting and gravity replace the stated ones only if known to 2 degrees, significant (chi-squared at 0.1 %) and
larger than 1 degree: 1 degree with 1 kg reads 0.17 N, a wrist sensor's noise in motion.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.demonstration import GRAVITY, Calibration
from skillframe.errors import InputError
from skillframe.frames import Float, cross, norm, rotate, rotation_matrix, rotation_vector, skew
from skillframe_recordings.conditioning.payload import (
    LARGEST_CONDITION,
    LARGEST_MASS,
    LEAST_RESIDUAL,
    LONGEST_LEVER,
    RESIDUAL_SHARE,
    excitation_advice,
    turned,
)

STANDARD = float(np.linalg.norm(GRAVITY))


@dataclass(frozen=True, slots=True, kw_only=True)
class Calibrated:
    """Result of a calibration.

    Attributes:
        calibration: the figures; `spread` holds their standard deviations, None if undetermined.
        samples: their number.
        independent: effective number, given the residual's autocorrelation.
        turned: largest angle between two directions of gravity in the tool [rad].
        mounting: result for the mounting, in words.
        level: result for gravity's direction, in words.
        advice: how to determine the rest, or "".
    """

    calibration: Calibration
    samples: int
    independent: float
    turned: float
    mounting: str
    level: str
    advice: str


class _Fit(NamedTuple):
    """A least squares fit of the force.

    Attributes:
        parameters: bias (3), weight [N], then 3 of the mounting and 2 of gravity if free.
        covariance: of the parameters.
        residual: (T, 3) [N].
        mounting: (3, 3) sensor to tool.
        down: (3,) unit direction of gravity in base.
    """

    parameters: Float
    covariance: Float
    residual: Float
    mounting: Float
    down: Float


def calibrate(wrench: Float, rotation: Float, source: str = "calibration") -> Calibrated:
    """Return the calibration from readings without contact.

    Args:
        wrench: (T, 6) in sensor axes [N, Nm].
        rotation: (T, 3, 3) tool orientation in base.
        source: the recording's name, for messages.

    Raises:
        InputError: too few samples, too little rotation, mirrored axes, or contact.
    """
    if len(wrench) < 8:
        raise InputError(source, f"holds {len(wrench)} samples", "give 8 orientations or more")
    down = GRAVITY / STANDARD
    seen = rotate(np.swapaxes(rotation, -1, -2), down)
    weight_and_bias = np.concatenate([seen[:, :, None], np.broadcast_to(np.eye(3), (len(seen), 3, 3))], axis=-1)
    values = np.linalg.svd(weight_and_bias.reshape(-1, 4), compute_uv=False)
    condition = float(values[0] / values[-1]) if values[-1] > 0.0 else float("inf")
    if condition > LARGEST_CONDITION:
        raise InputError(
            source, "does not separate weight from bias", excitation_advice(9.81 * seen, condition, np.inf)
        )
    start = _mounting_guess(wrench[:, :3], seen, source)
    force, words = _chosen(wrench[:, :3], rotation, down, start)
    weight = rotate(np.swapaxes(rotation @ force.mounting, -1, -2), force.down) * force.parameters[3]
    com, bias, torque = _torque(wrench[:, 3:], weight)
    mass = float(force.parameters[3]) / STANDARD
    advice = excitation_advice(STANDARD * seen, condition, torque.condition)
    deviations = [float(v) for v in np.sqrt(np.maximum(np.diag(force.covariance), 0.0))]
    spread = {
        "bias": [*deviations[:3], *torque.bias_spread], "mass_kg": deviations[3] / STANDARD, "com_m": torque.com_spread,
        "residual_force": _rms(force.residual), "residual_torque": _rms(torque.residual), **words.spread,
    }  # fmt: skip
    found = Calibration(
        bias=np.concatenate([force.parameters[:3], bias]), mass=mass, com=com, mounting=force.mounting,
        gravity=STANDARD * force.down, spread=spread,
    )  # fmt: skip
    _refuse_absurd(found, force.residual, source)
    return Calibrated(
        calibration=found, samples=len(wrench), independent=len(wrench) / _correlation(force.residual),
        turned=turned(seen), mounting=words.mounting, level=words.level, advice=advice,
    )  # fmt: skip


def _mounting_guess(force: Float, seen: Float, source: str) -> Float:
    """The mounting (3, 3) of the best linear fit, identity with too little rotation."""
    centred = seen - seen.mean(axis=0)
    if np.linalg.svd(centred, compute_uv=False)[-1] < 1.0 / LARGEST_CONDITION * np.sqrt(len(seen)):
        return np.eye(3)
    a = np.linalg.lstsq(centred, force - force.mean(axis=0), rcond=None)[0].T
    s = np.linalg.svd(a, compute_uv=False)
    if np.linalg.det(a) < 0.0 and s[-1] > 0.5 * s[0]:  # a mirrored axis, if A is far from singular
        raise InputError(source, *_mirror(a))
    return _nearest_rotation(a).T


def _nearest_rotation(a: Float) -> Float:
    u, _, vt = np.linalg.svd(a)
    rotation: Float = u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt
    return rotation


def _mirror(a: Float) -> tuple[str, str]:
    """The problem and remedy for a weight that turns as in a mirror.

    All three signs and one of them differ by half a turn of the mounting; the one nearer to the stated axes is named.
    """
    signs = {"all three": -np.ones(3), **{f"f{axis}": 1.0 - 2.0 * np.eye(3)[i] for i, axis in enumerate("xyz")}}
    turns = {name: float(norm(rotation_vector(_nearest_rotation(np.diag(s) @ a)))) for name, s in signs.items()}
    wrong = min(turns, key=lambda name: turns[name])
    if wrong == "all three":
        return (
            "the weight pulls up: fx, fy and fz all have the wrong sign, as a sensor that reads the tool's force has",
            'write wrench-sign = "teacher" in the layout, which turns all six round',
        )
    return (
        f"the weight turns as in a mirror: one axis has the wrong sign, {wrong} if the sensor is mounted as stated",
        "correct the order and signs of fx, fy, fz and tx, ty, tz",
    )


class _Words(NamedTuple):
    """Results for mounting and gravity in words, and their standard deviations [rad]."""

    mounting: str
    level: str
    spread: dict[str, float | None]


def _chosen(force: Float, rotation: Float, down: Float, start: Float) -> tuple[_Fit, _Words]:
    free = {
        name: _fit(force, rotation, down, start, mount=mount, level=level)
        for name, mount, level in (("both", True, True), ("mounting", True, False), ("level", False, True))
    }
    mount = _told(free["both"], slice(4, 7)) or _told(free["mounting"], slice(4, 7))
    level = _told(free["both"], slice(7, 9)) or _told(free["level"], slice(4, 6))
    alone = free["mounting" if _told(free["both"], slice(4, 7)) is None else "both"].mounting
    use_mount = mount is not None and _matters(mount, rotation_vector(alone))
    use_level = level is not None and _matters(level, level.value)
    if use_mount and use_level and _told(free["both"], slice(4, 9)) is None:
        use_level = False  # the two cannot be separated: a turned sensor is commoner than a tilted base
    best = _fit(force, rotation, down, start if use_mount else np.eye(3), mount=use_mount, level=use_level)
    leaning = float(np.arccos(np.clip(best.down @ down, -1.0, 1.0)))
    return best, _Words(
        _said(mount, use_mount, float(norm(rotation_vector(best.mounting))), "the stated axes"),
        _said(level, use_level, leaning, "a level base"),
        {"mounting_rad": None if mount is None else mount.deviation, "level_rad": level and level.deviation},
    )


class _Group(NamedTuple):
    """Some parameters of a fit.

    Attributes:
        value: relative to their start.
        deviation: largest standard deviation over all directions [rad].
    """

    value: Float
    deviation: float


def _told(fit: _Fit, which: slice) -> _Group | None:
    """Some parameters, or None if the data do not determine them."""
    covariance = fit.covariance[which, which]
    if not np.all(np.isfinite(covariance)):
        return None
    deviation = float(np.sqrt(max(np.linalg.eigvalsh(covariance)[-1], 0.0)))
    if deviation > np.deg2rad(2.0):
        return None
    return _Group(fit.parameters[which], deviation)


def _matters(group: _Group, turn: Float) -> bool:
    from scipy.stats import chi2

    angle = float(norm(turn))
    return angle > np.deg2rad(1.0) and (angle / max(group.deviation, 1e-9)) ** 2 > float(chi2.isf(1e-3, len(turn)))


def _said(group: _Group | None, used: bool, angle: float, stated: str) -> str:
    if group is None:
        return f"not determined by these orientations; taken as {stated}"
    deviation = f"+- {np.rad2deg(group.deviation):.2g} degrees"
    return f"turned from {stated} by {np.rad2deg(angle):.2f} {deviation}" if used else f"as {stated}, {deviation}"


def _fit(force: Float, rotation: Float, down: Float, start: Float, *, mount: bool, level: bool) -> _Fit:
    """Least squares of the force. A free mounting starts from `start`."""
    from scipy.optimize import least_squares

    size = 4 + 3 * mount + 2 * level

    def pose(p: Float) -> tuple[Float, Float]:
        turn = start @ rotation_matrix(p[4:7]) if mount else start
        lean = rotation_matrix(np.array([*p[size - 2 :], 0.0])) @ down if level else down
        return turn, lean

    def left(p: Float) -> Float:
        turn, lean = pose(p)
        weight = p[3] * rotate(np.swapaxes(rotation @ turn, -1, -2), lean)
        return np.asarray(force - p[:3] - weight).ravel()

    first = np.zeros(size)
    unit = rotate(np.swapaxes(rotation @ start, -1, -2), down)
    centred, moved = force - force.mean(axis=0), unit - unit.mean(axis=0)
    first[3] = max(float(np.sum(centred * moved) / np.sum(moved**2)), 1e-3)
    first[:3] = (force - first[3] * unit).mean(axis=0)
    found = least_squares(left, first, x_scale="jac")
    residual = found.fun.reshape(-1, 3)
    variance = float(found.fun @ found.fun) / max(len(found.fun) - size, 1)
    information = found.jac.T @ found.jac
    with np.errstate(all="ignore"):
        good = np.linalg.cond(information) < 1e15  # beyond it the inverse has no correct digit
    inverse = np.linalg.inv(information) if good else np.full((size, size), np.inf)
    covariance = variance * _correlation(residual) * inverse
    turn, lean = pose(found.x)
    return _Fit(found.x, covariance, residual, turn, lean)


class _Torque(NamedTuple):
    residual: Float
    condition: float
    com_spread: list[float | None]
    bias_spread: list[float]


def _torque(torque: Float, weight: Float) -> tuple[Float, Float, _Torque]:
    """Centre of mass (3,) and torque bias (3,) by least squares, with their uncertainty.

    Undetermined directions of the centre of mass are zero and have no spread.
    """
    scale = float(norm(weight).mean()) or 1.0
    design = -skew(weight) / scale
    centred, target = design - design.mean(axis=0), torque - torque.mean(axis=0)
    u, s, vt = np.linalg.svd(centred.reshape(-1, 3), full_matrices=False)
    keep = s > max(s.max(), 1e-12) / LARGEST_CONDITION
    com = vt[keep].T @ ((u.T @ target.ravel())[keep] / s[keep]) / scale
    bias = (torque - cross(com, weight)).mean(axis=0)
    residual = torque - bias - cross(com, weight)
    variance = float(np.sum(residual**2)) / max(residual.size - 6, 1) * _correlation(residual)
    shown: NDArray[np.bool_] = np.all(np.abs(vt[~keep]) < 1e-3, axis=0)
    spread = np.sqrt(np.sum((vt[keep].T / s[keep]) ** 2, axis=1) * variance) / scale
    condition = float(s[0] / s[-1]) if s[-1] > 0.0 else float("inf")
    bias_spread = [float(np.sqrt(variance / len(torque)))] * 3
    told = [float(v) if there else None for v, there in zip(spread, shown, strict=True)]
    return com, bias, _Torque(residual, condition, told, bias_spread)


def _correlation(residual: Float) -> float:
    """Autocorrelation time of residuals (T, n) in samples: 1 + 2 sum of rho up to its first zero, at least 1.

    It is 1 if rho of neighbours is within two standard deviations, (n T)^-1/2 each, of zero.
    """
    count = len(residual)
    centred = residual - residual.mean(axis=0)
    power = np.abs(np.fft.rfft(centred, 2 * count, axis=0)) ** 2
    rho = np.fft.irfft(power.sum(axis=1))[:count]
    if rho[0] <= 0.0:
        return 1.0
    rho = rho / rho[0]
    if rho[1] <= 2.0 / np.sqrt(residual.size):
        return 1.0
    below = np.flatnonzero(rho <= 0.0)
    return max(1.0, 1.0 + 2.0 * float(rho[1 : below[0] if below.size else count].sum()))


def _refuse_absurd(found: Calibration, residual: Float, source: str) -> None:
    size = norm(residual)
    worst = int(np.argmax(size))
    others = float(np.sqrt(np.mean(np.delete(size, worst) ** 2)))
    lever, left = float(norm(found.com)), _rms(residual)
    most = max(LEAST_RESIDUAL, RESIDUAL_SHARE * STANDARD * found.mass)
    said = [
        (found.mass < 0.01, f"a tool of {found.mass:.3g} kg, where 0.01 kg is the least"),
        (found.mass > LARGEST_MASS, f"a tool of {found.mass:.3g} kg, where {LARGEST_MASS:g} kg is the most"),
        (lever > LONGEST_LEVER, f"a centre of mass {lever:.3g} m away, where {LONGEST_LEVER:g} m is the most"),
        (left > most, f"readings that no tool explains: {left:.3g} N rms are left, where {most:.3g} N is the most"),
        (
            size[worst] > max(0.5, 8.0 * others),  # [N]; the largest noise of 1e6 samples stays below
            f"sample {worst + 1} of {len(size)} {size[worst]:.3g} N off where the others are {others:.2g} N off",
        ),
    ]
    if wrong := [text for absurd, text in said if absurd]:
        raise InputError(
            source, f"the fit gives {wrong[0]}",
            "there is contact, or an axis, unit or orientation is wrong: leave it out, or name a stretch of free air "
            "(from and to in a layout)",
        )  # fmt: skip


def _rms(residual: Float) -> float:
    return float(np.sqrt(np.mean(residual**2)))


def plain(found: Calibrated) -> dict[str, Any]:
    """Return the plain values that a calibration's file also holds."""
    return {
        "samples": found.samples, "independent_samples": found.independent, "turned_rad": found.turned,
        "mounting": found.mounting, "level": found.level, "advice": found.advice,
    }  # fmt: skip

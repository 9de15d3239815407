r"""A force sensor calibrated from its readings in free air: bias, weight, mounting and gravity, with what is not known.

Equation (1) of `demonstration.calibration`. The force is linear in bias and a 3x3 matrix A = m |g| M^T once gravity's
direction in base is known; the nearest rotation to A (Arun, Huang and Blostein 1987, by singular values) starts a least
squares fit of bias, weight, mounting (rotation vector) and gravity's direction (two angles). The torque is linear in
its bias and c once the weight is known. Covariances are s^2 (J^T J)^-1, s the residual, times the residual's
autocorrelation time, since neighbouring samples of a recording are not independent.

Mounting and gravity's direction are taken from the fit only where they are both known (2 degrees, one standard
deviation) and significant (chi-squared at 0.1 %) and larger than 1 degree; else they are the stated ones. All three are
our choice: a wrong turn by 1 degree of a tool of 1 kg reads 0.17 N, the noise of a wrist sensor in motion.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.conditioning.payload import (
    LARGEST_CONDITION,
    LARGEST_MASS,
    LEAST_RESIDUAL,
    LONGEST_LEVER,
    RESIDUAL_SHARE,
    excitation_advice,
    turned,
)
from skillframe.demonstration.calibration import Calibration
from skillframe.demonstration.convention import GRAVITY
from skillframe.errors import InputError
from skillframe.frames import Float, cross, norm, rotate, rotation_matrix, rotation_vector, skew

LEAST_SAMPLES = 8
KNOWN_WITHIN, LEAST_TURN = np.deg2rad(2.0), np.deg2rad(1.0)
RARE = 1e-3
FAR, LEAST_FAR = 8.0, 0.5
"""A sample is an outlier at 8 times the others' residual and 0.5 N; our choice, beyond any noise of 1e6 samples."""
MIRRORED = 0.5
"""The smallest singular value of A over its largest, from which a negative determinant says a mirrored axis."""
LEAST_MASS = 0.01  # [kg]
STANDARD = float(np.linalg.norm(GRAVITY))


@dataclass(frozen=True, slots=True, kw_only=True)
class Calibrated:
    """What free air told.

    Attributes:
        calibration: the figures to use; `spread` holds their standard deviations, None where not told.
        samples: how many.
        independent: about how many of them count, given the residual's autocorrelation.
        turned: largest angle between two directions of gravity in the tool [rad].
        mounting: in words, what was found of it.
        level: in words, what was found of gravity's direction.
        advice: what to do for what is not told, or "".
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
        parameters: bias (3), weight [N], then 3 of the mounting, then 2 of gravity, as far as they were free.
        covariance: of the parameters.
        residual: (T, 3) left over [N].
        mounting: (3, 3) sensor to tool.
        down: (3,) unit direction of gravity in base.
    """

    parameters: Float
    covariance: Float
    residual: Float
    mounting: Float
    down: Float


def calibrate(wrench: Float, rotation: Float, source: str = "calibration") -> Calibrated:
    """Calibrate from readings without contact.

    Args:
        wrench: (T, 6) as the sensor gave it, sensor axes [N, Nm].
        rotation: (T, 3, 3) tool attitude in base.
        source: the recording's name, for messages.

    Raises:
        InputError: too few samples, a tool that turned too little, mirrored axes, or contact in the readings.
    """
    if len(wrench) < LEAST_SAMPLES:
        raise InputError(source, f"holds {len(wrench)} samples", f"give {LEAST_SAMPLES} attitudes or more")
    down = GRAVITY / STANDARD
    seen = rotate(np.swapaxes(rotation, -1, -2), down)
    condition = _condition(seen)
    if condition > LARGEST_CONDITION:
        raise InputError(source, "does not tell weight from bias", excitation_advice(9.81 * seen, condition, np.inf))
    start = _mounting_guess(wrench[:, :3], seen, source)
    force, words = _chosen(wrench[:, :3], rotation, down, start)
    weight = rotate(np.swapaxes(rotation @ force.mounting, -1, -2), force.down) * force.parameters[3]
    com, bias, torque = _torque(wrench[:, 3:], weight)
    mass = float(force.parameters[3]) / STANDARD
    advice = excitation_advice(STANDARD * seen, condition, torque.condition)
    deviations = _deviations(force.covariance)
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


def _condition(seen: Float) -> float:
    """Condition number of bias and weight, for unit gravity (T, 3) in tool axes."""
    values = np.linalg.svd(
        np.concatenate([seen[:, :, None], np.broadcast_to(np.eye(3), (len(seen), 3, 3))], axis=-1).reshape(-1, 4),
        compute_uv=False,
    )
    return float(values[0] / values[-1]) if values[-1] > 0.0 else float("inf")


def _mounting_guess(force: Float, seen: Float, source: str) -> Float:
    """The mounting (3, 3) whose weight fits best, or none where the tool turned too little to tell."""
    centred = seen - seen.mean(axis=0)
    if np.linalg.svd(centred, compute_uv=False)[-1] < 1.0 / LARGEST_CONDITION * np.sqrt(len(seen)):
        return np.eye(3)
    a = np.linalg.lstsq(centred, force - force.mean(axis=0), rcond=None)[0].T
    u, s, vt = np.linalg.svd(a)
    if np.linalg.det(a) < 0.0 and s[-1] > MIRRORED * s[0]:
        raise InputError(
            source, "the weight turns as in a mirror: one of the force's axes has the wrong sign",
            "correct the order and signs of fx, fy, fz and tx, ty, tz",
        )  # fmt: skip
    rotation: Float = (u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt).T
    return rotation


class _Words(NamedTuple):
    """What was found of mounting and gravity, in words, and their standard deviations [rad]."""

    mounting: str
    level: str
    spread: dict[str, float | None]


def _chosen(force: Float, rotation: Float, down: Float, start: Float) -> tuple[_Fit, _Words]:
    """The fit with those of mounting and gravity that the data know and that matter."""
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
        use_level = False  # the two cannot be told apart: a turned sensor is commoner than a leaning base
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
        value: what they are, beyond where they started.
        deviation: largest standard deviation over all directions [rad].
    """

    value: Float
    deviation: float


def _told(fit: _Fit, which: slice) -> _Group | None:
    """Some parameters, if the data know them."""
    covariance = fit.covariance[which, which]
    if not np.all(np.isfinite(covariance)):
        return None
    deviation = float(np.sqrt(max(np.linalg.eigvalsh(covariance)[-1], 0.0)))
    if deviation > KNOWN_WITHIN:
        return None
    return _Group(fit.parameters[which], deviation)


def _matters(group: _Group, turn: Float) -> bool:
    from scipy.stats import chi2

    angle = float(norm(turn))
    return angle > LEAST_TURN and (angle / max(group.deviation, 1e-9)) ** 2 > float(chi2.isf(RARE, len(turn)))


def _said(group: _Group | None, used: bool, angle: float, stated: str) -> str:
    if group is None:
        return f"not told by these attitudes; taken as {stated}"
    deviation = f"+- {np.rad2deg(group.deviation):.2g} degrees"
    return f"turned from {stated} by {np.rad2deg(angle):.2f} {deviation}" if used else f"as {stated}, {deviation}"


def _fit(force: Float, rotation: Float, down: Float, start: Float, *, mount: bool, level: bool) -> _Fit:
    """Least squares of the force. `start` is the mounting from which a free one is turned."""
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
        good = np.linalg.cond(information) < 1e15  # beyond it an inverse holds no digit
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
    """Centre of mass (3,) and torque bias (3,) by least squares, and how well they are known.

    What the attitudes do not show of the centre of mass is left at zero, and has no spread.
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
    """Autocorrelation time of residuals (T, n) in samples, at least 1: 1 + 2 sum of rho up to its first zero.

    It is 1 where rho of neighbours is within two standard deviations, (n T)^-1/2 each, of none.
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
        (found.mass < LEAST_MASS, f"a tool of {found.mass:.3g} kg, where {LEAST_MASS:g} kg is the least"),
        (found.mass > LARGEST_MASS, f"a tool of {found.mass:.3g} kg, where {LARGEST_MASS:g} kg is the most"),
        (lever > LONGEST_LEVER, f"a centre of mass {lever:.3g} m away, where {LONGEST_LEVER:g} m is the most"),
        (left > most, f"readings that no tool explains: {left:.3g} N rms are left, where {most:.3g} N is the most"),
        (
            size[worst] > max(LEAST_FAR, FAR * others),
            f"sample {worst + 1} of {len(size)} {size[worst]:.3g} N off where the others are {others:.2g} N off",
        ),
    ]
    if wrong := [text for absurd, text in said if absurd]:
        raise InputError(
            source, f"the fit gives {wrong[0]}",
            "there is contact, or an axis, unit or attitude is wrong: leave it out, or name a stretch of free air "
            "(--from, --to)",
        )  # fmt: skip


def _rms(residual: Float) -> float:
    return float(np.sqrt(np.mean(residual**2)))


def _deviations(covariance: Float) -> list[float]:
    return [float(v) for v in np.sqrt(np.maximum(np.diag(covariance), 0.0))]


def plain(found: Calibrated) -> dict[str, Any]:
    """Plain values of what stands beside the calibration in its file."""
    return {
        "samples": found.samples, "independent_samples": found.independent, "turned_rad": found.turned,
        "mounting": found.mounting, "level": found.level, "advice": found.advice,
    }  # fmt: skip

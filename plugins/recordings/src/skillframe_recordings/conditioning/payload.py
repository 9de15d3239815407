r"""Bias and tool weight from poses without contact, by least squares.

In tool axes, with tool orientation R (tool to base) and gravity \(g_t = R^T g\), a wrench sensor in free air reads

    F = b_F + m g_t,        T = b_T + h x g_t,   h = m c                                            (1)

with the mass m beyond the sensor, its centre c and the bias b. Both are linear, in (m, b_F) and (h, b_T). Separating
them needs rotation: about one horizontal axis for m, about two for all of c. The condition number of each problem
(columns scaled to 1) measures this.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from skillframe.demonstration import GRAVITY, weight_wrench
from skillframe.errors import InputError
from skillframe.frames import Float, norm, rotate, rotate_spatial, skew

LARGEST_CONDITION = 15.0
"""Condition number above which weight and bias are not separated; gravity must turn by some 26 degrees."""
LARGEST_MASS, LONGEST_LEVER = 1000.0, 1.0
"""Largest plausible mass [kg] and distance of its centre from the tool point [m]."""
LEAST_RESIDUAL, RESIDUAL_SHARE = 1.0, 0.1
"""A fit may leave 1 N, three times the noise in motion, or a tenth of the weight, rms per axis. Robot vibration leaves
0.2 to 0.65 N; contact leaves its own force.
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Payload:
    """Load of a sensor, in tool axes.

    Attributes:
        bias: (6,) force then torque [N, Nm]; includes an unseparated weight.
        mass: [kg]; 0 if not separated from the bias.
        com: (3,) centre of mass in the tool frame [m]; 0 if undetermined.
        residual_force: rms of the remaining force, per axis [N].
        residual_torque: the same of the torque [Nm].
        condition: condition number of the force problem.
        condition_torque: condition number of the torque problem.
        turned: largest angle between two gravity directions in the tool [rad].
        advice: for better data, or "".
    """

    bias: Float
    mass: float
    com: Float
    residual_force: float
    residual_torque: float
    condition: float
    condition_torque: float
    turned: float
    advice: str

    def wrench(self, rotation: Float) -> Float:
        """Return bias and weight (..., 6) in base axes at the tool point, for orientations (..., 3, 3)."""
        return rotate_spatial(rotation, self.bias) + weight_wrench(rotation, self.mass, self.com)

    def as_meta(self) -> dict[str, Any]:
        """Return plain values for metadata and `--json`."""
        return {
            "bias": self.bias.tolist(), "mass_kg": self.mass, "com_m": self.com.tolist(),
            "residual_force_n": self.residual_force, "residual_torque_nm": self.residual_torque,
            "condition": self.condition, "condition_torque": self.condition_torque, "turned_rad": self.turned,
            "advice": self.advice,
        }  # fmt: skip


def refuse_absurd(payload: Payload, noise: float, where: str, stretch: tuple[float, float]) -> None:
    """Refuse an implausible tool.

    Args:
        payload: as identified; accepted without a mass.
        noise: typical scatter of the force, rms per axis [N].
        where: the recording's name.
        stretch: its free air [s].

    Raises:
        InputError: with the implausible figure.
    """
    if not payload.mass:
        return
    lever, left = float(norm(payload.com)), payload.residual_force
    most = max(LEAST_RESIDUAL, 3.0 * noise, RESIDUAL_SHARE * 9.81 * payload.mass)
    tool = f"a tool of {payload.mass:.3g} kg"
    absurd = [
        (
            lever > LONGEST_LEVER,
            f"{tool} with its centre of mass {lever:.3g} m away, where {LONGEST_LEVER:g} m is the most",
        ),
        (payload.mass > LARGEST_MASS, f"{tool}, where {LARGEST_MASS:g} kg is the most"),
        (left > most, f"{tool} that leaves {left:.3g} N rms unexplained, where {most:.3g} N is the most"),
    ]
    if said := [text for wrong, text in absurd if wrong]:
        raise InputError(
            where, f"from {stretch[0]:.3g} to {stretch[1]:.3g} s, taken for free air, the wrench resembles {said[0]}",
            "there is contact in that stretch, or a unit or frame is wrong: name one without contact "
            "(--free-air FROM,TO), or leave the weight (--no-weight)",
        )  # fmt: skip


class _Solution(NamedTuple):
    first: Float
    bias: Float
    residual: float
    condition: float


def gravity_in_tool(rotation: Float) -> Float:
    """Return gravity (..., 3) in tool axes [m/s^2] for orientations (..., 3, 3)."""
    return rotate(np.swapaxes(rotation, -1, -2), GRAVITY)


def identify_payload(wrench: Float, gravity: Float) -> Payload:
    """Return bias, mass and centre of mass by equation (1).

    Args:
        wrench: (T, 6) readings without contact, tool axes [N, Nm].
        gravity: (T, 3) in tool axes [m/s^2].

    Raises:
        InputError: no samples.
    """
    if len(wrench) == 0:
        raise InputError("payload", "no samples without contact", "name a stretch of free air")
    force = _solve(gravity[:, :, None], wrench[:, :3])
    torque = _solve(-skew(gravity), wrench[:, 3:])
    advice = excitation_advice(gravity, force.condition, torque.condition)
    angle = turned(gravity)
    if force.condition > LARGEST_CONDITION or force.first[0] < 1e-3:  # [kg]
        mass, com, bias = 0.0, np.zeros(3), wrench.mean(axis=0)
        residual = float(np.sqrt(np.mean((wrench[:, :3] - bias[:3]) ** 2)))
        left = wrench[:, 3:]
    else:
        mass, residual = float(force.first[0]), force.residual
        moment = torque.first if torque.condition <= LARGEST_CONDITION else _damped_moment(wrench[:, 3:], gravity)
        com, left = moment / mass, wrench[:, 3:] + np.einsum("tij,j->ti", skew(gravity), moment)
        bias = np.concatenate([force.bias, left.mean(axis=0)])
    return Payload(
        bias=bias, mass=mass, com=com, residual_force=residual,
        residual_torque=float(np.sqrt(np.mean((left - bias[3:]) ** 2))), condition=force.condition,
        condition_torque=torque.condition, turned=angle, advice=advice,
    )  # fmt: skip


def _solve(design: Float, reading: Float) -> _Solution:
    """Least squares of reading = design first + bias, with the scaled condition number."""
    count = design.shape[-1]
    columns = np.concatenate([design / 9.81, np.broadcast_to(np.eye(3), (*design.shape[:1], 3, 3))], axis=-1).reshape(
        -1, count + 3
    )
    solution, _, _, values = np.linalg.lstsq(columns, reading.ravel(), rcond=1e-12)
    residual = float(np.sqrt(np.mean((columns @ solution - reading.ravel()) ** 2)))
    condition = float(values[0] / values[-1]) if values[-1] > 0.0 else float("inf")
    return _Solution(solution[:count] / 9.81, solution[count:], residual, condition)


def _damped_moment(torque: Float, gravity: Float) -> Float:
    turned = -skew(gravity - gravity.mean(axis=0))
    u, s, vt = np.linalg.svd(turned.reshape(-1, 3), full_matrices=False)
    keep = s > s.max() / LARGEST_CONDITION if s.max() > 0.0 else np.zeros(3, dtype=bool)
    target = u.T @ (torque - torque.mean(axis=0)).ravel()
    return np.asarray(vt[keep].T @ (target[keep] / s[keep]))


def turned(gravity: Float) -> float:
    """Return the largest angle between two gravity directions [rad]."""
    direction = gravity / norm(gravity)[:, None]
    far = direction[np.argmin(direction @ direction[0])]
    return float(np.arccos(np.clip((direction @ far).min(), -1.0, 1.0)))


def excitation_advice(gravity: Float, condition: float, condition_torque: float) -> str:
    """Return advice on which axis to turn about, or "".

    Gravity that moves along d in the tool does not determine c along d; turning about d moves it across.
    """
    middle = gravity.mean(axis=0)
    spread = np.linalg.svd((gravity - middle) / 9.81, full_matrices=False)[2]
    if condition > LARGEST_CONDITION:
        axis = "xyz"[int(np.argmin(np.abs(middle)))]
        return (
            f"the tool turned gravity by only {np.rad2deg(turned(gravity)):.0f} degrees, so weight and bias cannot be "
            f"separated: turn it by 30 degrees or more about its {axis} axis, then about another horizontal one, in "
            "free air"
        )
    if condition_torque > LARGEST_CONDITION:
        axis = "xyz"[int(np.argmax(np.abs(spread[0])))]
        return (
            f"the centre of mass along the tool's {axis} axis cannot be separated from the torque bias: turn the "
            f"tool by 30 degrees or more about its {axis} axis as well, in free air"
        )
    return ""

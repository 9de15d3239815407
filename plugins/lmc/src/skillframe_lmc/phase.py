"""The phase of an LMC skill document as checked records."""

from __future__ import annotations

from dataclasses import dataclass
from math import radians
from typing import Any

import numpy as np

from skillframe.config import build, coerce
from skillframe.errors import InputError
from skillframe.extend import Document
from skillframe.frames import Float, norm
from skillframe_lmc.evidence_check import check_evidence

Vector = tuple[float, float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Stop:
    """Conditions for the end of the phase, which the papers lack.

    Attributes:
        stall_s: the phase is done when, while pushing, nothing has moved for this long,
        stall_m: no coordinate of the centre of compliance by this much,
        stall_rad: and no element of the orientation matrix by this much.
        lead_force_n, lead_torque_nm: largest push; the desired pose leads by at most this over the stiffness.
        force_limit_n: a contact force above it fails the trial.
        time_limit_s: longer than this fails the trial; without a desired direction, the phase is then done.
        travel_limit_m, turn_limit_rad: farther from the start than this fails the trial.
    """

    stall_s: float = 0.5
    stall_m: float = 1e-4
    stall_rad: float = 1e-3
    lead_force_n: float = 20.0
    lead_torque_nm: float = 2.0
    force_limit_n: float = 60.0
    time_limit_s: float = 60.0
    travel_limit_m: float = 1.0
    turn_limit_rad: float = radians(90.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Part:
    """Translation or rotation of a phase.

    Attributes:
        desired_direction: (3,) unit vector, or None.
        speed: [m/s or rad/s].
        compliant_axes: (d, 3) unit vectors.
        fully_compliant: all three degrees of freedom are compliant.
        stiffness, damping: (3, 3).
        evidence: data of the decisions.
    """

    desired_direction: Float | None
    speed: float
    compliant_axes: Float
    fully_compliant: bool
    stiffness: Float
    damping: Float
    evidence: dict[str, Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class Phase:
    """Two parts, the pitch that couples them [m/rad], and the end."""

    translation: Part
    rotation: Part
    pitch: float | None
    stop: Stop


def read_phase(document: Document) -> Phase:
    """The phase of a skill document.

    Raises:
        InputError: not exactly one phase, or a key that is missing or has a wrong value.
    """
    phases = document.get("phases", [])
    if len(phases) != 1:
        fix = "learn it, or keep several phases in a skill of type policy"
        raise InputError("phases", f"an lmc skill has one phase, this has {len(phases)}", fix)
    where, values = "phases[0]", phases[0]
    stop = build(Stop, _get(values, "stop", dict[str, Any], where), f"{where}.stop")
    for name in Stop.__dataclass_fields__:
        if getattr(stop, name) <= 0.0:
            raise InputError(f"{where}.stop.{name}", "should be positive", "fix it")
    return Phase(
        translation=_part(_get(values, "translation", dict[str, Any], where), f"{where}.translation"),
        rotation=_part(_get(values, "rotation", dict[str, Any], where), f"{where}.rotation"),
        pitch=_get(values, "pitch", float | None, where),
        stop=stop,
    )


def speed(document: Document) -> float | None:
    """Speed of the push [m/s], None for a skill that only turns or holds."""
    push = read_phase(document).translation
    return None if push.desired_direction is None or push.speed == 0.0 else push.speed


def _get(values: dict[str, Any], key: str, hint: Any, where: str) -> Any:
    if key not in values:
        raise InputError(where, f"lacks the key {key!r}", "add it, or learn the skill again")
    return coerce(values[key], hint, f"{where}.{key}")


def _part(values: dict[str, Any], where: str) -> Part:
    direction = _get(values, "desired_direction", Vector | None, where)
    axes = np.array(_get(values, "compliant_axes", list[Vector], where)).reshape(-1, 3)
    speed = _get(values, "speed", float, where)
    if speed < 0.0:
        raise InputError(f"{where}.speed", "should not be negative", "turn the direction round instead")
    return Part(
        desired_direction=None if direction is None else _unit(np.array(direction), f"{where}.desired_direction"),
        speed=speed,
        compliant_axes=np.array([_unit(a, f"{where}.compliant_axes[{i}]") for i, a in enumerate(axes)]).reshape(-1, 3),
        fully_compliant=_get(values, "fully_compliant", bool, where),
        stiffness=_gain(values, "stiffness", where),
        damping=_gain(values, "damping", where),
        evidence=check_evidence(_get(values, "evidence", dict[str, Any], where), f"{where}.evidence"),
    )


def _unit(vector: Float, where: str) -> Float:
    length = float(norm(vector))
    if abs(length - 1.0) > 0.01:
        raise InputError(where, f"should be a unit vector, its length is {length:.3g}", "divide it by its length")
    return vector / length


def _gain(values: dict[str, Any], key: str, where: str) -> Float:
    matrix = np.array(_get(values, key, tuple[Vector, Vector, Vector], where))
    scale = max(float(np.abs(matrix).max()), 1.0)  # 1 N/m: rounding may leave so little of no stiffness
    if np.abs(matrix - matrix.T).max() > 1e-9 * scale or np.linalg.eigvalsh(matrix).min() < -1e-9 * scale:
        raise InputError(f"{where}.{key}", "should be symmetric and positive semi-definite", "learn the skill again")
    return matrix

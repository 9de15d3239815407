r"""What a wrist's force sensor reads without contact, kept in a file, and taken off a recorded wrench.

With the tool's attitude R (tool to base), the sensor's mounting M (sensor axes to tool axes), gravity g in base, mass m
and centre of mass c in sensor axes from the sensor's origin, and bias b, free air reads

    f = m M^T R^T g,        F = b_F + f,        T = b_T + c x f,                                        (1)

all in sensor axes. `Calibration.clean` takes both off and turns what is left into tool axes.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from skillframe.errors import InputError
from skillframe.files import write_whole
from skillframe.files.documents import read_json
from skillframe.frames import Float, cross, matrix_from_quaternion, quaternion_from_matrix, rotate, rotate_spatial

FORMAT, VERSION = "skillframe.calibration", 1
FIX = "give a file written by skillframe calibrate"
UNIT = 1e-6
"""How far a stored quaternion's norm, or gravity's, may be from what it should be."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Calibration:
    """A sensor with its tool.

    Attributes:
        bias: (6,) force then torque, sensor axes [N, Nm].
        mass: beyond the sensor [kg].
        com: (3,) its centre in sensor axes, from the sensor's origin [m].
        mounting: (3, 3) rotation from sensor axes to tool axes.
        gravity: (3,) in base [m/s^2].
        spread: standard deviations by name, and `residual_force`, `residual_torque` rms per axis; for people.
    """

    bias: Float
    mass: float
    com: Float
    mounting: Float
    gravity: Float
    spread: Mapping[str, Any] = field(default_factory=dict)

    def free_air(self, rotation: Float) -> Float:
        """Readings (..., 6) without contact, sensor axes, for tool attitudes (..., 3, 3) in base: equation (1)."""
        weight = self.mass * rotate(np.swapaxes(rotation @ self.mounting, -1, -2), self.gravity)
        reading: Float = self.bias + np.concatenate([weight, cross(self.com, weight)], axis=-1)
        return reading

    def clean(self, wrench: Float, rotation: Float) -> Float:
        """The contact's share of readings (T, 6) at tool attitudes (T, 3, 3): tool axes, at the sensor's origin."""
        return rotate_spatial(self.mounting, wrench - self.free_air(rotation))


def write_calibration(calibration: Calibration, path: Path, more: Mapping[str, Any]) -> None:
    """Write the file, whole or not at all.

    Args:
        calibration: what goes into it.
        path: where.
        more: further keys, for people.
    """
    content = {
        "format": FORMAT, "version": VERSION, "bias": calibration.bias.tolist(), "mass_kg": calibration.mass,
        "com_m": calibration.com.tolist(), "mounting_xyzw": quaternion_from_matrix(calibration.mounting).tolist(),
        "gravity_in_base": calibration.gravity.tolist(), "spread": dict(calibration.spread), **more,
    }  # fmt: skip
    text = json.dumps(content, indent=2, sort_keys=True, ensure_ascii=False, allow_nan=False) + "\n"
    write_whole(path, text.encode())


def read_calibration(path: Path) -> Calibration:
    """A calibration from its file.

    Raises:
        InputError: not such a file, or a value in it that cannot be.
    """
    content = read_json(path, FIX)
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        raise InputError(path, "is no calibration", FIX)
    if content.get("version") != VERSION:
        raise InputError(path, f"is of version {content.get('version')!r}, and {VERSION} is known", FIX)
    mounting, gravity = _numbers(path, content, "mounting_xyzw", 4), _numbers(path, content, "gravity_in_base", 3)
    mass = float(_numbers(path, {"mass_kg": [content.get("mass_kg")]}, "mass_kg", 1)[0])
    if abs(float(np.linalg.norm(mounting)) - 1.0) > UNIT:
        raise InputError(f"{path}: mounting_xyzw", "is no unit quaternion", FIX)
    if mass < 0.0:
        raise InputError(f"{path}: mass_kg", f"is {mass}", FIX)
    return Calibration(
        bias=_numbers(path, content, "bias", 6), mass=mass, com=_numbers(path, content, "com_m", 3),
        mounting=matrix_from_quaternion(mounting), gravity=gravity,
        spread=content["spread"] if isinstance(content.get("spread"), dict) else {},
    )  # fmt: skip


def _numbers(path: Path, content: Mapping[str, Any], key: str, count: int) -> Float:
    values = content.get(key)
    good = isinstance(values, list) and len(values) == count
    if not good or not all(isinstance(v, int | float) and not isinstance(v, bool) for v in values or ()):
        raise InputError(f"{path}: {key}", f"should be {count} numbers, is {values!r}", FIX)
    found = np.array(values, dtype=float)
    if not np.all(np.isfinite(found)):
        raise InputError(f"{path}: {key}", f"is not finite: {values!r}", FIX)
    return found

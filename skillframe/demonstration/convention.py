r"""Converts a file's wrench to the convention: environment on tool, at the tool point, base axes.

With the tool's orientation R (tool to base), the reference point r in tool coordinates, mass m and centre of mass c:

- `frame = "tool"`: \(F_b = R F\), \(T_b = R T\);
- `point = r`: \(T_{tool} = T_r + (R r) \times F\);
- `includes_tool_weight`: \(F - m g\), \(T - (R c) \times m g\), with \(g = (0, 0, -9.81)\) m/s^2;
- `calibration = "tool.json"`: first of all subtracts bias and weight and applies the mounting that `skillframe
  calibrate` identified, equation (1); the path is relative to the recording's folder;
- `sign = "teacher"`: the sensor measured the teacher's force on the tool, so the environment's is its opposite. This
  neglects the tool's inertia: \(m \ddot x\) must be small beside the forces (quasi-static).

A wrist's force-torque sensor has a mounting M (sensor axes to tool axes). With gravity g in base, mass m and centre of
mass c in sensor axes from the sensor's origin, and bias b, the readings without contact are

  f = m M^T R^T g,        F = b_F + f,        T = b_T + c x f,                                        (1)

all in sensor axes. `Calibration.clean` subtracts both and rotates the rest into tool axes.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from skillframe.demonstration.columns import TORQUE
from skillframe.demonstration.options import ReadOptions
from skillframe.demonstration.record import resolve_point
from skillframe.errors import InputError, UnknownName
from skillframe.files import write_whole
from skillframe.files.documents import read_json
from skillframe.frames import (
    Float,
    cross,
    matrix_from_quaternion,
    move_wrench,
    quaternion_from_matrix,
    rotate,
    rotate_spatial,
)

FORMAT, VERSION = "skillframe.calibration", 1
FIX = "give a file written by skillframe calibrate"


@dataclass(frozen=True, slots=True, kw_only=True)
class Calibration:
    """Calibration of a sensor with its tool.

    Attributes:
        bias: (6,) force then torque, sensor axes [N, Nm].
        mass: beyond the sensor [kg].
        com: (3,) its centre in sensor axes, from the sensor's origin [m].
        mounting: (3, 3) rotation from sensor axes to tool axes.
        gravity: (3,) in base [m/s^2].
        spread: standard deviations by name, and `residual_force`, `residual_torque` rms per axis; for information.
    """

    bias: Float
    mass: float
    com: Float
    mounting: Float
    gravity: Float
    spread: Mapping[str, Any] = field(default_factory=dict)

    def free_air(self, rotation: Float) -> Float:
        """Readings (..., 6) without contact, sensor axes, at tool orientations (..., 3, 3) in base: equation (1)."""
        weight = self.mass * rotate(np.swapaxes(rotation @ self.mounting, -1, -2), self.gravity)
        reading: Float = self.bias + np.concatenate([weight, cross(self.com, weight)], axis=-1)
        return reading

    def clean(self, wrench: Float, rotation: Float) -> Float:
        """Contact wrench of readings (T, 6) at tool orientations (T, 3, 3): tool axes, at the sensor's origin."""
        return rotate_spatial(self.mounting, wrench - self.free_air(rotation))


def write_calibration(calibration: Calibration, path: Path, more: Mapping[str, Any]) -> None:
    """Write a calibration file as a whole."""
    content = {
        "format": FORMAT, "version": VERSION, "bias": calibration.bias.tolist(), "mass_kg": calibration.mass,
        "com_m": calibration.com.tolist(), "mounting_xyzw": quaternion_from_matrix(calibration.mounting).tolist(),
        "gravity_in_base": calibration.gravity.tolist(), "spread": dict(calibration.spread), **more,
    }  # fmt: skip
    text = json.dumps(content, indent=2, sort_keys=True, ensure_ascii=False, allow_nan=False) + "\n"
    write_whole(path, text.encode())


def read_calibration(path: Path) -> Calibration:
    """Read a calibration file.

    Raises:
        InputError: not such a file, or a value out of range.
    """
    content = read_json(path, FIX)
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        raise InputError(path, "is no calibration", FIX)
    if content.get("version") != VERSION:
        raise InputError(path, f"is of version {content.get('version')!r}, and {VERSION} is known", FIX)
    mounting, gravity = _numbers(path, content, "mounting_xyzw", 4), _numbers(path, content, "gravity_in_base", 3)
    mass = float(_numbers(path, {"mass_kg": [content.get("mass_kg")]}, "mass_kg", 1)[0])
    if abs(float(np.linalg.norm(mounting)) - 1.0) > 1e-6:
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


GRAVITY = np.array([0.0, 0.0, -9.81])  #: (3,) in base axes [m/s2]
FRAMES, SIGNS = ("base", "tool"), ("environment", "teacher")
KEYS = ("frame", "point", "sign", "includes_tool_weight", "tool_mass", "tool_com", "calibration")
NO_TORQUE = (
    "no torque was measured, so tx, ty, tz are 0: translation can be learned; who turned the tool, and where it was "
    "touched, cannot"
)
#: convention of the wrench inside the library
STANDARD = {"frame": "base", "point": "tool", "sign": "environment", "includes_tool_weight": False}
UNMEASURED = "unmeasured"
"""Metadata key: names of wrench channels that were not measured, whose zeros have no meaning."""


def measures_torque(meta: Mapping[str, Any]) -> bool:
    """Whether any torque was measured, by the metadata `unmeasured`."""
    return not set(TORQUE) <= set(meta.get(UNMEASURED, ()))


def declared_wrench(source: str, meta: Mapping[str, Any], options: ReadOptions) -> dict[str, Any]:
    """Declarations of metadata and settings on the wrench, checked. Settings override.

    Raises:
        InputError: an unknown key, frame or sign, or a value of the wrong type.
    """
    table = meta.get("wrench", {})
    if not isinstance(table, Mapping):
        raise InputError(f"{source}: wrench", f"should be a table, is {table!r}", "write wrench.frame = ... and so on")
    declared = {**table, **options.wrench_settings}
    for key in declared:
        if key not in KEYS:
            raise InputError(f"{source}: wrench", str(UnknownName("key", str(key), KEYS)))
    for key, choices in (("frame", FRAMES), ("sign", SIGNS)):
        if declared.get(key, choices[0]) not in choices:
            raise InputError(f"{source}: wrench.{key}", str(UnknownName("value", str(declared[key]), choices)))
    if not isinstance(declared.get("includes_tool_weight", False), bool):
        raise InputError(f"{source}: wrench.includes_tool_weight", "is neither true nor false", "correct the metadata")
    return _calibrated(source, declared) if "calibration" in declared else declared


def _calibrated(source: str, declared: dict[str, Any]) -> dict[str, Any]:
    """Declarations on the wrench of a calibrated sensor, which is in the sensor's axes."""
    name, where = declared["calibration"], f"{source}: wrench.calibration"
    if not isinstance(name, str):
        raise InputError(where, f"is no file: {name!r}", "give a file written by skillframe calibrate")
    if declared.get("frame", "tool") != "tool":
        raise InputError(
            where, "is of a sensor on the tool, and the wrench is in base axes",
            "apply it to the recording as the sensor gave it, with wrench.frame = tool",
        )  # fmt: skip
    if "tool_mass" in declared:
        raise InputError(where, "holds the tool's weight, and wrench.tool_mass is given too", "give one of them")
    return {**declared, "frame": "tool", "calibration": str(Path(source).parent / name)}


def to_standard(
    wrench: Float, rotation: Float, declared: Mapping[str, Any], meta: Mapping[str, Any], source: str
) -> tuple[Float, dict[str, Any], list[str]]:
    """A wrench in the contract's convention, its new metadata, and notes.

    Args:
        wrench: (T, 6) as recorded.
        rotation: (T, 3, 3) tool orientation in base.
        declared: from `declared_wrench`.
        meta: metadata, for `frames`.
        source: for messages.
    """
    notes: list[str] = []
    said: dict[str, Any] = {**declared, **{k: v for k, v in STANDARD.items() if k in declared}}
    calibration = said.pop("calibration", None)
    if calibration is not None:
        wrench = read_calibration(Path(calibration)).clean(wrench, rotation)
        said["includes_tool_weight"] = False
        notes.append(f"bias and weight were taken off as {Path(calibration).name} says")
    if declared.get("frame") == "tool":
        wrench = rotate_spatial(rotation, wrench)
    value = declared.get("point")
    if isinstance(value, list | tuple):
        value = ",".join(str(v) for v in value)
    if value is not None and not isinstance(value, str):
        raise InputError(
            f"{source}: wrench.point", f"is no point: {value!r}", 'give "tool", "x,y,z" or a frame\'s name'
        )
    point = resolve_point(value, dict(meta.get("frames", {})), f"{source}: wrench.point")
    if np.any(point):
        wrench = move_wrench(wrench, -rotate(rotation, point))
    if declared.get("includes_tool_weight") and calibration is None:
        if "tool_mass" in declared:
            try:
                mass = float(declared["tool_mass"])
                com = np.array(declared.get("tool_com", (0.0, 0.0, 0.0)), dtype=float)
            except (TypeError, ValueError):
                mass, com = -1.0, np.zeros(0)
            if not 0.0 <= mass < np.inf or com.shape != (3,) or not np.all(np.isfinite(com)):
                raise InputError(
                    f"{source}: wrench", "tool_mass or tool_com is no mass or point", "give kg, and [x, y, z] in metres"
                )
            wrench = wrench - weight_wrench(rotation, mass, com)
        else:
            said["includes_tool_weight"] = True
            notes.append("the tool's weight is still in the wrench; `skillframe filter` identifies and removes it")
    if not measures_torque(meta):  # unmeasured at every point: moving the force must not create torque
        wrench = np.concatenate([wrench[:, :3], np.zeros((len(wrench), 3))], axis=1)
        notes.append(NO_TORQUE)
    if declared.get("sign") == "teacher":
        wrench = -wrench
        notes.append("the teacher's wrench was turned round, which neglects the tool's inertia")
    return wrench, said, notes


def weight_wrench(rotation: Float, mass: float, com: Float) -> Float:
    """Wrench (..., 6) of gravity on the tool, at the tool point in base axes.

    Args:
        rotation: (..., 3, 3) tool orientation in base.
        mass: of everything beyond the sensor [kg].
        com: (3,) centre of mass in the tool frame [m].
    """
    force = np.broadcast_to(mass * GRAVITY, (*rotation.shape[:-2], 3))
    return np.concatenate([force, cross(rotate(rotation, com), force)], axis=-1)

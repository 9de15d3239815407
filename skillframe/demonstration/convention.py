r"""The wrench as a file holds it, turned into the one convention: environment on tool, at the tool point, base axes.

With the tool's attitude R (tool to base), the reference point r in tool coordinates, mass m and centre of mass c:

- `frame = "tool"`: \(F_b = R F\), \(T_b = R T\);
- `point = r`: \(T_{tool} = T_r + (R r) \times F\);
- `includes_tool_weight`: \(F - m g\), \(T - (R c) \times m g\), with \(g = (0, 0, -9.81)\) m/s^2;
- `calibration = "tool.json"`: bias, weight and mounting as `skillframe calibrate` found them (`calibration`, equation
  (1)), before all others; the file's path starts in the recording's folder;
- `sign = "teacher"`: the sensor saw the teacher's force on the tool, so the environment's is its opposite. That is
  Newton's law for a tool without inertia: it holds while \(m \ddot x\) is small beside the forces (quasi-static).
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from skillframe.demonstration.calibration import read_calibration
from skillframe.demonstration.options import ReadOptions
from skillframe.demonstration.record import resolve_point
from skillframe.errors import InputError, UnknownName
from skillframe.frames import Float, cross, move_wrench, rotate, rotate_spatial

GRAVITY = np.array([0.0, 0.0, -9.81])
FRAMES, SIGNS = ("base", "tool"), ("environment", "teacher")
KEYS = ("frame", "point", "sign", "includes_tool_weight", "tool_mass", "tool_com", "calibration")
STANDARD = {"frame": "base", "point": "tool", "sign": "environment", "includes_tool_weight": False}


def declared_wrench(source: str, meta: Mapping[str, Any], options: ReadOptions) -> dict[str, Any]:
    """What metadata and settings say about the wrench, checked. Settings win.

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
    """What is declared of a wrench whose sensor was calibrated: it is in the sensor's axes."""
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
    """A wrench in the contract's convention, what the metadata then says of it, and notes.

    Args:
        wrench: (T, 6) as recorded.
        rotation: (T, 3, 3) tool attitude in base.
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
    point = _point(source, declared.get("point"), meta)
    if np.any(point):
        wrench = move_wrench(wrench, -rotate(rotation, point))
    if declared.get("includes_tool_weight") and calibration is None:
        if "tool_mass" in declared:
            wrench = wrench - weight_wrench(rotation, *_payload(source, declared))
        else:
            said["includes_tool_weight"] = True
            notes.append("the tool's weight is still in the wrench; `skillframe condition` identifies and removes it")
    if declared.get("sign") == "teacher":
        wrench = -wrench
        notes.append("the teacher's wrench was turned round, which neglects the tool's inertia")
    return wrench, said, notes


def _payload(source: str, declared: Mapping[str, Any]) -> tuple[float, Float]:
    try:
        mass, com = float(declared["tool_mass"]), np.array(declared.get("tool_com", (0.0, 0.0, 0.0)), dtype=float)
    except (TypeError, ValueError):
        mass, com = -1.0, np.zeros(0)
    if not 0.0 <= mass < np.inf or com.shape != (3,) or not np.all(np.isfinite(com)):
        raise InputError(
            f"{source}: wrench", "tool_mass or tool_com is no mass or point", "give kg, and [x, y, z] in metres"
        )
    return mass, com


def weight_wrench(rotation: Float, mass: float, com: Float) -> Float:
    """Wrench (..., 6) that gravity exerts on the tool, at the tool point in base axes.

    Args:
        rotation: (..., 3, 3) tool attitude in base.
        mass: of everything beyond the sensor [kg].
        com: (3,) centre of mass in the tool frame [m].
    """
    force = np.broadcast_to(mass * GRAVITY, (*rotation.shape[:-2], 3))
    return np.concatenate([force, cross(rotate(rotation, com), force)], axis=-1)


def _point(source: str, value: object, meta: Mapping[str, Any]) -> Float:
    """The recorded wrench's point in tool coordinates."""
    if isinstance(value, list | tuple):
        value = ",".join(str(v) for v in value)
    if value is not None and not isinstance(value, str):
        raise InputError(
            f"{source}: wrench.point", f"is no point: {value!r}", 'give "tool", "x,y,z" or a frame\'s name'
        )
    return resolve_point(value, dict(meta.get("frames", {})), f"{source}: wrench.point")

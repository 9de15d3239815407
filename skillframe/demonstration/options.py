"""Settings for reading a file, shared by `convert`, `check` and `read_demonstration`, and its metadata.

Otherwise files must follow the contract: SI units, radians, quaternions x, y, z, w, the wrench of the environment on
the tool at the tool point in base axes.

A layout file: reading settings of a logger for many recordings (`--layout FILE`).

It is TOML with the names of the reading options: `columns`, `units`, `wrench-frame`, `from` and so on. On the command
line `--set KEY=VALUE` overrides it. `--layout auto --write-layout FILE` writes one, undecided settings as comments.

Metadata are JSON values, beside a CSV as `NAME.meta.toml`, inside an npz as JSON text.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Any, Literal

from skillframe.config import build, parse_setting, read_toml
from skillframe.errors import InputError, UnknownName

#: factor to SI by unit, for each quantity
SCALES: Mapping[str, Mapping[str, float]] = {
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0},
    "length": {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "in": 0.0254},
    "angle": {"rad": 1.0, "deg": 0.017453292519943295},
    "force": {"N": 1.0, "mN": 1e-3, "kN": 1e3, "MN": 1e6, "lbf": 4.4482216152605},
    "torque": {"Nm": 1.0, "Nmm": 1e-3, "mNm": 1e-3, "kNm": 1e3},
}


@dataclass(frozen=True, slots=True, kw_only=True)
class ReadOptions:
    """Reading settings, all optional.

    Attributes:
        columns: column names in order, "t,px,py,pz,...", or picks by header, "t=stamp,px=x,...". "_" ignores a column.
        units: units that differ from SI, in any order: "mm,deg,us,kN,Nmm".
        euler: order of roll, pitch, yaw: lower case about fixed axes ("xyz"), upper case about moving ones ("ZYX").
        rate: sample rate [Hz]; replaces the clock if there is one.
        wrench: separate file with the wrench on its own clock.
        wrench_columns: its columns, as `columns`.
        wrench_units: its units; `units` by default.
        wrench_rate: its rate; `rate` by default.
        wrench_shift: seconds added to its clock.
        clock: whose samples are kept when two files are joined; "auto" takes the faster, the pose's if they are alike.
        start: first time kept [s], on the recording's clock.
        stop: last time kept [s].
        zero_time: start the clock at 0 before `start` and `stop` are applied.
        position: constant tool point [m] for a file without one (an orientation recording).
        arm: the arm to read from a file with `ARM_` columns.
        wrench_frame: axes of the file's wrench, overriding its metadata.
        wrench_point: its reference point: "tool", "x,y,z" in the tool frame, or a frame's name.
        wrench_sign: whose wrench it is; "teacher" is negated, which neglects inertia.
        wrench_includes_tool_weight: whether it includes the tool's weight.
        calibration: file of `skillframe calibrate`, whose bias and weight are subtracted.
        pose_topic: topic of a ROS bag with the tool's pose or, with `robot`, its joint states.
        pose_frames: "BASE,TOOL", frames of a ROS bag's transforms: the tool's pose is that of the second in the first.
        wrench_topic: topic of a ROS bag with the wrench.
        robot: the robot whose joint states a ROS bag holds.
        episode: which of several recordings of a file or data set: a group's name in HDF5, a number in LeRobot's.
    """

    columns: str | None = None
    units: str | None = None
    euler: str | None = None
    rate: float | None = None
    wrench: Path | None = None
    wrench_columns: str | None = None
    wrench_units: str | None = None
    wrench_rate: float | None = None
    wrench_shift: float = 0.0
    clock: Literal["auto", "pose", "wrench"] = "auto"
    start: float | None = None
    stop: float | None = None
    zero_time: bool = False
    position: str | None = None
    arm: str | None = None
    wrench_frame: Literal["base", "tool"] | None = None
    wrench_point: str | None = None
    wrench_sign: Literal["environment", "teacher"] | None = None
    wrench_includes_tool_weight: bool | None = None
    calibration: Path | None = None
    pose_topic: str | None = None
    pose_frames: str | None = None
    wrench_topic: str | None = None
    robot: str | None = None
    episode: str | None = None

    def __post_init__(self) -> None:
        for name in ("rate", "wrench_rate"):
            value = getattr(self, name)
            if value is not None and not 0.0 < value < float("inf"):
                raise InputError(name.replace("_", "-"), f"{value} is not a rate", "give samples per second, above 0")
        for name in ("start", "stop", "wrench_shift"):
            if not math.isfinite(value := getattr(self, name) or 0.0):
                raise InputError(TYPED.get(name, "wrench-shift"), f"{value} is not a time", "give seconds")

    @property
    def wrench_settings(self) -> dict[str, Any]:
        """Settings of the wrench by metadata key."""
        keys = ("frame", "point", "sign", "includes_tool_weight")
        said = {k: v for k in keys if (v := getattr(self, f"wrench_{k}")) is not None}
        return {**said, **({"calibration": str(self.calibration.resolve())} if self.calibration else {})}


def read_options(values: Mapping[str, Any]) -> ReadOptions:
    """Settings from plain values. None means "not given".

    Raises:
        InputError: an unknown setting (with a suggestion) or a wrong value.
    """
    given = {k: str(v) if isinstance(v, Path) else v for k, v in values.items() if v is not None}
    return build(ReadOptions, given, "reading options")


def scales(text: str | None) -> dict[str, float]:
    """Factors to SI by quantity ("time", "length", "angle", "force", "torque") from a list of units.

    Raises:
        UnknownName: no such unit.
        InputError: two units of one quantity.
    """
    factors: dict[str, float] = {}
    for token in (part.strip() for part in (text or "").split(",") if part.strip()):
        name = token.partition("=")[2] or token
        quantity = next((q for q, units in SCALES.items() if name in units), None)
        if quantity is None:
            raise UnknownName("unit", name, [u for units in SCALES.values() for u in units])
        if quantity in factors:
            raise InputError(f"units={text}", f"two units of {quantity}", "give one")
        factors[quantity] = SCALES[quantity][name]
    return factors


NUMBERS = ("rate", "wrench_rate", "wrench_shift", "start", "stop")
"""Numeric settings."""
TYPED = {"start": "from", "stop": "to"}
"""Settings whose command-line name differs."""
FILES = ("wrench", "calibration")
"""Settings that are files, relative to the layout."""


def read_layout(path: Path) -> dict[str, Any]:
    """Reading settings of a layout file.

    Raises:
        InputError: no such file, no TOML, an unknown setting or a wrong value.
    """
    said = {_setting(key): value for key, value in read_toml(path).items()}
    settings = {k: str(path.parent / v) if k in FILES and isinstance(v, str) else v for k, v in said.items()}
    try:
        read_options(settings)
    except InputError as error:
        raise InputError(path, str(error)) from None
    return settings


def typed_settings(texts: Iterable[str]) -> dict[str, Any]:
    """Reading settings from the command line's KEY=VALUE, by the keys of a layout file.

    Raises:
        InputError: no KEY=VALUE, an unknown setting or a wrong value.
    """
    settings: dict[str, Any] = {}
    for text in texts:
        key, value = parse_setting(text)
        name = _setting(key)
        plain = name in (*NUMBERS, "wrench_includes_tool_weight")
        settings[name] = value if plain else text.partition("=")[2].strip()
    read_options(settings)
    return settings


def _setting(key: str) -> str:
    return {typed: setting for setting, typed in TYPED.items()}.get(key, key).replace("-", "_")


TEACHERS = ("kinesthetic", "teleoperation", "blind")


def meta_path(path: Path) -> Path:
    """Path of a text file's metadata: `demo.csv` -> `demo.meta.toml`."""
    return path.with_name(f"{path.stem}.meta.toml")


def read_meta(path: Path) -> dict[str, Any]:
    """Metadata beside a text file, empty without such a file.

    Raises:
        InputError: it is not TOML.
    """
    beside = meta_path(path)
    return json.loads(json.dumps(read_toml(beside), default=str)) if beside.exists() else {}


def nested(meta: Mapping[str, Any]) -> dict[str, Any]:
    """Metadata with dotted keys ("wrench.frame") as tables."""
    result: dict[str, Any] = {}
    for key, value in meta.items():
        head, dot, tail = key.partition(".")
        if dot:
            table = result.setdefault(head, {})
            if isinstance(table, dict):
                table[tail] = value
        elif isinstance(value, Mapping) and isinstance(result.get(key), dict):
            result[key].update(value)
        else:
            result[key] = dict(value) if isinstance(value, Mapping) else value
    return result


def check_meta(source: str, meta: Mapping[str, Any]) -> None:
    """Refuse known keys of metadata with wrong values.

    Raises:
        InputError: a wrong type or an unknown choice; names the key.
    """
    teacher = meta.get("teacher")
    if teacher is not None and not isinstance(teacher, str):  # words other than those of the contract are accepted
        raise InputError(f"{source}: teacher", str(UnknownName("value", str(teacher), TEACHERS)))
    for key, kind, words in (
        ("frames", Mapping, "a table"),
        ("sensor", Mapping, "a table"),
        ("contact", bool, "true or false"),
    ):
        if key in meta and not isinstance(meta[key], kind):
            if key == "sensor" and isinstance(meta[key], str):
                continue
            raise InputError(f"{source}: {key}", f"should be {words}, is {meta[key]!r}", "correct the metadata")
    points = {f"frames.{name}": point for name, point in (meta.get("frames") or {}).items()}
    if meta.get("hand") is not None and not isinstance(meta["hand"], str):
        points["hand"] = meta["hand"]
    for name, point in points.items():
        point_of(point, f"{source}: {name}")
    sensor = meta.get("sensor")
    for name in ("force_noise", "torque_noise"):
        value = sensor.get(name) if isinstance(sensor, Mapping) else None
        if value is not None and not (_is_number(value) and value >= 0.0):
            raise InputError(
                f"{source}: sensor.{name}", f"is no standard deviation: {value!r}", "give N or Nm, 0 or above"
            )


def point_of(point: Any, where: str) -> list[float]:
    """A point of the tool frame [m] from metadata.

    Raises:
        InputError: it is not three finite numbers.
    """
    if not (isinstance(point, list | tuple) and len(point) == 3 and all(map(_is_number, point))):
        raise InputError(where, f"is no point: {point!r}", "give [x, y, z] in metres, in the tool frame")
    return [float(x) for x in point]


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and isfinite(value)


def toml_text(meta: Mapping[str, Any]) -> str:
    """Metadata as TOML, without values that are None. Numbers are exact."""
    lines = [f"{_key(k)} = {_value(v)}" for k, v in meta.items() if v is not None and not isinstance(v, Mapping)]
    for key, value in meta.items():
        if isinstance(value, Mapping):
            inside = [f"{_key(k)} = {_value(v)}" for k, v in value.items() if v is not None]
            lines += ["", f"[{_key(key)}]", *inside]
    return "\n".join(lines).lstrip("\n") + "\n"


def _key(key: str) -> str:
    plain = key and all((c.isascii() and c.isalnum()) or c in "_-" for c in key)
    return key if plain else _string(key)


def _string(text: str) -> str:
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return _string(value)
    if isinstance(value, int | float):
        return repr(value)
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{_key(k)} = {_value(v)}" for k, v in value.items() if v is not None) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_value(v) for v in value if v is not None) + "]"
    raise InputError("metadata", f"{value!r} is not a plain value", "use text, numbers, lists and tables")

"""Metadata of a demonstration: plain JSON values, beside a CSV as `NAME.meta.toml`, inside an npz as JSON text."""

from __future__ import annotations

import json
from collections.abc import Mapping
from math import isfinite
from pathlib import Path
from typing import Any

from skillframe.config import read_toml
from skillframe.errors import InputError, UnknownName

TEACHERS = ("kinesthetic", "teleoperation", "blind")


def meta_path(path: Path) -> Path:
    """Where a text file's metadata lies: `demo.csv` -> `demo.meta.toml`."""
    return path.with_name(f"{path.stem}.meta.toml")


def read_meta(path: Path) -> dict[str, Any]:
    """Metadata beside a text file, or empty where there is none.

    Raises:
        InputError: it is there, but is not TOML.
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
    """Refuse metadata whose known keys hold what they cannot.

    Raises:
        InputError: a wrong type or an unknown choice; names the key.
    """
    if meta.get("teacher") is not None and meta["teacher"] not in (*TEACHERS, ""):
        _warn_free_choice(source, "teacher", meta["teacher"])
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
    _check_noise(source, meta.get("sensor"))


def _check_noise(source: str, sensor: object) -> None:
    """Stated noise must be numbers that a filter can be made for. 0 says that nobody knows."""
    for name in ("force_noise", "torque_noise"):
        value = sensor.get(name) if isinstance(sensor, Mapping) else None
        if value is not None and not (_is_number(value) and value >= 0.0):
            raise InputError(
                f"{source}: sensor.{name}", f"is no standard deviation: {value!r}", "give N or Nm, 0 or above"
            )


def _warn_free_choice(source: str, key: str, value: object) -> None:
    """Other values than the two the contract names are kept, as long as they are words."""
    if not isinstance(value, str):
        raise InputError(f"{source}: {key}", str(UnknownName("value", str(value), TEACHERS)))


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
    """Metadata as TOML. Values that are None are left out, since TOML has none. Numbers round-trip exactly."""
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

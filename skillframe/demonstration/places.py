"""Places: named poses of objects in base, from a recording's metadata or a TOML file, and recordings seen from them.

A table of places is `{name: {position = [x, y, z], quaternion = [x, y, z, w]}}`, metres in base; the quaternion may be
left out of a place that is not turned.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from skillframe.config import read_toml
from skillframe.demonstration.record import Demonstration
from skillframe.errors import InputError
from skillframe.frames import (
    Float,
    Pose,
    matrix_from_quaternion,
    norm,
    quaternion_from_matrix,
    rotate,
    rotate_spatial,
)

KEY = "places"
"""Of a recording's metadata, and the table of a file."""
UNTURNED = [0.0, 0.0, 0.0, 1.0]
UNIT_WITHIN = 0.01  # of a quaternion's norm, as in recordings
_FIX = "write position = [x, y, z] and quaternion = [x, y, z, w], metres in base"


def places_of(demonstration: Demonstration) -> dict[str, Pose]:
    """The places that a recording's metadata name, in base. Empty if there are none.

    Raises:
        InputError: a place that is no pose.
    """
    where = demonstration.source or "demonstration"
    return read_places(demonstration.meta.get(KEY, {}), f"{where}: {KEY}")


def load_places(path: Path) -> dict[str, Pose]:
    """The places of a TOML file, in its table `places`.

    Raises:
        InputError: missing, not TOML, without places, or a place that is no pose.
    """
    table = read_toml(path)
    if not isinstance(table.get(KEY), dict) or not table[KEY]:
        raise InputError(path, "names no places", f"write a table [{KEY}.NAME] for each: {_FIX}")
    return read_places(table[KEY], f"{path}: {KEY}")


def read_places(table: Any, where: str) -> dict[str, Pose]:
    """Poses (3,), (3, 3) out of plain values.

    Raises:
        InputError: a place that is no pose; names it.
    """
    if not isinstance(table, Mapping):
        raise InputError(where, "is not a table of poses by name", _FIX)
    return {str(name): _pose(values, f"{where}.{name}") for name, values in table.items()}


def _pose(values: Any, where: str) -> Pose:
    if not isinstance(values, Mapping) or not {"position"} <= set(values) <= {"position", "quaternion"}:
        raise InputError(where, "is no pose", _FIX)
    position = _numbers(values["position"], 3, f"{where}.position")
    quaternion = _numbers(values.get("quaternion", UNTURNED), 4, f"{where}.quaternion")
    if abs(float(norm(quaternion)) - 1.0) > UNIT_WITHIN:
        raise InputError(f"{where}.quaternion", f"has norm {float(norm(quaternion)):.3g}, not 1", "fix it: x, y, z, w")
    return Pose(position, matrix_from_quaternion(quaternion))


def _numbers(values: Any, count: int, where: str) -> Float:
    plain = isinstance(values, list | tuple) and len(values) == count
    if not plain or not all(type(x) in (int, float) and np.isfinite(x) for x in values):
        raise InputError(where, f"is not {count} numbers", _FIX)
    return np.array(values, dtype=float)


def as_plain(places: Mapping[str, Pose]) -> dict[str, dict[str, list[float]]]:
    """Plain values of places, as metadata and skill files hold them."""
    return {
        name: {"position": pose.position.tolist(), "quaternion": quaternion_from_matrix(pose.rotation).tolist()}
        for name, pose in places.items()
    }


def seen_from(demonstration: Demonstration, place: Pose) -> Demonstration:
    """The same recording in the frame of a place: poses relative to it, wrenches in its axes. It names no places.

    Args:
        demonstration: in base.
        place: (3,), (3, 3) in base.
    """
    back = place.rotation.T
    return Demonstration(
        time=demonstration.time.copy(),
        position=rotate(back, demonstration.position - place.position),
        quaternion=quaternion_from_matrix(back @ demonstration.pose.rotation),
        wrench=rotate_spatial(back, demonstration.wrench),
        meta={key: value for key, value in demonstration.meta.items() if key != KEY},
        extra=demonstration.extra,
        source=demonstration.source,
    )

"""What a trace's metadata may hold: each key of its kind, and numbers wherever something is drawn from them.

What is absent or null is not known, and a reader does without it; what is there and cannot be used is refused, because
a picture drawn from half of a damaged file would tell of a run that never was (our choice).
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from skillframe.errors import InputError

SHARES = ("peak_torque_share", "peak_speed_share", "peak_range_share")
SHARE_JOINTS = ("peak_torque_joint", "peak_speed_joint", "peak_range_joint")
"""Names of what joints used of their limits at most, and of the joints."""
LARGEST = 1e100  # beyond it squares overflow
KINDS: dict[str, type | tuple[type, ...]] = {
    **dict.fromkeys(
        ("analytic", "draws", "frames", "interface", "limits", "params", "progress", "scores", "second"), dict
    ),
    **dict.fromkeys(("actuators", "bodies", "center_of_compliance", "events", "notes", "touched"), list),
    **dict.fromkeys(("duration_s", "peak_force_n", "final_error_m", "final_error_rad"), (int, float)),
    **dict.fromkeys(("peak_force_filtered_n", "peak_force_10ms_n", "distance_to_collision_m"), (int, float)),
    **dict.fromkeys(SHARES, (int, float)),
    **dict.fromkeys(("ended_by", *SHARE_JOINTS), str),
    **dict.fromkeys(("goal_reached", "ended_itself"), bool),
}
SIZES = {"box": 3, "sphere": 1, "capsule": 1, "cylinder": 2}
"""Numbers that the size of a drawn kind needs at least; a plane needs none."""
ROWS = {"position": 3, "quaternion": 4, "rgba": 4}
"""Further numbers of a drawn geometry."""
CURE = "run it again, or take a sound copy of the file"


def check_meta(path: Path, meta: Mapping[str, Any]) -> None:
    """Refuse metadata that cannot be used.

    Args:
        path: the trace file, for messages.
        meta: as read.

    Raises:
        InputError: a key of another kind than is written, or no numbers where something is drawn from them.
    """
    for key, kind in KINDS.items():
        if meta.get(key) is not None and not isinstance(meta[key], kind):
            _refuse(path, key, meta[key])
    _check_point(path, "center_of_compliance", meta.get("center_of_compliance"))
    for name, point in (meta.get("frames") or {}).items():
        _check_point(path, f"frames.{name}", point)
    limit = (meta.get("limits") or {}).get("force_n")
    if limit is not None and not _is_number(limit, finite=False):
        _refuse(path, "limits.force_n", limit)
    for i, body in enumerate(meta.get("bodies") or []):
        geoms = body.get("geoms", []) if isinstance(body, dict) else None
        if not isinstance(geoms, list) or not all(isinstance(geom, dict) for geom in geoms):
            raise InputError(f"{path}: meta.bodies[{i}]", "is no body with its geoms", CURE)
        for j, geom in enumerate(geoms):
            _check_geom(path, f"bodies[{i}].geoms[{j}]", geom)


def _refuse(path: Path, key: str, value: object) -> None:
    raise InputError(f"{path}: meta.{key}", f"is {value!r:.60}", CURE)


def _is_number(value: object, finite: bool = True) -> bool:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return not finite or abs(value) < LARGEST


def _are_numbers(values: object, least: int, most: int | None = None) -> bool:
    return isinstance(values, list) and least <= len(values) <= (most or len(values)) and all(map(_is_number, values))


def _check_point(path: Path, key: str, value: object) -> None:
    if value is not None and not _are_numbers(value, 3, 3):
        raise InputError(f"{path}: meta.{key}", f"is no point of three finite numbers [m] but {value!r:.60}", CURE)


def _check_geom(path: Path, where: str, geom: Mapping[str, Any]) -> None:
    kind = geom.get("kind", "")
    if not isinstance(kind, str):
        _refuse(path, f"{where}.kind", kind)
    if not _are_numbers(geom.get("size") or [], SIZES.get(kind, 0)):
        _refuse(path, f"{where}.size", geom.get("size"))
    for key, count in ROWS.items():
        value = geom.get(key)
        if value is not None and not _are_numbers(value, count, count):
            _refuse(path, f"{where}.{key}", value)
    if geom.get("quaternion") is not None and not any(geom["quaternion"]):
        _refuse(path, f"{where}.quaternion", geom["quaternion"])
    if kind == "mesh":
        _check_mesh(path, where, geom.get("vertices"), geom.get("faces"))


def _check_mesh(path: Path, where: str, vertices: object, faces: object) -> None:
    if not isinstance(vertices, list) or not all(_are_numbers(vertex, 3, 3) for vertex in vertices):
        raise InputError(f"{path}: meta.{where}.vertices", "are no points of three finite numbers [m]", CURE)
    if not isinstance(faces, list) or not all(_is_face(face, len(vertices)) for face in faces):
        raise InputError(f"{path}: meta.{where}.faces", "are no triples of the vertices' numbers", CURE)


def _is_face(face: object, count: int) -> bool:
    return isinstance(face, list) and len(face) == 3 and all(type(i) is int and 0 <= i < count for i in face)

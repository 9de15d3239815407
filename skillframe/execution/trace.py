"""`Trace`: samples of one trial over time, with the scene's geometry for drawing, in one npz file.

Checks of a trace's metadata: type of each key, and numbers wherever something is drawn.

Absent or null means unknown. Unusable values are refused, because a picture of a damaged file would be misleading.

Scores are figures of a trial that plug-ins compute from its trace.
"""

from __future__ import annotations

import dataclasses
import io
import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

import numpy as np

from skillframe.config import LARGEST
from skillframe.errors import InputError, SkillframeError
from skillframe.extend.outputs import ScoreType
from skillframe.extend.registry import registry
from skillframe.files import write_whole
from skillframe.files.documents import json_member, read_arrays
from skillframe.frames import Float

FORMAT, VERSION = "skillframe.trace", 1
GIVE = "give a .npz written by skillframe run"
MACHINE = "machine_"
"""Prefix of a drive's own arrays in a file."""
COLUMNS = {
    "time": (),
    "position": (3,),
    "quaternion": (4,),
    "twist": (6,),
    "wrench": (6,),
    "wrench_true": (6,),
    "desired_position": (3,),
    "desired_quaternion": (4,),
    "command_wrench": (6,),
}
DRAWN = ("time", "position", "quaternion", "body_position", "body_quaternion")


@dataclass(frozen=True, slots=True, kw_only=True)
class Trace:
    """One trial over time.

    Attributes:
        time: (T,) [s].
        position, quaternion: (T, 3), (T, 4) measured pose of the centre of compliance in base.
        twist: (T, 6) of that point, base axes.
        wrench: (T, 6) filtered wrench of the environment on the tool at that point, base axes.
        wrench_true: (T, 6) the simulator's contact wrench at that point, base axes.
        desired_position, desired_quaternion: (T, 3), (T, 4) commanded pose.
        command_wrench: (T, 6) the controller's wrench at that point, robot on environment, base axes.
        q: (T, nq) configuration.
        body_position, body_quaternion: (T, B, 3), (T, B, 4) poses of the drawn bodies in base, x, y, z, w.
        machine: columns of a robot with k actuators. Servos: `servo_command` (T, k) [N m or rad] and `servo_` with each
            mapped output, such as `servo_force` [N m] and `servo_motor_velocity` [rad/s]. Where the contact force is
            estimated: `force_sigma` (T, m), its standard deviation along the tool's axes [N], and `force_valid` (T,).
            Plug-ins document further columns.
        meta: `robot`, `world`, `params`, `seed`, `trial`, `draws`, `success`, `failure`, `status`, `reason`,
            `duration_s`, `peak_force_n`, `peak_force_filtered_n`, `peak_force_10ms_n`, `peak_torque_share`,
            `peak_speed_share`, `ended_by`, `goal_reached`, `ended_itself`, `distance_to_collision_m`, `final_error_m`,
            `final_error_rad`, `center_of_compliance`, `skill`, `events` ([[t, text]]), `progress` (`word`, `of_m`,
            `reached_m`; null in a world without a depth), `scores` ({name: {`value`, `unit`, `summary`}}, null where
            undefined), `actuators` (joints with an actuator), `notes` (sentences on assumptions), `touched` (names of
            two bodies that collided), and `bodies`: [{`name`, `geoms`: [{`kind`, `size`, `position`, `quaternion`,
            `rgba`, `vertices`, `faces`}]}] in the order of the body arrays.
    """

    time: Float
    position: Float
    quaternion: Float
    twist: Float
    wrench: Float
    wrench_true: Float
    desired_position: Float
    desired_quaternion: Float
    command_wrench: Float
    q: Float
    body_position: Float
    body_quaternion: Float
    machine: dict[str, Float] = field(default_factory=dict)
    meta: dict[str, Any] = field(default_factory=dict)

    @property
    def estimated(self) -> bool:
        """Whether the contact force was estimated from the actuators' measurements."""
        return "force_sigma" in self.machine

    def save(self, path: Path) -> None:
        """Write the trace atomically.

        Raises:
            InputError: the file cannot be written.
        """
        arrays = {name: getattr(self, name) for name in [*COLUMNS, "q", "body_position", "body_quaternion"]}
        arrays.update({MACHINE + name: array for name, array in self.machine.items()})
        meta = json.dumps({"format": FORMAT, "version": VERSION, **self.meta}, sort_keys=True, ensure_ascii=False)
        meta = meta.encode("utf-8", "replace").decode()  # replaces lone surrogates
        buffer = io.BytesIO()
        np.savez_compressed(buffer, meta=np.array(meta), **arrays)
        write_whole(path, buffer.getvalue())

    @classmethod
    def load(cls, path: Path) -> Trace:
        """Read a trace file.

        Raises:
            InputError: missing, not a trace, or of a newer version.
        """
        arrays = read_arrays(path, "trace file", GIVE)
        meta = json_member(path, arrays, GIVE) if "meta" in arrays else None
        if meta is None:
            raise InputError(path, "is not a readable trace file, or is damaged (it holds no JSON object meta)", GIVE)
        del arrays["meta"]
        if meta.get("format") != FORMAT:
            raise InputError(path, f"has format {meta.get('format')!r}, not {FORMAT!r}", "give a trace file")
        if not isinstance(meta.get("version"), int) or meta["version"] > VERSION:
            raise InputError(path, f"is of version {meta.get('version')}, newer than {VERSION}", "update skillframe")
        machine = {name: arrays.pop(name) for name in list(arrays) if name.startswith(MACHINE)}
        wanted = {f.name for f in fields(Trace)} - {"machine", "meta"}
        if set(arrays) != wanted:
            odd = ", ".join(sorted(set(arrays) ^ wanted))
            raise InputError(path, f"lacks, or does not know, the arrays {odd}", "write the trace again")
        rows = {name: len(array) if array.ndim else 0 for name, array in arrays.items()}
        for name, shape in COLUMNS.items():
            if rows[name] != rows["time"] or arrays[name].shape[1:] != shape:
                raise InputError(path, f"array {name} has the shape {arrays[name].shape}", "write the trace again")
        for name in ("q", "body_position", "body_quaternion"):
            if rows[name] != rows["time"]:
                raise InputError(
                    path, f"array {name} has {rows[name]} rows, time {rows['time']}", "write the trace again"
                )
        _check_numbers(path, {**arrays, **machine})
        check_meta(path, meta)
        for name, array in machine.items():
            if not array.ndim or len(array) != len(arrays["time"]):
                raise InputError(path, f"array {name} has the shape {array.shape}", "write the trace again")
        return cls(**arrays, machine={name.removeprefix(MACHINE): array for name, array in machine.items()}, meta=meta)


def _check_numbers(path: Path, arrays: dict[str, Float]) -> None:
    """Check that values are numbers whose squares do not overflow, and that drawn places are finite."""
    for name, array in arrays.items():
        if array.dtype.kind not in "fiub":
            raise InputError(path, f"array {name} holds {array.dtype}, no numbers", "write the trace again")
        size = np.abs(array.astype(float))
        good = size < LARGEST if name in DRAWN else ~(size >= LARGEST)
        if not good.all():
            row = int(np.argwhere(~good)[0][0])
            raise InputError(path, f"array {name} holds a number out of all bounds in row {row}", "run it again")
    if np.any(np.diff(arrays["time"]) <= 0.0):
        raise InputError(path, "its time does not increase", "write the trace again")


SHARES = ("peak_torque_share", "peak_speed_share", "peak_range_share")  #: columns of the largest share of the limits
SHARE_JOINTS = ("peak_torque_joint", "peak_speed_joint", "peak_range_joint")
"""Names of the joints' largest shares of their limits, and of the joints."""
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
"""Least number of sizes of a drawn geometry by kind; a plane needs none."""
ROWS = {"position": 3, "quaternion": 4, "rgba": 4}
"""Further numbers of a drawn geometry."""
CURE = "run it again, or take a sound copy of the file"


def check_meta(path: Path, meta: Mapping[str, Any]) -> None:
    """Refuse unusable metadata.

    Raises:
        InputError: a key of a wrong type, or no numbers where something is drawn.
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
    if kind != "mesh":
        return
    vertices, faces = geom.get("vertices"), geom.get("faces")
    if not isinstance(vertices, list) or not all(_are_numbers(vertex, 3, 3) for vertex in vertices):
        raise InputError(f"{path}: meta.{where}.vertices", "are no points of three finite numbers [m]", CURE)
    if not isinstance(faces, list) or not all(
        isinstance(face, list) and len(face) == 3 and all(type(i) is int and 0 <= i < len(vertices) for i in face)
        for face in faces
    ):
        raise InputError(f"{path}: meta.{where}.faces", "are no triples of the vertices' numbers", CURE)


class ScoreFailed(SkillframeError):
    """A score that raised an error, or did not return a number."""


def scores_of(trace: Trace, names: Iterable[str]) -> dict[str, float]:
    """The named scores of one trial, in SI units, NaN where undefined. Their trace is read-only.

    Raises:
        UnknownName: no plug-in has a score of that name.
        ScoreFailed: a score raises, or returns no number.
    """
    shown = read_only(trace)
    return {name: score_of(registry().score(name), shown) for name in names}


def score_of(score: ScoreType, trace: Trace) -> float:
    """One score of one trial.

    Raises:
        ScoreFailed: it raises, or returns no number.
    """
    try:
        with np.errstate(all="ignore"):
            value: Any = score.compute(trace)
    except (Exception, SystemExit) as error:  # code of a plug-in
        raise ScoreFailed(
            f"score {score.name} raised {type(error).__name__}: {error}; correct its plug-in, or leave the score out"
        ) from error
    if isinstance(value, bool | np.bool_) or not isinstance(value, int | float | np.integer | np.floating):
        raise ScoreFailed(f"score {score.name} gave {value!r:.60}, not a number; correct its plug-in, or leave it out")
    if math.isinf(value):
        raise ScoreFailed(
            f"score {score.name} gave {value}; NaN says that a trial has no such figure; correct its plug-in"
        )
    return float(value)


def score_notes(values: Mapping[str, float]) -> dict[str, dict[str, Any]]:
    """Scores with unit and summary as JSON values: {"settling_time": {"value": 0.3, "unit": "s", ...}}."""
    return {name: {"value": None if math.isnan(value) else value, **about(name)} for name, value in values.items()}


def about(name: str) -> dict[str, str]:
    """Unit and summary of a score."""
    score = registry().score(name)
    return {"unit": score.unit, "summary": score.summary}


def read_only(trace: Trace) -> Trace:
    """The trace with read-only arrays."""
    arrays = {
        field.name: _locked(getattr(trace, field.name))
        for field in dataclasses.fields(Trace)
        if field.name not in ("machine", "meta")
    }
    return dataclasses.replace(trace, **arrays, machine={name: _locked(a) for name, a in trace.machine.items()})


def _locked(array: Any) -> Any:
    view = array.view()
    view.setflags(write=False)
    return view

"""The `frame` block of a skill document: the points of the tool and the axes of its numbers.

It has three points of the tool frame: the learning point, the point that the teacher held (for the work of torques),
and the centre of compliance, by default the learning point. `frames` holds the named points of the demonstrating tool.
Learners write the block with `frame_of` or `frame_at`; users of a skill read it with `read_frame`.

Here are also the checks of a document's keys, and of what demonstrations must have in common to be learned from.

Places are named poses of objects in base, from metadata or a TOML file, to which recordings can be relative. A
table of places is `{name: {position = [x, y, z], quaternion = [x, y, z, w]}}`, in metres in base; the quaternion is
optional.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from skillframe.config import read_toml
from skillframe.demonstration.faults.find import refuse_faults
from skillframe.demonstration.options import point_of
from skillframe.demonstration.record import Demonstration, resolve_point
from skillframe.errors import InputError, UnknownName
from skillframe.extend.records import Document, LearnOptions
from skillframe.frames import (
    Float,
    Pose,
    matrix_from_quaternion,
    norm,
    quaternion_from_matrix,
    rotate,
    rotate_spatial,
)


def refuse_unfit(demonstrations: Sequence[Demonstration]) -> None:
    """Refuse demonstrations of different tools, or with stalls or faults.

    Raises:
        InputError: with the file, and what is wrong with it.
    """
    if len(demonstrations) > 1:
        common_frames(demonstrations)
    for demonstration in demonstrations:
        refuse_faults(demonstration)


def common_frames(demonstrations: Sequence[Demonstration]) -> dict[str, list[float]]:
    """Named points of the tool [m], which all demonstrations must share to the micrometre.

    Raises:
        InputError: no demonstration, or two of different tools.
    """
    if not demonstrations:
        raise InputError("learn", "no demonstration given", "name at least one file")
    frames: dict[str, list[float]] = {}
    for demonstration in demonstrations:
        for name, point in demonstration.meta.get("frames", {}).items():
            values = point_of(point, f"{demonstration.source or 'demonstration'}: frames.{name}")
            if norm(np.subtract(values, frames.setdefault(name, values))) > 1e-6:
                raise InputError(
                    demonstration.source or "demonstration",
                    f"has its point {name!r} at {values}, another demonstration at {frames[name]}",
                    "learn from demonstrations of one tool",
                )
    return frames


AXES = ("base", "phase_start")
POINTS = ("work_at", "learned_at", "center_of_compliance")


@dataclass(frozen=True, slots=True, kw_only=True)
class SkillFrame:
    """A `frame` block, checked.

    Attributes:
        learned_at: (3,) learning point in the tool frame [m].
        work_at: (3,) point of the tool frame at which the work of torques was taken [m].
        center_of_compliance: (3,) point of the tool frame that the skill steers [m].
        axes: "base", or "phase_start": the tool's orientation at the start of the phase.
        points: named points (3,) of the demonstrating tool [m]; may be empty.
    """

    learned_at: Float
    work_at: Float
    center_of_compliance: Float
    axes: str
    points: Mapping[str, Float]

    @property
    def moved(self) -> Float:
        """Vector (3,) from the learning point to the centre of compliance, tool frame [m]."""
        return self.center_of_compliance - self.learned_at

    @property
    def from_start(self) -> bool:
        """Whether the axes are those of the tool at the start of the phase."""
        return self.axes == "phase_start"


def frame_of(demonstrations: Sequence[Demonstration], options: LearnOptions) -> Document:
    """The block of a skill learned from demonstrations.

    Args:
        demonstrations: of one tool, whose named points are joined. The hand is the first one's.
        options: the learning point, the hand (or the demonstration's own, or the learning point) and the axes.

    Raises:
        InputError: no demonstration, demonstrations of different tools, unknown axes, or a `hand` that is no point.
        UnknownName: a point that the demonstrations do not name.
    """
    frames = common_frames(demonstrations)
    if options.axes not in AXES:
        raise InputError("--axes", f"{options.axes!r} is neither base nor phase_start", "choose one of the two")
    learned = resolve_point(options.at, frames).tolist()
    hand = _hand(demonstrations[0], options, frames)
    return frame_at(learned, axes=options.axes, hand=hand, frames=frames)


def _hand(demonstration: Demonstration, options: LearnOptions, frames: dict[str, Any]) -> list[float] | None:
    if options.hand is not None:
        return [float(x) for x in resolve_point(options.hand, frames)]
    own, where = demonstration.meta.get("hand"), f"{demonstration.source or 'demonstration'}: hand"
    if isinstance(own, str):
        return [float(x) for x in resolve_point(own, frames, where)]
    return None if own is None else point_of(own, where)


def frame_at(
    learned_at: Sequence[float], *, axes: str, hand: Sequence[float] | None = None,
    frames: Mapping[str, Sequence[float]] | None = None,
) -> Document:  # fmt: skip
    """The block for a learning point, which is also the centre of compliance.

    Args:
        learned_at: (3,) point of the tool frame [m].
        axes: one of `AXES`.
        hand: (3,) point at which the work of torques was taken [m]; None: the learning point.
        frames: named points of the tool [m]; None: the block has no such key.
    """
    block: Document = {
        "learned_at": list(learned_at),
        "work_at": list(learned_at if hand is None else hand),
        "center_of_compliance": list(learned_at),
        "axes": axes,
    }
    return block if frames is None else {**block, "frames": {name: list(point) for name, point in frames.items()}}


def read_frame(document: Document, where: str = "") -> SkillFrame:
    """Read and check the block of a document.

    Raises:
        InputError: a missing key, an invalid point, or unknown axes; names the key.
    """
    demand(document, "frame", dict, where)
    frame = document["frame"]
    points = dict[str, Float]()
    for key in POINTS:
        demand(frame, key, list, where, "frame")
        points[key] = _array(frame[key], at(where, f"frame.{key}"))
    demand(frame, "axes", str, where, "frame")
    if frame["axes"] not in AXES:
        raise InputError(at(where, "frame.axes"), str(UnknownName("axes", frame["axes"], AXES)))
    if "frames" in frame:
        demand(frame, "frames", dict, where, "frame")
    named = {name: _array(p, at(where, f"frame.frames.{name}")) for name, p in frame.get("frames", {}).items()}
    return SkillFrame(axes=frame["axes"], points=named, **points)


def _array(point: Any, where: str) -> Float:
    if not isinstance(point, list) or len(point) != 3 or not all(type(x) in (int, float) for x in point):
        raise InputError(where, "should be a point [x, y, z] of the tool frame in metres", "mend it")
    return np.array(point, dtype=float)


def with_center(document: Document, center: Sequence[float]) -> Document:
    """A copy of the document with another centre of compliance (3,), tool frame [m]."""
    return {**document, "frame": {**document["frame"], "center_of_compliance": [float(x) for x in center]}}


_WORDS = {str: "text", int: "a whole number", dict: "an object", list: "a list"}


def at(where: str, key: str) -> str:
    """A place for messages: the file's name, if any, and the key."""
    return f"{where}: {key}" if where else key


def demand(values: Any, key: str, kind: type, where: str, inside: str = "") -> None:
    """Refuse an object that lacks a key, or has a value of another type.

    Raises:
        InputError: names the key.
    """
    name = f"{inside}.{key}" if inside else key
    if not isinstance(values, dict) or key not in values:
        raise InputError(where or "document", f"lacks the key {name!r}", "add it, or learn the skill again")
    if not isinstance(values[key], kind) or isinstance(values[key], bool):
        raise InputError(at(where, name), f"should be {_WORDS[kind]}", "mend it, or learn the skill again")


PLACES = "places"
"""Key of a recording's metadata and of a file's table."""
_FIX = "write position = [x, y, z] and quaternion = [x, y, z, w], metres in base"


def places_of(demonstration: Demonstration) -> dict[str, Pose]:
    """The places that a recording's metadata name, in base.

    Raises:
        InputError: a place that is no pose.
    """
    where = demonstration.source or "demonstration"
    return read_places(demonstration.meta.get(PLACES, {}), f"{where}: {PLACES}")


def load_places(path: Path) -> dict[str, Pose]:
    """The places of a TOML file, in its table `places`.

    Raises:
        InputError: missing, not TOML, without places, or a place that is no pose.
    """
    table = read_toml(path)
    if not isinstance(table.get(PLACES), dict) or not table[PLACES]:
        raise InputError(path, "names no places", f"write a table [{PLACES}.NAME] for each: {_FIX}")
    return read_places(table[PLACES], f"{path}: {PLACES}")


def read_places(table: Any, where: str) -> dict[str, Pose]:
    """Poses (3,), (3, 3) from plain values.

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
    quaternion = _numbers(values.get("quaternion", [0.0, 0.0, 0.0, 1.0]), 4, f"{where}.quaternion")
    if abs(float(norm(quaternion)) - 1.0) > 0.01:
        raise InputError(f"{where}.quaternion", f"has norm {float(norm(quaternion)):.3g}, not 1", "fix it: x, y, z, w")
    return Pose(position, matrix_from_quaternion(quaternion))


def _numbers(values: Any, count: int, where: str) -> Float:
    plain = isinstance(values, list | tuple) and len(values) == count
    if not plain or not all(type(x) in (int, float) and np.isfinite(x) for x in values):
        raise InputError(where, f"is not {count} numbers", _FIX)
    return np.array(values, dtype=float)


def as_plain(places: Mapping[str, Pose]) -> dict[str, dict[str, list[float]]]:
    """Plain values of places for metadata and skill files."""
    return {
        name: {"position": pose.position.tolist(), "quaternion": quaternion_from_matrix(pose.rotation).tolist()}
        for name, pose in places.items()
    }


def seen_from(demonstration: Demonstration, place: Pose) -> Demonstration:
    """The same recording in the frame of a place: poses relative to it, wrenches in its axes, without places.

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
        meta={key: value for key, value in demonstration.meta.items() if key != PLACES},
        extra=demonstration.extra,
        source=demonstration.source,
    )

"""The `frame` block of a skill document: at which points of the tool, and in which axes, its numbers hold.

Three points of the tool frame are kept apart, as in the contract of skills: where it was learned, where the hand was
(the work of torques is taken there), and the centre of compliance, which is the learning point until somebody moves it.
`frames` holds the named points of the tool that demonstrated. Every learner writes the block with `frame_of` or
`frame_at`, and everything that runs, tells or exports a skill reads it with `read_frame`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from skillframe.demonstration.metafile import point_of
from skillframe.demonstration.record import Demonstration, resolve_point
from skillframe.demonstration.together import common_frames
from skillframe.document.keys import at, demand
from skillframe.errors import InputError, UnknownName
from skillframe.extend.records import Document, LearnOptions
from skillframe.frames import Float

AXES = ("base", "phase_start")
POINTS = ("work_at", "learned_at", "center_of_compliance")


@dataclass(frozen=True, slots=True, kw_only=True)
class SkillFrame:
    """A `frame` block, checked.

    Attributes:
        learned_at: (3,) point of the tool frame where it was learned [m].
        work_at: (3,) point of the tool frame where the work of torques was taken [m].
        center_of_compliance: (3,) point of the tool frame that the skill steers [m].
        axes: "base", or "phase_start": the tool's attitude at the start of the phase.
        points: named points (3,) of the tool that demonstrated [m]; empty if the block names none.
    """

    learned_at: Float
    work_at: Float
    center_of_compliance: Float
    axes: str
    points: Mapping[str, Float]

    @property
    def moved(self) -> Float:
        """From where it was learned to the centre of compliance (3,), tool frame [m]."""
        return self.center_of_compliance - self.learned_at

    @property
    def from_start(self) -> bool:
        """Whether the axes are those of the tool at the start of the phase."""
        return self.axes == "phase_start"


def frame_of(demonstrations: Sequence[Demonstration], options: LearnOptions) -> Document:
    """The block for what is learned from demonstrations.

    Args:
        demonstrations: of one tool; a point that any of them names is known. The hand is the first one's.
        options: the learning point, the hand (else the demonstration's own, else the learning point) and the axes.

    Raises:
        InputError: no demonstration, demonstrations of different tools, unknown axes, or a `hand` that is no point.
        UnknownName: a point that the demonstrations do not know.
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
    """The block for a known point. Its centre of compliance is where it was learned.

    Args:
        learned_at: (3,) point of the tool frame [m].
        axes: one of `AXES`.
        hand: (3,) point where the work of torques was taken [m]; None: where it was learned.
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
    """The block of a document.

    Args:
        document: a skill document.
        where: its name, for messages.

    Raises:
        InputError: a key that is missing or holds no point, or unknown axes; names the key.
    """
    demand(document, "frame", dict, where)
    frame = document["frame"]
    points = {key: _point(frame, key, where) for key in POINTS}
    demand(frame, "axes", str, where, "frame")
    if frame["axes"] not in AXES:
        raise InputError(at(where, "frame.axes"), str(UnknownName("axes", frame["axes"], AXES)))
    if "frames" in frame:
        demand(frame, "frames", dict, where, "frame")
    named = {name: _array(p, at(where, f"frame.frames.{name}")) for name, p in frame.get("frames", {}).items()}
    return SkillFrame(axes=frame["axes"], points=named, **points)


def _point(frame: Document, key: str, where: str) -> Float:
    demand(frame, key, list, where, "frame")
    return _array(frame[key], at(where, f"frame.{key}"))


def _array(point: Any, where: str) -> Float:
    if not isinstance(point, list) or len(point) != 3 or not all(type(x) in (int, float) for x in point):
        raise InputError(where, "should be a point [x, y, z] of the tool frame in metres", "mend it")
    return np.array(point, dtype=float)


def with_center(document: Document, center: Sequence[float]) -> Document:
    """The document with another centre of compliance (3,), tool frame [m]. The one given stays as it is."""
    return {**document, "frame": {**document["frame"], "center_of_compliance": [float(x) for x in center]}}

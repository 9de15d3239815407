r"""What `acp`, `dmp`, `gmr` and `seds` share: the state that is learned, how it is followed, and what their files hold.

The state is the pose of the learning point relative to where the demonstrations ended,

    y = (p - p_g, log(R R_g^T))    in R^6, base axes,

so that the common goal is y = 0. Rotations count as vectors, which is exact about one axis and good as long as the
demonstrations turn less than half a turn in all. They are followed as `replay` follows its own motion: 2000 N/m and
100 Nm/rad, the wrench profile growing in over 0.5 s (our choices, the same for every baseline).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any, Literal

import numpy as np

from skillframe.config import build
from skillframe.demonstration.record import Demonstration
from skillframe.document.frame import frame_of, read_frame
from skillframe.errors import InputError
from skillframe.extend.records import Document, LearnOptions
from skillframe.frames import Float, Pose, norm, rotation_matrix, rotation_vector
from skillframe_baselines.document import Stiffness, Stop

LARGEST_TURN = 2.5  # rad from the goal's attitude; beyond it a rotation vector is a poor coordinate
LEARN_AGAIN = "learn the skill again"


@dataclass(frozen=True, slots=True, kw_only=True)
class Following:
    """How a learned motion is followed: settings of every learner here.

    Attributes:
        stiffness_translation: [N/m].
        stiffness_rotation: [Nm/rad].
        feedforward: whether the learned wrench profile is exerted as well (not for `seds`, which has none).
        blend: seconds over which the feed-forward grows, and an error of the start vanishes where the method needs it.
    """

    stiffness_translation: float = 2000.0
    stiffness_rotation: float = 100.0
    feedforward: bool = True
    blend: float = 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class Phase:
    """The one phase of a document. The fields are those of `Following`."""

    name: Literal["acp", "dmp", "gmr", "seds"]
    stiffness: Stiffness
    feedforward: bool
    blend: float
    stop: Stop

    @property
    def gains(self) -> Float:
        """Stiffness (6, 6) [N/m, Nm/rad]."""
        return np.diag(np.repeat([self.stiffness.translation, self.stiffness.rotation], 3))


def body(name: str, frame: Document, how: Following, model: Document, stop: float) -> Document:
    """A document's `frame`, `phases` and `model`, checked."""
    phase = {
        "name": name,
        "stiffness": asdict(Stiffness(translation=how.stiffness_translation, rotation=how.stiffness_rotation)),
        "feedforward": how.feedforward,
        "blend": how.blend,
        "stop": {"time": stop},
    }
    document = {"frame": frame, "phases": [phase], "model": model}
    phase_of(document, name)
    return document


def phase_of(document: Document, name: str) -> Phase:
    """The phase of a document, checked.

    Raises:
        InputError: not one phase, or a key that is missing, unknown or of no use.
    """
    phases = document["phases"]
    if len(phases) != 1:
        raise InputError("phases", f"{name} has one phase, got {len(phases)}", LEARN_AGAIN)
    phase = build(Phase, phases[0], "phases[0]")
    if phase.name != name:
        raise InputError("phases[0].name", f"is {phase.name}, expected {name}", LEARN_AGAIN)
    if min(phase.stiffness.translation, phase.stiffness.rotation, phase.blend, phase.stop.time) <= 0.0:
        raise InputError("phases[0]", "stiffness, blend and stop.time must be positive", "give values above zero")
    return phase


def array(document: Document, name: str, *shape: int | None) -> Float:
    """An array of `document["model"]`, None standing for any length above 0.

    Raises:
        InputError: it is missing or of another shape.
    """
    try:
        value = np.asarray(document["model"][name], dtype=float)
    except (KeyError, TypeError, ValueError) as error:
        problem = f"cannot be read ({type(error).__name__}: {error})"
        raise InputError(f"model.{name}", problem, LEARN_AGAIN) from None
    fits = value.ndim == len(shape) and all(n == (m or n) and n for n, m in zip(value.shape, shape, strict=True))
    if not fits or not np.all(np.isfinite(value)):
        raise InputError(f"model.{name}", f"has shape {value.shape}, or holds no finite numbers", LEARN_AGAIN)
    return value


def goal_of(document: Document) -> Pose:
    """The goal's pose, of the learning point in base."""
    turn = array(document, "goal_rotation_vector", 3)
    return Pose(array(document, "goal_position", 3), rotation_matrix(turn))


def goal_model(goal: Pose) -> Document:
    """What `goal_of` reads."""
    return {
        "goal_position": goal.position.tolist(),
        "goal_rotation_vector": rotation_vector(goal.rotation).tolist(),
    }


def point_offset(document: Document) -> Float:
    """Centre of compliance minus learning point (3,), tool frame."""
    return read_frame(document).moved


def state_of(pose: Pose, goal: Pose) -> Float:
    """States (..., 6) of poses."""
    turn = rotation_vector(pose.rotation @ goal.rotation.T)
    result: Float = np.concatenate([pose.position - goal.position, turn], axis=-1)
    return result


def pose_of(state: Float, goal: Pose) -> Pose:
    """Poses of states (..., 6)."""
    return Pose(goal.position + state[..., :3], rotation_matrix(state[..., 3:]) @ goal.rotation)


def common_goal(ends: Sequence[Pose]) -> Pose:
    """The mean of the poses that demonstrations ended in.

    Raises:
        InputError: they ended more than a right angle apart.
    """
    first = ends[0].rotation
    turns = np.stack([rotation_vector(end.rotation @ first.T) for end in ends])
    if norm(turns).max() > np.pi / 2:
        raise InputError("demonstrations", "end in attitudes more than 90 degrees apart", "give those of one task")
    return Pose(np.mean([end.position for end in ends], axis=0), rotation_matrix(turns.mean(0)) @ first)


def frame_in_base(name: str, demonstrations: Sequence[Demonstration], options: LearnOptions) -> Document:
    """The document's `frame`. None of these methods learns in other axes than those of base.

    Raises:
        InputError: no demonstration, demonstrations of different tools, or other axes.
    """
    if options.axes != "base":
        raise InputError(f"{name}: axes", f"is learned in base axes, not {options.axes!r}", "leave --axes away")
    return frame_of(demonstrations, options)


def positive(how: Following, name: str) -> None:
    """Refuse stiffness and blend that are not positive."""
    values: dict[str, Any] = asdict(how)
    for key in ("stiffness_translation", "stiffness_rotation", "blend"):
        if not values[key] > 0.0:
            raise InputError(
                f"{name} settings.{key}", f"must be positive, got {values[key]}", "give a value above zero"
            )


def following_words(phase: Phase) -> str:
    """How it is followed, for `describe`."""
    return (
        f"stiff in every direction: {phase.stiffness.translation:g} N/m, {phase.stiffness.rotation:g} Nm/rad; the goal "
        "stays where it was demonstrated, wherever the fixture is"
    )

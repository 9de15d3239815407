r"""Document, state and sampling that all baselines share.

A document has one phase, which is followed with 2000 N/m and 100 Nm/rad (free motion at demonstrated speeds within a
millimetre) and a wrench profile that grows over 0.5 s. The state is the pose of the learning point relative to the
demonstrations' end,

    y = (p - p_g, log(R R_g^T))    in R^6, base axes.

Rotation vectors are exact about one axis and good for less than half a turn.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any, Literal, TypeVar

import numpy as np

from skillframe.config import build
from skillframe.demonstration import Demonstration
from skillframe.document import frame_of, read_frame
from skillframe.errors import InputError
from skillframe.extend import Document, LearnOptions
from skillframe.frames import Float, Pose, continuous, norm, rotation_matrix, rotation_vector

RATE = 100.0  # Hz
SETTLE = 0.3  # s held after the last sample
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
class Stiffness:
    """Of translation [N/m] and rotation [Nm/rad], isotropic."""

    translation: float
    rotation: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Stop:
    """Duration [s]."""

    time: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Phase:
    """The phase of a document, with the fields of `Following`."""

    name: Literal["acp", "dmp", "gmr", "replay", "seds"]
    stiffness: Stiffness
    feedforward: bool
    blend: float
    stop: Stop

    @property
    def gains(self) -> Float:
        """Stiffness (6, 6) [N/m, Nm/rad]."""
        return np.diag(np.repeat([self.stiffness.translation, self.stiffness.rotation], 3))


AnyPhase = TypeVar("AnyPhase", bound=Phase)
Settings = TypeVar("Settings", bound=Following)


def settings_and_frame(
    name: str, kind: type[Settings], demonstrations: Sequence[Demonstration], options: LearnOptions
) -> tuple[Settings, Document]:
    """The learner's settings, and the document's `frame` in base axes.

    Raises:
        InputError: an unknown setting, stiffness or blend that are not positive, no demonstration, demonstrations of
            different tools, or other axes.
    """
    settings = build(kind, options.settings, f"{name} settings")
    if options.axes != "base":
        raise InputError(f"{name}: axes", f"is learned in base axes, not {options.axes!r}", "leave --axes away")
    frame = frame_of(demonstrations, options)
    for key in ("stiffness_translation", "stiffness_rotation", "blend"):
        if not (value := getattr(settings, key)) > 0.0:
            raise InputError(f"{name} settings.{key}", f"must be positive, got {value}", "give a value above zero")
    return settings, frame


def phase_body(name: str, how: Following, stop: float) -> Document:
    """The entry of `phases`, with the time limit [s]."""
    return {
        "name": name,
        "stiffness": asdict(Stiffness(translation=how.stiffness_translation, rotation=how.stiffness_rotation)),
        "feedforward": how.feedforward,
        "blend": how.blend,
        "stop": {"time": stop},
    }


def body(name: str, frame: Document, how: Following, model: Document, stop: float) -> Document:
    """A document's `frame`, `phases` and `model`, checked."""
    document = {"frame": frame, "phases": [phase_body(name, how, stop)], "model": model}
    phase_of(document, name)
    return document


def phase_of(document: Document, name: str) -> Phase:
    """The phase of a document that is learned from several demonstrations, checked like `one_phase`."""
    return one_phase(document, name, Phase)


def one_phase(document: Document, name: str, kind: type[AnyPhase]) -> AnyPhase:
    """The phase of a document, checked.

    Raises:
        InputError: not one phase, or a key that is missing, unknown or invalid.
    """
    phases = document["phases"]
    if len(phases) != 1:
        raise InputError("phases", f"{name} has one phase, got {len(phases)}", LEARN_AGAIN)
    phase = build(kind, phases[0], "phases[0]")
    if phase.name != name:
        raise InputError("phases[0].name", f"is {phase.name}, expected {name}", LEARN_AGAIN)
    if min(phase.stiffness.translation, phase.stiffness.rotation, phase.blend, phase.stop.time) <= 0.0:
        raise InputError("phases[0]", "stiffness, blend and stop.time must be positive", "give values above zero")
    return phase


def array(document: Document, name: str, *shape: int | None) -> Float:
    """An array of `document["model"]`, None being any length above 0.

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
    """The entries that `goal_of` reads."""
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


def resampled(demonstration: Demonstration) -> dict[str, list[Any]]:
    """Time from 0, position, quaternion and wrench of the tool point on an even grid of at most 10 ms.

    Faster recordings are averaged over a grid step.
    """
    time = demonstration.time - demonstration.time[0]
    grid = np.linspace(0.0, time[-1], int(np.ceil(time[-1] * RATE)) + 1)
    width = max(round(demonstration.rate / RATE), 1)

    def on_grid(values: Float) -> Float:
        smooth = moving_average(values, width)
        return np.stack([np.interp(grid, time, column) for column in smooth.T], axis=1)

    quaternion = on_grid(continuous(demonstration.quaternion))
    return {
        "time": grid.tolist(),
        "position": on_grid(demonstration.position).tolist(),
        "quaternion": (quaternion / norm(quaternion)[:, None]).tolist(),
        "wrench": on_grid(demonstration.wrench).tolist(),
    }


def moving_average(values: Float, width: int) -> Float:
    """Centred mean over `width` samples (made odd), fewer towards the ends, which stay in place."""
    half = np.minimum(width // 2, np.minimum(np.arange(len(values)), np.arange(len(values))[::-1]))
    total = np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(values, axis=0)])
    index = np.arange(len(values))
    result: Float = (total[index + half + 1] - total[index - half]) / (2 * half + 1)[:, None]
    return result


def example_demonstration() -> Demonstration:
    """A tool that points down and slides 40 mm along x under 5 N, in a second at 200 Hz."""
    time = np.arange(0.0, 1.0, 0.005)
    along = np.stack([0.4 + 0.04 * time, 0.0 * time, 0.2 + 0.0 * time], axis=1)
    wrench = np.zeros((len(time), 6))
    wrench[:, 2] = 5.0
    quaternion = np.tile((1.0, 0.0, 0.0, 0.0), (len(time), 1))
    meta = {"task": "slide", "frames": {"wrist": [0.0, 0.0, -0.15]}}
    return Demonstration(time=time, position=along, quaternion=quaternion, wrench=wrench, meta=meta)


def following_words(phase: Phase) -> str:
    """How it is followed, for `describe`."""
    return (
        f"stiff in every direction: {phase.stiffness.translation:g} N/m, {phase.stiffness.rotation:g} Nm/rad; the goal "
        "stays where it was demonstrated, wherever the fixture is"
    )

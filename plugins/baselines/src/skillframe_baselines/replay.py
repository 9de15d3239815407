r"""Replay: the recorded motion with stiff impedance and the recorded wrench as feed-forward.

With \(p(t), R(t)\) the recorded pose of the centre of compliance, \(p_0, R_0\) its first value, and \(p_m, R_m\) the
pose measured at the start of the run, the desired pose is

    shifted, base axes          p_m + p(t) - p_0                     R(t) R_0^T R_m
    shifted, axes of the start  p_m + R_m R_0^T (p(t) - p_0)         R_m R_0^T R(t)
    absolute                    p(t) + (1 - s(t)) (p_m - p_0)        exp((1 - s(t)) log(R_m R_0^T)) R(t)

where \(s\) rises smoothly from 0 to 1 over the blending time. Published work compares compliant skills with replay.
The document holds the tool point's trajectory and wrench at 100 Hz.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np

from skillframe.config import build as configured
from skillframe.demonstration import Demonstration
from skillframe.document import frame_of, read_frame
from skillframe.errors import InputError
from skillframe.extend import Document, LearnOptions
from skillframe.frames import (
    Float,
    Pose,
    matrix_from_quaternion,
    move_wrench,
    norm,
    rotate,
    rotate_spatial,
    rotation_matrix,
    rotation_vector,
)
from skillframe.skill import Command, Impedance, Observation, Skill, Status, no_reasons
from skillframe_baselines.common import (
    SETTLE,
    Following,
    Phase,
    example_demonstration,
    one_phase,
    phase_body,
    resampled,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class ReplaySettings(Following):
    """How a recorded motion is played.

    Attributes:
        mode: "shifted": the recorded displacement from the tool's start; "absolute": the recorded poses, with the error
            of the start blended away.
    """

    mode: Literal["shifted", "absolute"] = "shifted"


@dataclass(frozen=True, slots=True, kw_only=True)
class ReplayPhase(Phase):
    """The phase of a replay's document, with the fields of `ReplaySettings`."""

    mode: Literal["shifted", "absolute"]


def phase_of(document: Document) -> ReplayPhase:
    """The phase of a replay's document, checked.

    Raises:
        InputError: not one phase, or a key that is missing, unknown or invalid.
    """
    return one_phase(document, "replay", ReplayPhase)


def learn(demonstrations: Sequence[Demonstration], options: LearnOptions) -> Document:
    """Body of a replay's document.

    Raises:
        InputError: not exactly one demonstration, an unknown setting, or a stiffness or blend that is not positive.
    """
    if len(demonstrations) != 1:
        raise InputError("replay", f"repeats one demonstration, got {len(demonstrations)}", "give one file")
    settings = configured(ReplaySettings, options.settings, "replay settings")
    trajectory = resampled(demonstrations[0])
    phase = {**phase_body("replay", settings, trajectory["time"][-1] + SETTLE), "mode": settings.mode}
    body = {"frame": frame_of(demonstrations, options), "phases": [phase], "trajectory": trajectory}
    phase_of(body)
    return body


class Motion(NamedTuple):
    """Samples of the recorded motion of a point on an even grid, base axes.

    Attributes:
        step: seconds between samples.
        position, rotation: (T, 3), (T, 3, 3).
        twist: (T, 6) constant over the step that follows a sample, zero after the last one.
        wrench: (T, 6) of the environment on the tool.
    """

    step: float
    position: Float
    rotation: Float
    twist: Float
    wrench: Float

    @property
    def duration(self) -> float:
        """Seconds from the first to the last sample."""
        return self.step * (len(self.position) - 1)

    def at(self, time: Float) -> tuple[Pose, Float, Float]:
        """Pose, twist and wrench at times (N,) since the first sample, held beyond the last."""
        last = len(self.position) - 1
        scaled = np.clip(time / self.step, 0.0, last)
        index = np.minimum(scaled.astype(int), last)
        after = (scaled - index)[:, None]
        twist, following = self.twist[index], np.minimum(index + 1, last)
        position = self.position[index] + after * self.step * twist[:, :3]
        rotation = rotation_matrix(after * self.step * twist[:, 3:]) @ self.rotation[index]
        wrench = self.wrench[index] + after * (self.wrench[following] - self.wrench[index])
        return Pose(position, rotation), twist, wrench


def motion(trajectory: Mapping[str, Any], point: Float) -> Motion:
    """Recorded motion of a point of the tool frame, from a document's trajectory.

    Raises:
        InputError: a column is missing, or its rows do not fit.
    """
    try:
        time, position, quaternion, wrench = (
            np.asarray(trajectory[name], dtype=float) for name in ("time", "position", "quaternion", "wrench")
        )
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(
            "trajectory", f"cannot be read ({type(error).__name__}: {error})", "learn the skill again"
        ) from None
    n = len(time)
    if n < 2 or (position.shape, quaternion.shape, wrench.shape) != ((n, 3), (n, 4), (n, 6)):
        raise InputError("trajectory", "its columns do not fit each other", "learn the skill again")
    if float(time[-1]) <= 0.0 or np.any(norm(quaternion) == 0.0):
        raise InputError("trajectory", "holds no motion over time", "learn the skill again")
    tool = Pose(position, matrix_from_quaternion(quaternion))
    pose, step = tool.at(point), float(time[-1]) / (n - 1)
    turn = rotation_vector(pose.rotation[1:] @ np.swapaxes(pose.rotation[:-1], -1, -2))
    twist = np.zeros((n, 6))
    twist[:-1] = np.concatenate([np.diff(pose.position, axis=0), turn], axis=1) / step
    return Motion(step, pose.position, pose.rotation, twist, move_wrench(wrench, pose.position - tool.position))


class Replay(Skill):
    """Recorded motion of the centre of compliance, shifted to the start or in place.

    Args:
        recorded: motion of the centre of compliance.
        absolute: play recorded poses, else the displacement.
        turned: the displacement is in the tool's orientation at the start, else in base axes.
        stiffness: (6, 6) [N/m, Nm/rad].
        feedforward: exert the recorded wrench.
        blend: seconds over which the start's error vanishes and the feed-forward grows.
        stop: duration [s].
    """

    def __init__(
        self, recorded: Motion, *, absolute: bool, turned: bool, stiffness: Float, feedforward: bool, blend: float,
        stop: float,
    ) -> None:  # fmt: skip
        self._recorded, self._absolute, self._turned = recorded, absolute, turned
        self._impedance, self._gain = Impedance(stiffness), float(feedforward)
        self._blend, self._stop = blend, stop

    def start(self, observation: Observation, rngs: Sequence[np.random.Generator]) -> None:
        """Store the tool's pose against the recording's start."""
        first = Pose(self._recorded.position[0], self._recorded.rotation[0])
        self._began = observation.time.copy()
        self._home = Pose(observation.pose.position.copy(), observation.pose.rotation.copy())
        self._gap = self._home.position - first.position
        self._turn = self._home.rotation @ first.rotation.T
        self._turn_vector = rotation_vector(self._turn)

    def step(self, observation: Observation) -> Command:
        """Desired motion at this time."""
        time = observation.time - self._began
        pose, twist, wrench = self._recorded.at(time)
        place = self._in_place if self._absolute else self._shifted
        pose, twist, wrench = place(time, pose, twist, wrench)
        grown, _ = self._rise(time)
        done = time >= self._stop
        reason = no_reasons(len(time))
        reason[done] = "the recorded motion is over"
        status = np.where(done, Status.SUCCESS, Status.RUNNING).astype(np.int64)
        return Command(pose, twist, self._impedance, -self._gain * grown * wrench, status, reason)

    def _rise(self, time: Float) -> tuple[Float, Float]:
        """Smooth step 3u^2 - 2u^3 over the blending time and its rate, (N, 1) each."""
        u = np.clip(time / self._blend, 0.0, 1.0)[:, None]
        return u * u * (3.0 - 2.0 * u), 6.0 * u * (1.0 - u) / self._blend

    def _in_place(self, time: Float, pose: Pose, twist: Float, wrench: Float) -> tuple[Pose, Float, Float]:
        risen, rate = self._rise(time)
        left = 1.0 - risen
        correction = rotation_matrix(left * self._turn_vector)
        position = pose.position + left * self._gap
        velocity = twist[:, :3] - rate * self._gap
        turning = rotate(correction, twist[:, 3:]) - rate * self._turn_vector
        return Pose(position, correction @ pose.rotation), np.concatenate([velocity, turning], axis=1), wrench

    def _shifted(self, time: Float, pose: Pose, twist: Float, wrench: Float) -> tuple[Pose, Float, Float]:
        moved = pose.position - self._recorded.position[0]
        if self._turned:
            shifted = Pose(self._home.position + rotate(self._turn, moved), self._turn @ pose.rotation)
            return shifted, rotate_spatial(self._turn, twist), rotate_spatial(self._turn, wrench)
        rotation = pose.rotation @ self._recorded.rotation[0].T @ self._home.rotation
        return Pose(self._home.position + moved, rotation), twist, wrench


def build(document: Document) -> Skill:
    """A runnable replay from its document.

    Raises:
        InputError: the document holds no usable trajectory or phase.
    """
    phase, frame = phase_of(document), read_frame(document)
    return Replay(
        motion(document.get("trajectory", {}), frame.center_of_compliance),
        absolute=phase.mode == "absolute",
        turned=frame.from_start,
        stiffness=np.diag(np.repeat([phase.stiffness.translation, phase.stiffness.rotation], 3)),
        feedforward=phase.feedforward,
        blend=phase.blend,
        stop=phase.stop.time,
    )


def describe(document: Document) -> list[str]:
    """The lines of its description."""
    phase, trajectory = phase_of(document), document["trajectory"]
    path = np.asarray(trajectory["position"])
    length, (x, y, z) = norm(np.diff(path, axis=0)).sum(), 1e3 * (path[-1] - path[0])
    how = {
        "shifted": "from wherever the tool is at the start, knowing nothing of the fixture",
        "absolute": "at the recorded place; the error of the start is blended away",
    }[phase.mode]
    lines = [
        f"replay {trajectory['time'][-1]:.2f} s of recorded motion, {how}",
        f"path {1e3 * length:.0f} mm, ending at {x:+.0f}, {y:+.0f}, {z:+.0f} mm from its start",
        f"stiff in every direction: {phase.stiffness.translation:g} N/m, {phase.stiffness.rotation:g} Nm/rad",
    ]
    return [*lines, "exert the recorded wrench as well"] if phase.feedforward else lines


def example() -> Document:
    """A replay of the example demonstration."""

    from skillframe.document import learned
    from skillframe.extend import registry

    return learned(registry().skill("replay"), [example_demonstration()])

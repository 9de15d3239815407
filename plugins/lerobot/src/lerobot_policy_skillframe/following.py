r"""A skill at the rate of a policy, with actions of skillframe's Gymnasium environments.

An action moves the target of the environment's own impedance from the observed pose. It pushes as the skill does if, at
the observed point,

    D = K_env^-1 (K e + F_ff)                                                               (1)

where e is the way from the observed to the desired pose [m, rad] and D the action's. Between actions the environment's
stiffness holds, also where the skill is compliant. A push beyond the reach is shortened. With `variable_stiffness`
K_env is the diagonal of K within the environment's bounds. D_s v_d is left out, as an environment has no damping of a
moving target.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from skillframe_gym.settings import SOFTEST, STIFFEST, EnvSettings

from skillframe.demonstration import resolve_point
from skillframe.document import load, read_frame, understood, with_center
from skillframe.errors import InputError
from skillframe.extend import CoordinatorType, Document, registry
from skillframe.frames import Float, Pose, matrix_from_quaternion, move_wrench, rotate, rotation_vector, skew
from skillframe.skill import Command, Observation, Skill, Status

STATE, WRENCH = 7, 6
"""Sizes of the observation: position and quaternion x, y, z, w of a point of the tool in base, and its wrench."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Points:
    """Points of the tool frame, as names of the skill file or "x,y,z" [m].

    Attributes:
        observed: point of state, wrench and the environment's control.
        compliant: centre of compliance; None as learned.
    """

    observed: str = "tip"
    compliant: str | None = None


class Following:
    """A skill that maps states and wrenches to actions, for N trials.

    Args:
        document: a skill file's, checked.
        settings: rate, reaches and stiffness of the environment.
        points: of the tool.
        seed: of random skills, which sample anew at every reset.

    Attributes:
        status: (N,) `Status` of each trial; empty before the first action.
        reason: (N,) why a trial's skill ended.

    Raises:
        InputError, UnknownName: a skill for several arms, one that cannot be built, or an unknown point.
    """

    def __init__(self, document: Document, settings: EnvSettings, points: Points, seed: int = 0) -> None:
        self._kind = registry().behaviour(document["type"])
        if isinstance(self._kind, CoordinatorType):
            raise InputError(self._kind.name, "moves several arms", "give the skill of one arm")
        frame = read_frame(document)
        observed = resolve_point(points.observed, frame.points)
        named = points.compliant
        center = frame.center_of_compliance if named is None else resolve_point(named, frame.points)
        self._shift, self.settings = center - observed, settings
        self._document, self._rng = with_center(document, center.tolist()), np.random.default_rng(seed)
        self._build()  # refuse a skill that cannot be built now
        self.reset()

    def _build(self) -> Skill:
        assert not isinstance(self._kind, CoordinatorType)
        with understood(f"the {self._kind.name} skill"):
            return self._kind.build(self._document)

    def reset(self) -> None:
        """Forget the trials, so that the next observation begins new ones."""
        self._skill: Skill | None = None
        self.status, self.reason = np.zeros(0, np.int64), np.zeros(0, dtype=object)

    def act(self, state: Float, wrench: Float) -> Float:
        """Actions (N, 6 or 12) for an observation, one environment step after the last.

        Args:
            state: (N, 7) position [m] and quaternion x, y, z, w of the observed point in base.
            wrench: (N, 6) of the environment on the tool at that point, base axes [N, Nm].

        Raises:
            InputError: a wrong size, values that are not finite, or another number of trials than at the first step.
        """
        observation = self._observation(state, wrench)
        if self._skill is None:
            self._skill = self._build()
            self._skill.start(observation, self._rng.spawn(len(state)))
            self.status, self.reason = np.zeros(len(state), np.int64), np.full(len(state), "", dtype=object)
        command = self._skill.step(observation)
        running = self.status == Status.RUNNING
        self.status = np.where(running, command.status, self.status)
        self.reason = np.where(running, command.reason, self.reason)
        push, stiffness = self._push(observation, command)
        push[self.status != Status.RUNNING] = 0.0
        return self._actions(push, stiffness)

    def _observation(self, state: Float, wrench: Float) -> Observation:
        for name, values, size in (("state", state, STATE), ("wrench", wrench, WRENCH)):
            if values.ndim != 2 or values.shape[1] != size or not np.all(np.isfinite(values)):
                text = f"should be (N, {size}) finite numbers, and has shape {values.shape} or a number that is none"
                raise InputError(f"observation.{name}", text, "give it as skillframe's data sets have it")
        first, dt = self._skill is None, 1.0 / self.settings.rate_hz
        rotation = matrix_from_quaternion(state[:, 3:])
        self._arm = rotate(rotation, np.broadcast_to(self._shift, (len(state), 3)))
        pose = Pose(state[:, :3] + self._arm, rotation)
        if first:
            self._steps, self._last = 0, pose
        if len(state) != len(self._last.position) or len(state) != len(wrench):
            text = f"is of {len(state)} trials, and the episode began with {len(self._last.position)}"
            raise InputError("observation.state", text, "call reset() where another episode begins")
        turned = rotation_vector(rotation @ np.swapaxes(self._last.rotation, -1, -2))
        twist = np.concatenate([pose.position - self._last.position, turned], axis=1) / dt
        time = np.full(len(state), self._steps * dt)
        self._steps, self._last = self._steps + 1, pose
        return Observation(time, dt, pose, twist, move_wrench(wrench, self._arm))

    def _push(self, observation: Observation, command: Command) -> tuple[Float, Float]:
        """Wrench (N, 6) of the skill and its stiffness (N, 6, 6), at the observed point, base axes."""
        position, rotation = command.pose
        turned = rotation_vector(rotation @ np.swapaxes(observation.pose.rotation, -1, -2))
        error = np.concatenate([position - observation.pose.position, turned], axis=1)
        stiffness = np.broadcast_to(command.impedance.stiffness, (len(error), 6, 6))
        push = (stiffness @ error[:, :, None])[:, :, 0] + command.feedforward
        jacobian = np.broadcast_to(np.eye(6), stiffness.shape).copy()
        jacobian[:, :3, 3:] = -skew(self._arm)  # a small motion of the observed point as one of the centre
        return move_wrench(push, -self._arm), np.swapaxes(jacobian, -1, -2) @ stiffness @ jacobian

    def _actions(self, push: Float, stiffness: Float) -> Float:
        """Equation (1), in units of the reaches."""
        settings, chosen = self.settings, np.zeros((len(push), 0))
        diagonal = np.broadcast_to(np.repeat(settings.stiffness, 3), push.shape)
        if settings.variable_stiffness:
            diagonal = np.clip(np.diagonal(stiffness, axis1=1, axis2=2), SOFTEST, STIFFEST)
            chosen = 2.0 * np.log(diagonal / SOFTEST) / np.log(STIFFEST / SOFTEST) - 1.0
        ways = push / diagonal / np.repeat([settings.reach_m, settings.reach_rad], 3)
        halves = ways.reshape(-1, 2, 3)
        halves = halves / np.maximum(1.0, np.abs(halves).max(axis=2, keepdims=True))
        actions: Float = np.concatenate([halves.reshape(-1, 6), chosen], axis=1)
        return actions


def read_skill(path: str | Path) -> Document:
    """A skill file, read and checked.

    Raises:
        InputError, UnknownName: as `skillframe.document.file.load`.
    """
    if not str(path):
        raise InputError("policy.skill", "is empty", "give the path of a skill file, or load a saved policy")
    return load(Path(path))

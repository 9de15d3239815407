"""A cheap closed loop to run a skill in: tools that follow what is commanded, above a soft floor.

It is no simulation of a robot: a tool goes to the commanded pose with a lag, and feels a floor that it can press into.
That is enough to bring a skill through its phases at a thousand ticks in less than a second.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from skillframe.errors import SkillframeError
from skillframe.frames import Pose, rotation_matrix, rotation_vector
from skillframe.handover import asked, check_shapes, shown
from skillframe.skill import Command, Observation, Skill

LAG = 0.02  # s: a compliant arm's
FLOOR_DEPTH, FLOOR_STIFFNESS = 0.03, 1000.0  # m below the start, N/m
HEIGHT = 0.3  # m in base


class Follower:
    """Tools (N, ...) that follow a command with a lag of 20 ms and press into a floor 30 mm below their start.

    Args:
        lead: (N,), or (N, arms).
        dt: seconds between two ticks.
    """

    def __init__(self, lead: tuple[int, ...], dt: float) -> None:
        self._lead, self._dt, self.tick = lead, dt, 0
        start = np.linspace(0.4, 0.5, int(np.prod(lead))).reshape(*lead, 1) * [1.0, 0.0, 0.0] + [0.0, 0.0, HEIGHT]
        down = np.broadcast_to(np.diag([1.0, -1.0, -1.0]), (*lead, 3, 3))
        self.pose, self.twist = Pose(start, down.copy()), np.zeros((*lead, 6))

    def observation(self) -> Observation:
        """What the skill sees at this tick. It cannot write to it."""
        wrench = np.zeros((*self._lead, 6))
        wrench[..., 2] = FLOOR_STIFFNESS * np.maximum(HEIGHT - FLOOR_DEPTH - self.pose.position[..., 2], 0.0)
        time = np.full(self._lead, self.tick * self._dt)
        return shown(Observation(time, self._dt, self.pose, self.twist, wrench))

    def follow(self, command: Command) -> None:
        """Go to what is commanded, as far as a tick brings it."""
        share = 1.0 - np.exp(-self._dt / LAG)
        step = share * (command.pose.position - self.pose.position)
        turn = share * rotation_vector(command.pose.rotation @ np.swapaxes(self.pose.rotation, -1, -2))
        self.pose = Pose(self.pose.position + step, rotation_matrix(turn) @ self.pose.rotation)
        self.twist = np.concatenate([step, turn], axis=-1) / self._dt
        self.tick += 1


Look = Callable[[int, Observation, Command], bool]
"""Told each tick, observation and command; True ends the run."""


def run(skill: Skill, lead: tuple[int, ...], ticks: int, dt: float, look: Look) -> None:
    """Run a skill in the cheap loop and show each command to `look`.

    Raises:
        SkillframeError: it writes into its observation, or its command is not one of the batch.
        LateError: the skill raised; says in which tick.
    """
    follower = Follower(lead, dt)
    observation = follower.observation()
    rngs = [np.random.default_rng([7, i]) for i in range(lead[0])]
    with np.errstate(invalid="ignore", over="ignore"):  # as in the loop: what diverges is the limits' business
        asked(skill, skill.start, observation, rngs)
        for tick in range(ticks):
            command = stepped(skill, observation, tick)
            check_shapes(skill, command, lead)
            if look(tick, observation, command):
                return
            follower.follow(command)
            observation = follower.observation()


class LateError(Exception):
    """A skill raised in the middle of a run."""


def stepped(skill: Skill, observation: Observation, tick: int) -> Command:
    """A step's answer.

    Raises:
        LateError: the skill raised; says in which tick and what.
    """
    try:
        return asked(skill, skill.step, observation)
    except Exception as error:  # foreign code: any failure is a finding
        when = f"in tick {tick}, at {float(observation.time.flat[0]):.3f} s"
        what = f"step raised {type(error).__name__} {when}: {error}"
        raise LateError(
            what if isinstance(error, SkillframeError) else f"{what}; catch it and end with FAILURE"
        ) from error

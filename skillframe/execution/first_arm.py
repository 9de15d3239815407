"""A skill for one arm as the coordinator of several: the first runs it, the others stand still."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from skillframe.frames import Float, Pose
from skillframe.handover import ShapeCheck
from skillframe.skill import Command, Impedance, Observation, Skill

STILL = Impedance(np.diag([2000.0] * 3 + [100.0] * 3), np.diag([180.0] * 3 + [8.0] * 3))
"""How an arm without a task holds its tool; ours: stiff, about critically damped."""


class FirstArm(Skill):
    """A coordinator that runs a skill for one arm on the first, while the others hold their tools where they are."""

    def __init__(self, skill: Skill) -> None:
        self._skill = skill

    def start(self, observation: Observation, rngs: Sequence[np.random.Generator]) -> None:
        """Remember where the tools are, and start the skill."""
        self._home = Pose(observation.pose.position.copy(), observation.pose.rotation.copy())
        count, arms = observation.time.shape
        self._rest = np.zeros((count, arms, 6))
        self._gains = [np.array(np.broadcast_to(gain, (count, arms, 6, 6))) for gain in STILL if gain is not None]
        self._checked = ShapeCheck(self._skill, (count,))
        self._skill.start(_first(observation), rngs)

    def step(self, observation: Observation) -> Command:
        """The skill's command for the first arm, standing still for the others."""
        wanted = self._checked(self._skill.step(_first(observation)))
        stiffness, damping = self._gains
        stiffness[:, 0] = wanted.impedance.stiffness
        if wanted.impedance.damping is not None:
            damping[:, 0] = wanted.impedance.damping
        position = _replaced(self._home.position, wanted.pose.position)
        return Command(
            Pose(position, _replaced(self._home.rotation, wanted.pose.rotation)),
            _replaced(self._rest, wanted.twist),
            Impedance(stiffness, None if wanted.impedance.damping is None else damping),
            _replaced(self._rest, wanted.feedforward),
            wanted.status,
            wanted.reason,
        )


def _first(observation: Observation) -> Observation:
    """What the first arm sees, (N, ...)."""
    pose = Pose(observation.pose.position[:, 0], observation.pose.rotation[:, 0])
    return Observation(observation.time[:, 0], observation.dt, pose, observation.twist[:, 0], observation.wrench[:, 0])


def _replaced(arms: Float, first: Float) -> Float:
    """(N, arms, ...) with the first arm's part replaced."""
    result = arms.copy()
    result[:, 0] = first
    return result

"""Skill that moves along straight lines through poses in free air.

Orientation turns evenly along each line, whose duration follows from the speed or from its angle at 1 rad/s. On the
last line more than 4 N end the motion with success, since the next part works in contact; more than 30 N elsewhere is a
failure, but not within 5 mm of the start.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Pose, norm, rotation_matrix, rotation_vector
from skillframe.skill import Command, Impedance, Observation, Skill, Status, no_reasons

STIFF = np.diag([1000.0] * 3 + [20.0] * 3)  # N/m, Nm/rad


class Travel(Skill):
    """Moves through poses.

    Args:
        way: poses in order, (3,), (3, 3) each.
        speed: [m/s], at most 0.04 on the last line.
    """

    def __init__(self, way: Sequence[Pose], speed: float) -> None:
        self._way, self._speed = list(way), speed

    def start(self, observation: Observation, rngs: Sequence[np.random.Generator]) -> None:
        """Begin the first line at the tools' present poses."""
        n = len(rngs)
        self._status, self._reason = np.zeros(n, dtype=np.int64), no_reasons(n)
        self._felt = np.zeros((n, 3))
        self._from = Pose(observation.pose.position.copy(), observation.pose.rotation.copy())
        self._line, self._gone = np.zeros(n, dtype=np.intp), np.zeros(n)
        self._ends = Pose(np.array([p.position for p in self._way]), np.array([p.rotation for p in self._way]))

    def restart(
        self, rows: NDArray[np.intp], observation: Observation, rngs: Sequence[np.random.Generator]
    ) -> None:  # fmt: skip
        """Start again in the given trials."""
        self._status[rows], self._reason[rows] = Status.RUNNING, ""
        self._felt[rows], self._line[rows], self._gone[rows] = 0.0, 0, 0.0
        self._from.position[rows] = observation.pose.position[rows]
        self._from.rotation[rows] = observation.pose.rotation[rows]

    def step(self, observation: Observation) -> Command:
        """Follow the line, and check for its end and contact."""
        goal = Pose(self._ends.position[self._line], self._ends.rotation[self._line])
        across = goal.position - self._from.position
        turn = rotation_vector(goal.rotation @ np.swapaxes(self._from.rotation, -1, -2))
        last = self._line == len(self._way) - 1
        speed = np.where(last & (len(self._way) > 1), min(0.04, self._speed), self._speed)
        lasts = np.maximum(np.maximum(norm(across) / speed, norm(turn) / 1.0), 1e-3)
        self._gone = self._gone + observation.dt
        share = np.clip(self._gone / lasts, 0.0, 1.0)[:, None]
        pose = Pose(self._from.position + share * across, rotation_matrix(share * turn) @ self._from.rotation)
        gone = norm(observation.pose.position - self._from.position)
        self._felt += (observation.wrench[:, :3] - self._felt) * (observation.dt / (0.02 + observation.dt))  # 20 ms
        felt, left = norm(self._felt), (self._line > 0) | (gone > 0.005)
        running = self._status == Status.RUNNING
        for i in np.flatnonzero(running & left & (felt > np.where(last, 4.0, 30.0))).tolist():
            self._status[i] = Status.SUCCESS if last[i] else Status.FAILURE
            self._reason[i] = "touched on the way" if last[i] else f"met something in free air ({felt[i]:.0f} N)"
        there = (self._gone >= lasts + np.where(last, 0.3, 0.0)) & (self._status == Status.RUNNING)  # rests 0.3 s
        self._status[there & last] = Status.SUCCESS
        self._reason[there & last] = "is there"
        rows = np.flatnonzero(there & ~last)
        self._from.position[rows], self._from.rotation[rows] = goal.position[rows], goal.rotation[rows]
        self._line[rows] += 1
        self._gone[rows] = 0.0
        zero = np.zeros((len(lasts), 6))
        return Command(pose, zero, Impedance(STIFF), zero, self._status.copy(), self._reason.copy())

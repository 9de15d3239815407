r"""Skill that moves to a pose in free air: out of the hole first, then straight, until it touches.

    x_d = x_0 + u (along the legs),    R_d = exp(s rho) R_0,    s: share of the way, rho: turn to the goal's orientation

The first leg lifts the tool to the height of the goal, against the way in. On the second, more than 4 N end the motion
with success, since the next part works in contact.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float, Pose, dot, norm, rotation_matrix, rotation_vector
from skillframe.skill import Command, Impedance, Observation, Skill, Status, no_reasons, rows_of

STIFF = np.diag([1000.0] * 3 + [20.0] * 3)  # N/m, Nm/rad
ROWS = ("_began", "_first", "_second", "_turn", "_felt", "_status", "_reason", "_raised")


class Reach(Skill):
    """Moves to a pose.

    Args:
        goals: (N, 3) positions of the centre of compliance in base.
        orientation: (3, 3) of the tool there, in base.
        way: (3,) unit vector of the way in.
        speed: [m/s].
        farthest: largest accepted distance [m].
    """

    def __init__(self, goals: Float, orientation: Float, way: Float, speed: float, farthest: float) -> None:
        self._goals, self._orientation = goals, orientation
        self._way, self._speed, self._farthest = way, speed, farthest

    def start(self, observation: Observation, rngs: Sequence[np.random.Generator]) -> None:
        """Plan both legs."""
        n = len(rngs)
        position, rotation = observation.pose.position, observation.pose.rotation
        self._home = Pose(position.copy(), rotation.copy())
        deep = np.maximum(dot(position - self._goals, self._way), 0.0)
        self._first = -deep[:, None] * self._way
        self._second = self._goals - position - self._first
        self._turn = rotation_vector(self._orientation @ np.swapaxes(rotation, -1, -2))
        self._raised, self._began = norm(self._first), observation.time.copy()
        self._felt = np.zeros(n)
        self._status, self._reason = np.zeros(n, dtype=np.int64), no_reasons(n)
        for i in np.flatnonzero(norm(self._first + self._second) > self._farthest).tolist():
            away = 1e3 * float(norm(self._first[i] + self._second[i]))
            self._status[i], self._reason[i] = Status.FAILURE, (
                f"begins {away:.0f} mm from where the demonstrations touched; begin nearer, teach on this robot, or "
                "learn with --set place=start"
            )  # fmt: skip

    def restart(
        self, rows: NDArray[np.intp], observation: Observation, rngs: Sequence[np.random.Generator]
    ) -> None:  # fmt: skip
        """Start again in the given trials."""
        fresh = Reach(self._goals[rows], self._orientation, self._way, self._speed, self._farthest)
        fresh.start(rows_of(observation, rows), rngs)
        for name in ROWS:
            getattr(self, name)[rows] = getattr(fresh, name)
        self._home.position[rows], self._home.rotation[rows] = fresh._home

    def step(self, observation: Observation) -> Command:
        """The next command."""
        across = norm(self._second)
        gone = self._speed * (observation.time - self._began)
        lifted, moved = np.minimum(gone, self._raised), np.clip(gone - self._raised, 0.0, across)
        first = self._first * (lifted / np.maximum(self._raised, 1e-9))[:, None]
        second = self._second * (moved / np.maximum(across, 1e-9))[:, None]
        total = np.maximum(self._raised + across, 1e-9)
        share = np.clip(gone / np.maximum(total, 0.02), 0.0, 1.0)
        rotation = rotation_matrix(share[:, None] * self._turn) @ self._home.rotation
        force = observation.wrench[:, :3]
        self._felt += (-dot(force, self._way) - self._felt) * (observation.dt / (0.01 + observation.dt))  # over 10 ms
        touched = (moved > 0.0) & (self._felt > 4.0)
        there = gone > np.maximum(total, 0.02) + 0.3 * self._speed  # rests 0.3 s
        for i in np.flatnonzero((self._status == Status.RUNNING) & (touched | there)).tolist():
            self._status[i] = Status.SUCCESS
            self._reason[i] = "touched on the way" if touched[i] else "is there"
        pose = Pose(self._home.position + first + second, rotation)
        zero = np.zeros((len(gone), 6))
        return Command(pose, zero, Impedance(STIFF), zero, self._status.copy(), self._reason.copy())

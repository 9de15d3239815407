r"""Skill that moves a resting part back to the nominal axis as far as its contacts allow.

    x_d = x_0 + u e,    0 <= u <= |a| + F / k,    e = - a / |a|,  a: from the nominal axis to the tool, across the way

Depth alone does not give the place across the way (a slot may be open at one end). The skill ends at the axis, or where
more than the force F holds the part; the target lies up to F / k beyond the axis (k: stiffness across) to overcome
friction.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float, Pose, dot, norm
from skillframe.skill import Command, Impedance, Observation, Skill, Status, no_reasons, rows_of

SPEED, ACROSS = 0.02, 4000.0  # m/s, N/m: the default search's
ROWS = ("_back", "_length", "_began", "_felt", "_status", "_reason")


class Centre(Skill):
    """Moves N tools back to an axis.

    Args:
        ends: (N, 3) a point of the axis in base [m].
        way: (3,) unit vector of insertion along the axis.
        most_n: a contact force above this ends the motion [N].
        pressed: press against the bottom; otherwise hold the height.
    """

    def __init__(self, ends: Float, way: Float, most_n: float, pressed: bool = True) -> None:
        self._ends, self._way, self._most, self._pressed = ends, way, most_n, pressed
        across = np.eye(3) - pressed * np.outer(way, way)
        self._stiffness = np.zeros((6, 6))
        # Nm/rad, as the default search's
        self._stiffness[:3, :3], self._stiffness[3:, 3:] = ACROSS * across, 3.0 * np.eye(3)

    def start(self, observation: Observation, rngs: Sequence[np.random.Generator]) -> None:
        """Plan the way back."""
        position, n = observation.pose.position, len(rngs)
        self._home = Pose(position.copy(), observation.pose.rotation.copy())
        away = self._ends - position
        away = away - dot(away, self._way)[:, None] * self._way
        self._length = norm(away)
        self._back = away / np.maximum(self._length, 1e-9)[:, None]
        self._began, self._felt = observation.time.copy(), np.zeros(n)
        self._status, self._reason = np.zeros(n, dtype=np.int64), no_reasons(n)

    def restart(
        self, rows: NDArray[np.intp], observation: Observation, rngs: Sequence[np.random.Generator]
    ) -> None:  # fmt: skip
        """Start again in the given trials."""
        fresh = Centre(self._ends[rows], self._way, self._most, self._pressed)
        fresh.start(rows_of(observation, rows), rngs)
        for name in ROWS:
            getattr(self, name)[rows] = getattr(fresh, name)
        self._home.position[rows], self._home.rotation[rows] = fresh._home

    def step(self, observation: Observation) -> Command:
        """The next command."""
        gone = SPEED * (observation.time - self._began)
        held = -(observation.wrench[:, :3] * self._back).sum(axis=1)
        self._felt += (held - self._felt) * (observation.dt / (0.02 + observation.dt))  # over 20 ms
        farthest = self._length + self._most / ACROSS
        moved = ((observation.pose.position - self._home.position) * self._back).sum(axis=1)
        # there: 0.2 mm before the axis, or 0.1 s after the target has stopped
        done = (self._felt > self._most) | (moved > self._length - 2e-4) | (gone > farthest + SPEED * 0.1)
        for i in np.flatnonzero(done & (self._status == Status.RUNNING)).tolist():
            drawn = 1e3 * float((observation.pose.position[i] - self._home.position[i]) @ self._back[i])
            held_words = f", held with {self._felt[i]:.0f} N" if self._felt[i] > self._most else ""
            self._status[i] = Status.SUCCESS
            self._reason[i] = f"drawn back by {drawn:.1f} of {1e3 * self._length[i]:.1f} mm{held_words}"
        wrench = np.zeros((len(gone), 6))
        wrench[:, :3] = 4.0 * self._pressed * self._way  # N
        place = self._home.position + np.minimum(gone, farthest)[:, None] * self._back
        pose = Pose(place, self._home.rotation)
        zero = np.zeros((len(gone), 6))
        return Command(pose, zero, Impedance(self._stiffness), wrench, self._status.copy(), self._reason.copy())

r"""Drawing a part that rests at its depth back over the nominal axis, as far as its contacts let it.

    x_d = x_0 + u e,    0 <= u <= |a| + F / k,    e = - a / |a|,  a: from the nominal axis to the tool, across the way

A search leaves a part wherever it sank. Walls hold it there, or nothing does: in a slot that is open at an end the
depth tells nothing of the place along it, and the demonstrated place is the best guess. It presses lightly, where there
is a bottom, and has done what it can where it arrives, or where more than a stated force F holds it. Friction holds it
back with less, so that it is wanted up to F / k beyond the axis, k the stiffness across (all ours).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float, Pose, norm
from skillframe.skill import Command, Impedance, Observation, Skill, Status, no_reasons, rows_of

SPEED, PRESS_N, ACROSS, TURN = 0.02, 4.0, 4000.0, 3.0  # m/s, N, N/m, Nm/rad: the default search's
SETTLE_S, SMOOTHING_S, THERE_M = 0.1, 0.02, 2e-4
ROWS = ("_back", "_length", "_began", "_felt", "_status", "_reason")


class Centre(Skill):
    """Draws N tools back to an axis.

    Args:
        ends: (N, 3) a point of the axis in base [m].
        way: (3,) unit vector along it, the way in.
        most_n: held with more than this, it ends [N].
        pressed: against a bottom; else its height is held.
    """

    def __init__(self, ends: Float, way: Float, most_n: float, pressed: bool = True) -> None:
        self._ends, self._way, self._most, self._pressed = ends, way, most_n, pressed
        across = np.eye(3) - pressed * np.outer(way, way)
        self._stiffness = np.zeros((6, 6))
        self._stiffness[:3, :3], self._stiffness[3:, 3:] = ACROSS * across, TURN * np.eye(3)

    def start(self, observation: Observation, rngs: Sequence[np.random.Generator]) -> None:
        """Take the way back from where the tools are."""
        position, n = observation.pose.position, len(rngs)
        self._home = Pose(position.copy(), observation.pose.rotation.copy())
        away = self._ends - position
        away = away - _dot(away, self._way)[:, None] * self._way
        self._length = norm(away)
        self._back = away / np.maximum(self._length, 1e-9)[:, None]
        self._began, self._felt = observation.time.copy(), np.zeros(n)
        self._status, self._reason = np.zeros(n, dtype=np.int64), no_reasons(n)

    def restart(
        self, rows: NDArray[np.intp], observation: Observation, rngs: Sequence[np.random.Generator]
    ) -> None:  # fmt: skip
        """Start again in some trials, from where their tools are now."""
        fresh = Centre(self._ends[rows], self._way, self._most, self._pressed)
        fresh.start(rows_of(observation, rows), rngs)
        for name in ROWS:
            getattr(self, name)[rows] = getattr(fresh, name)
        self._home.position[rows], self._home.rotation[rows] = fresh._home

    def step(self, observation: Observation) -> Command:
        """Go on back."""
        gone = SPEED * (observation.time - self._began)
        held = -(observation.wrench[:, :3] * self._back).sum(axis=1)
        self._felt += (held - self._felt) * (observation.dt / (SMOOTHING_S + observation.dt))
        farthest = self._length + self._most / ACROSS
        moved = ((observation.pose.position - self._home.position) * self._back).sum(axis=1)
        done = (self._felt > self._most) | (moved > self._length - THERE_M) | (gone > farthest + SPEED * SETTLE_S)
        for i in np.flatnonzero(done & (self._status == Status.RUNNING)).tolist():
            self._status[i], self._reason[i] = Status.SUCCESS, self._told(observation, i)
        wrench = np.zeros((len(gone), 6))
        wrench[:, :3] = PRESS_N * self._pressed * self._way
        place = self._home.position + np.minimum(gone, farthest)[:, None] * self._back
        pose = Pose(place, self._home.rotation)
        zero = np.zeros((len(gone), 6))
        return Command(pose, zero, Impedance(self._stiffness), wrench, self._status.copy(), self._reason.copy())

    def _told(self, observation: Observation, row: int) -> str:
        moved = 1e3 * float((observation.pose.position[row] - self._home.position[row]) @ self._back[row])
        held = f", held with {self._felt[row]:.0f} N" if self._felt[row] > self._most else ""
        return f"drawn back by {moved:.1f} of {1e3 * self._length[row]:.1f} mm{held}"


def _dot(rows: Float, way: Float) -> Float:
    """(N,) how far rows (N, 3) go along a way (3,), each by itself."""
    result: Float = rows[:, 0] * way[0] + rows[:, 1] * way[1] + rows[:, 2] * way[2]
    return result

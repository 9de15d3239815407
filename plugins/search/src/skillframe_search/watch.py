r"""Has it fallen in? A signature of pose and wrench (our choice; the papers name the wrench and give no figures).

    answer  n = - w . push          low-passed over 20 ms       what the surface gives back
    surface s                       depth along the push, low-passed over 0.5 s, while n is above its share of the push
    fallen  <=>  depth - s > drop  and  n fell below its share of the push within the last second

Depth alone would call a slope a hole, and the answer alone would call a bump on the way one.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float
from skillframe.skill import Observation
from skillframe_search.phase import Push, Stop

ANSWER_S, SURFACE_S, MEMORY_S = 0.02, 0.5, 1.0


class Watch:
    """Watches N trials, each row by itself.

    Attributes:
        answer: (N,) what the surface gives back [N].
        depth: (N,) along the push since the start [m].
    """

    def __init__(self, push: Push, stop: Stop, direction: Float, observation: Observation) -> None:
        count = len(observation.time)
        self._push, self._stop, self._direction = push, stop, direction.copy()
        self._home = observation.pose.position.copy()
        self.answer, self.depth = np.zeros(count), np.zeros(count)
        self._surface, self._lost = np.zeros(count), np.full(count, -np.inf)

    def replace(self, rows: NDArray[np.intp], other: Watch) -> None:
        """Watch some trials as another watch does, which watches them alone."""
        for name in ("_direction", "_home", "answer", "depth", "_surface", "_lost"):
            getattr(self, name)[rows] = getattr(other, name)

    def touched(self) -> NDArray[np.bool_]:
        """Which trials press against something now."""
        result: NDArray[np.bool_] = self.answer > self._stop.touch_n
        return result

    def settle(self, rows: NDArray[np.bool_]) -> None:
        """The surface is where these trials are now."""
        self._surface[rows] = self.depth[rows]
        self._lost[rows] = -np.inf

    def look(self, observation: Observation) -> NDArray[np.bool_]:
        """Take in an observation. Returns which trials have fallen in (N,)."""
        dt = observation.dt
        felt = -_dot(observation.wrench[:, :3], self._direction)
        self.answer = self.answer + (felt - self.answer) * (dt / (ANSWER_S + dt))
        self.depth = _dot(observation.pose.position - self._home, self._direction)
        pressed = self.answer > self._stop.lost_share * self._push.force
        followed = self._surface + (self.depth - self._surface) * (dt / (SURFACE_S + dt))
        self._surface = np.where(pressed, followed, self._surface)
        self._lost = np.where(pressed, self._lost, observation.time)
        deep = self.depth - self._surface > self._stop.drop_m
        result: NDArray[np.bool_] = deep & (observation.time - self._lost < MEMORY_S)
        return result


def _dot(a: Float, b: Float) -> Float:
    """Row-wise dot product (N,) of (N, 3) arrays in one fixed order of additions."""
    result: Float = a[:, 0] * b[:, 0] + a[:, 1] * b[:, 1] + a[:, 2] * b[:, 2]
    return result

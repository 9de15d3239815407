"""Detect that a push has come to rest: nothing has moved for a while, while the desired pose leads.

Position and orientation are low-passed over 50 ms against sensor noise. Motion is a distance per coordinate from where
the tool last moved.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float
from skillframe.skill import Observation
from skillframe_lmc.phase import Stop

SMOOTHING_S = 0.05


class StallWatch:
    """Watches N trials, each row by itself."""

    def __init__(self, stop: Stop) -> None:
        self._stop = stop
        self._scale = np.repeat([1.0 / stop.stall_m, 1.0 / stop.stall_rad], [3, 9])
        self._smooth: Float | None = None

    def _seen(self, observation: Observation) -> Float:
        n = len(observation.time)
        seen = np.concatenate([observation.pose.position, observation.pose.rotation.reshape(n, 9)], axis=1)
        seen *= self._scale
        return seen

    def forget(self, rows: NDArray[np.intp], observation: Observation) -> None:
        """Restart the watch of some trials from an observation of them alone."""
        if self._smooth is not None:
            seen = self._seen(observation)
            self._smooth[rows], self._anchor[rows], self._since[rows] = seen, seen, observation.time

    def look(self, observation: Observation, pushing: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Trials (N,) that have been at rest for `stall_s` and are pushing."""
        seen = self._seen(observation)
        if self._smooth is None:
            self._smooth, self._anchor, self._since = seen, seen.copy(), observation.time.copy()
        self._smooth = self._smooth + (seen - self._smooth) * (observation.dt / (SMOOTHING_S + observation.dt))
        moved = np.abs(self._smooth - self._anchor).max(axis=1) > 1.0
        self._anchor[moved] = self._smooth[moved]
        moved |= ~pushing
        self._since[moved] = observation.time[moved]
        result: NDArray[np.bool_] = observation.time - self._since >= self._stop.stall_s
        return result

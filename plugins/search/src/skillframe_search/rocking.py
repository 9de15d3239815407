r"""Torques on a part that rests in a hole short of its end: a rotating torque, then a spiral of the tip.

    quick, slow    m (a cos wt + b sin wt)                        a, b across the way: frees a jam, moves the tip
    settle         the same, fading, near the end                 a loose part stands flush
    tip            K (rho_m + s - rho) - d w, at most m_t         finds a second hole
    s = p f t (a cos 2 pi f t + b sin 2 pi f t)                   up to the largest tilt of the fixture

rho is the turn across the way from the nominal orientation, w its rate, rho_m its mean over 1 s. The spiral, p = pitch
/ depth, also passes places within the play, whose limits a torque alone follows. It is left out where 1.5 turns cover
the range. The arm's inertia limits f to about 1 Hz.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float, cross, norm, rotation_vector
from skillframe.skill import Observation
from skillframe_search.contact import surface_axes
from skillframe_search.handling import Handling
from skillframe_search.seat_document import Seat

MEAN_S, TIP_NMS_RAD = 1.0, 0.5
AFTER_S = 0.2  # that the spiral stays at its widest before a stall
LEAST_LEVER_M = 1e-4
SETTLE_AFTER_S, RISES, FALLS = 0.1, 8.0, 1.2  # share of settling: rises within 1/8, falls from 1/6 to the end


class Rocking:
    """The torques of N trials.

    Args:
        how: their sizes and rates.
        seat: place of the part.
        upright: (3, 3) nominal orientation of the tool.
    """

    def __init__(self, how: Handling, seat: Seat, upright: Float) -> None:
        self._how, self._seat, self._way, self._upright = how, seat, np.array(seat.way), upright
        self._a, self._b = surface_axes(self._way)[:2]

    def start(self, count: int) -> None:
        """Set up `count` trials."""
        self._mean, self._spiralled = np.zeros((count, 3)), np.zeros(count, dtype=bool)

    def restart(self, rows: NDArray[np.intp]) -> None:
        """Set up trials again."""
        self._mean[rows], self._spiralled[rows] = 0.0, False

    def patience(self, deep: Float, urged: NDArray[np.bool_], most: Float) -> Float:
        """(N,) time that each may rest in the hole before it has stalled [s], at depths (N,) against the end [m]."""
        pitch, how = self._pitch(deep, most), self._how
        spiral = how.slow_after_s + most / (pitch * how.tip_hz) + AFTER_S
        result: Float = np.where(urged & self._is_deep(pitch, most), spiral, how.patience_s)
        return result

    def torque(
        self, observation: Observation, idle: Float, deep: Float, resting: NDArray[np.bool_],
        urged: NDArray[np.bool_], most: Float,
    ) -> Float:  # fmt: skip
        """(N, 3) added torque [Nm].

        Args:
            observation: of the tools.
            idle: (N,) time without progress [s].
            deep: (N,) depths against the end [m].
            resting: (N,) in the hole and short of the end.
            urged: (N,) whose push goes on after rocking.
            most: (N,) largest tilt of the fixture [rad].
        """
        before, self._spiralled = self._spiralled, np.zeros(len(resting), dtype=bool)
        if not np.count_nonzero(resting):
            return np.zeros((len(resting), 3))
        how = self._how
        slow = idle > how.slow_after_s
        size = np.where(slow, how.slow_nm, how.rock_nm) * (resting & (idle > how.rock_after_s))
        phase = 2.0 * np.pi * np.where(slow, how.slow_hz, how.rock_hz) * observation.time
        torque = self._round(size, phase)
        pitch = self._pitch(deep, most)
        searches = resting & urged & slow & self._is_deep(pitch, most)
        if np.count_nonzero(searches):
            gone, self._spiralled = np.where(searches, idle - how.slow_after_s, 0.0), searches
            torque[searches] = self._spiral(observation, gone, pitch, searches & ~before, most)[searches]
        return torque

    def settling(self, idle: Float) -> Float:
        """(N,) share of the settling torque after (N,) `idle` at rest near the end [s]."""
        if not self._seat.settle_s:
            return np.zeros(len(idle))
        gone = (idle - SETTLE_AFTER_S) / self._seat.settle_s
        result: Float = np.clip(np.minimum(RISES * gone, FALLS * (1.0 - gone)), 0.0, 1.0)
        return result

    def settle(self, time: Float, share: Float) -> Float:
        """(N, 3) settling torque at (N,) times [s], of (N,) shares [Nm]."""
        return self._round(self._how.settle_nm * share, 2.0 * np.pi * self._how.rock_hz * time)

    def _spiral(
        self, observation: Observation, gone: Float, pitch: Float, begins: NDArray[np.bool_], most: Float
    ) -> Float:  # fmt: skip
        how = self._how
        turn = self._across(rotation_vector(observation.pose.rotation @ self._upright.T))
        self._mean = np.where(begins[:, None], turn, self._mean)
        self._mean += (turn - self._mean) * (observation.dt / MEAN_S)
        turns = how.tip_hz * gone
        wanted = self._mean + self._round(np.minimum(pitch * turns, most), 2.0 * np.pi * turns)
        torque = how.tip_nm_rad * (wanted - turn) - TIP_NMS_RAD * self._across(observation.twist[:, 3:])
        result: Float = torque * np.minimum(1.0, how.tip_nm / np.maximum(norm(torque), 1e-9))[:, None]
        return result

    def _pitch(self, deep: Float, most: Float) -> Float:
        """(N,) increase of the spiral per turn [rad]."""
        lever = np.maximum(self._seat.contact_m + deep, LEAST_LEVER_M)
        least = np.maximum(most / 6.0, 1e-4)  # 6 turns cover the range at most [rad a turn]
        result: Float = np.maximum(self._how.tip_pitch_m / lever, least)
        return result

    def _is_deep(self, pitch: Float, most: Float) -> NDArray[np.bool_]:
        result: NDArray[np.bool_] = pitch < most / 1.5
        return result

    def _round(self, size: Float, phase: Float) -> Float:
        """(N, 3) vectors of sizes (N,) across the way, at phases (N,) [rad]."""
        result: Float = (size * np.cos(phase))[:, None] * self._a + (size * np.sin(phase))[:, None] * self._b
        return result

    def _across(self, vectors: Float) -> Float:
        way = np.broadcast_to(self._way, vectors.shape)
        return cross(way, cross(vectors, way))

r"""What turns a part that rests in a hole short of its end: a torque that goes round, then a spiral of the tip.

    quick, slow    m (a cos wt + b sin wt)                        a, b across the way: frees a jam, and moves the tip
    settle         the same, its size fading, near the end        a loose part wedged aslant stands flush after it
    tip            K (rho_m + s - rho) - d w, at most m_t         once the push goes on: finds a second hole
    s = p f t (a cos 2 pi f t + b sin 2 pi f t)                   the spiral, up to the most that a fixture leans

rho is the turn across the way from the nominal attitude, w the rate, rho_m the mean of rho over 1 s: how a pin may lean
in the first hole says about how that stands. A torque alone lets the tip of a loose pin run along the limits of its
play; the spiral passes what lies within, with p = pitch / lever, the tip's pitch over how deep it is in. It is left out
where the lever is so short that one turn and a half cover all there is, and has six turns at most. The tip goes round
once a second or so: the arm's inertia about the first hole holds a quicker one. All of this is ours.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float, cross, norm, rotation_vector
from skillframe.skill import Observation
from skillframe_search.contact import surface_axes
from skillframe_search.seat_document import Seat

MOST_TURNS, LEAST_TURNS = 6.0, 1.5
MEAN_S, TIP_NMS_RAD = 1.0, 0.5
AFTER_S = 0.2  # of patience once the spiral is at its widest
LEAST_LEVER_M, LEAST_PITCH = 1e-4, 1e-4
SETTLE_AFTER_S, RISES, FALLS = 0.1, 8.0, 1.2  # the size while settling: rises within 1/8, falls from 1/6 to the end


class Rocking:
    """The torques of N trials.

    Args:
        seat: their sizes and rates.
        upright: (3, 3) nominal attitude of the tool.
    """

    def __init__(self, seat: Seat, upright: Float) -> None:
        self._seat, self._way, self._upright = seat, np.array(seat.way), upright
        self._a, self._b = surface_axes(self._way)[:2]

    def start(self, count: int) -> None:
        """Of so many trials."""
        self._mean, self._spiralled = np.zeros((count, 3)), np.zeros(count, dtype=bool)

    def patience(self, deep: Float, urged: NDArray[np.bool_]) -> Float:
        """How long (N,) each may rest in the hole before it has stalled [s], at depths (N,) against the end [m]."""
        pitch, seat = self._pitch(deep), self._seat
        spiral = seat.slow_after_s + seat.most_tilt_rad / (pitch * seat.tip_hz) + AFTER_S
        result: Float = np.where(urged & self._is_deep(pitch), spiral, seat.patience_s)
        return result

    def torque(
        self, observation: Observation, idle: Float, deep: Float, resting: NDArray[np.bool_], urged: NDArray[np.bool_]
    ) -> Float:
        """(N, 3) what is added [Nm].

        Args:
            observation: of the tools.
            idle: (N,) since when there was no progress [s].
            deep: (N,) depths against the end [m].
            resting: (N,) who is in the hole and short of the end.
            urged: (N,) whose push goes on after rocking.
        """
        before, self._spiralled = self._spiralled, np.zeros(len(resting), dtype=bool)
        if not np.count_nonzero(resting):
            return np.zeros((len(resting), 3))
        seat = self._seat
        slow = idle > seat.slow_after_s
        size = np.where(slow, seat.slow_nm, seat.rock_nm) * (resting & (idle > seat.rock_after_s))
        phase = 2.0 * np.pi * np.where(slow, seat.slow_hz, seat.rock_hz) * observation.time
        torque = self._round(size, phase)
        pitch = self._pitch(deep)
        searches = resting & urged & slow & self._is_deep(pitch)
        if np.count_nonzero(searches):
            gone, self._spiralled = np.where(searches, idle - seat.slow_after_s, 0.0), searches
            torque[searches] = self._spiral(observation, gone, pitch, searches & ~before)[searches]
        return torque

    def settling(self, idle: Float) -> Float:
        """(N,) share of the most by which a part at rest near the end is settled, after (N,) `idle` [s]."""
        if not self._seat.settle_s:
            return np.zeros(len(idle))
        gone = (idle - SETTLE_AFTER_S) / self._seat.settle_s
        result: Float = np.clip(np.minimum(RISES * gone, FALLS * (1.0 - gone)), 0.0, 1.0)
        return result

    def settle(self, time: Float, share: Float) -> Float:
        """(N, 3) torque that settles parts at (N,) times [s], each its (N,) share of the most [Nm]."""
        return self._round(self._seat.settle_nm * share, 2.0 * np.pi * self._seat.rock_hz * time)

    def _spiral(self, observation: Observation, gone: Float, pitch: Float, begins: NDArray[np.bool_]) -> Float:
        seat = self._seat
        turn = self._across(rotation_vector(observation.pose.rotation @ self._upright.T))
        self._mean = np.where(begins[:, None], turn, self._mean)
        self._mean += (turn - self._mean) * (observation.dt / MEAN_S)
        turns = seat.tip_hz * gone
        wanted = self._mean + self._round(np.minimum(pitch * turns, seat.most_tilt_rad), 2.0 * np.pi * turns)
        torque = seat.tip_nm_rad * (wanted - turn) - TIP_NMS_RAD * self._across(observation.twist[:, 3:])
        result: Float = torque * np.minimum(1.0, seat.tip_nm / np.maximum(norm(torque), 1e-9))[:, None]
        return result

    def _pitch(self, deep: Float) -> Float:
        """(N,) by how much the spiral widens in a turn [rad]."""
        lever = np.maximum(self._seat.contact_m + deep, LEAST_LEVER_M)
        least = max(self._seat.most_tilt_rad / MOST_TURNS, LEAST_PITCH)
        result: Float = np.maximum(self._seat.tip_pitch_m / lever, least)
        return result

    def _is_deep(self, pitch: Float) -> NDArray[np.bool_]:
        result: NDArray[np.bool_] = pitch < self._seat.most_tilt_rad / LEAST_TURNS
        return result

    def _round(self, size: Float, phase: Float) -> Float:
        """(N, 3) vectors of sizes (N,) across the way, at phases (N,) [rad]."""
        result: Float = (size * np.cos(phase))[:, None] * self._a + (size * np.sin(phase))[:, None] * self._b
        return result

    def _across(self, vectors: Float) -> Float:
        """(N, 3) vectors without what lies along the way, each by itself."""
        way = np.broadcast_to(self._way, vectors.shape)
        return cross(way, cross(vectors, way))

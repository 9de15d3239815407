"""The 100 points of the AI for Industry Challenge for one insertion, and their parts.

Rules: docs/scoring.md of github.com/intrinsic-dev/aic, as of 2026-03-13. 1 point for a trial that ran; up to 6 for
smoothness, 12 for time, 6 for a short way, where the third tier gives any; 75 for success, else 38 to 50 for part of
the way in or up to 25 for being near; -12 for force, -24 for a collision. The port is the fixture's origin, `progress`
deep.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from skillframe.frames import Float, matrix_from_quaternion, norm

if TYPE_CHECKING:
    from skillframe.execution import Trace

WINDOW = 15
"""Samples of the local polynomial of the velocity, of second degree."""
ASIDE_M = 0.005
"""Largest distance from the port's axis, along x and along y, of a part inside [m]."""


def jerk(trace: Trace) -> float:
    """Mean magnitude of the jerk while the tool moves [m/s^3], NaN if too short or diverged."""
    from scipy.signal import savgol_filter

    velocity = trace.twist[:, :3]
    moves = norm(velocity) > 0.01  # jerk counts from this speed on [m/s]
    if len(velocity) < WINDOW or not moves.any() or not np.isfinite(velocity).all():
        return math.nan
    step = float(np.median(np.diff(trace.time)))
    return float(norm(savgol_filter(velocity, WINDOW, 2, deriv=2, delta=step, axis=0))[moves].mean())


def force_time(trace: Trace) -> float:
    """Longest continuous time with a measured force above 20 N [s]."""
    longest, since = 0.0, None
    for time, high in zip(trace.time.tolist(), (norm(trace.wrench[:, :3]) > 20.0).tolist(), strict=True):
        since = (time if since is None else since) if high else None
        longest = max(longest, 0.0 if since is None else time - since)
    return longest


def energy(trace: Trace) -> float:
    """Absolute mechanical work at the centre of compliance [J]."""
    power = np.abs(np.sum(trace.command_wrench * trace.twist, axis=1))
    return float(np.sum(0.5 * (power[1:] + power[:-1]) * np.diff(trace.time)))


def path(trace: Trace) -> float:
    """Length of the tip's way [m]."""
    return float(np.sum(norm(np.diff(_tip(trace), axis=0))))


def points(trace: Trace) -> float:
    """Points of a trial, for success only in a world without a port (fixture and depth)."""
    meta = trace.meta
    deep = (meta.get("progress") or {}).get("of_m")
    names = [each["name"] for each in meta.get("bodies", ())]
    tip = _tip(trace)
    if deep and "fixture" in names:
        tip = _from_port(trace, tip, names.index("fixture"))
        start = float(np.linalg.norm(tip[0]))
        short = _short_of_success(tip[-1], float(deep), 0.5 * start)
    else:
        start, short = float(np.linalg.norm(tip[-1] - tip[0])), 0.0
    third = 75.0 if meta["success"] else short
    penalty = 12.0 * (force_time(trace) > 1.0) + 24.0 * bool(meta.get("touched"))  # longer than 1 s
    motion = 0.0  # second tier without penalties; m/s^3, s and m, where a trial too short for a jerk did not move
    if third > 0.0:
        rough = jerk(trace)
        motion = (
            6.0 * _left(0.0 if math.isnan(rough) else rough, 0.0, 50.0)
            + 12.0 * _left(float(meta["duration_s"]), 5.0, 60.0)
            + 6.0 * _left(path(trace), start, start + 1.0)
        )
    return 1.0 + third - penalty + motion


def _short_of_success(tip: Float, deep: float, far: float) -> float:
    """Third tier of a failed trial, by the final tip (3,) in the port's frame."""
    if abs(tip[0]) <= ASIDE_M and abs(tip[1]) <= ASIDE_M and tip[2] < 0.0:
        return 38.0 + 12.0 * min(1.0, -float(tip[2]) / deep)
    return 25.0 * _left(float(np.linalg.norm(tip)), 0.0, far) if far > 0.0 else 0.0


def _left(value: float, best: float, worst: float) -> float:
    """1 up to the best value, 0 from the worst one, linear between."""
    return min(1.0, max(0.0, (worst - value) / (worst - best)))


def _tip(trace: Trace) -> Float:
    """(T, 3) way of the tip in base [m], or of the centre of compliance without a tip."""
    center = np.array(trace.meta.get("center_of_compliance", np.zeros(3)))
    tip = np.array(trace.meta.get("frames", {}).get("tip", center)) - center
    result: Float = trace.position + matrix_from_quaternion(trace.quaternion) @ tip
    return result


def _from_port(trace: Trace, way: Float, fixture: int) -> Float:
    """(T, 3) points of base in the fixture frame."""
    turn = matrix_from_quaternion(trace.body_quaternion[:, fixture])
    result: Float = np.einsum("tji,tj->ti", turn, way - trace.body_position[:, fixture])
    return result

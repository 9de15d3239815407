"""Columns of a table without a header by their values, and units by their size.

Four columns side by side with unit norm are a quaternion, nine orthonormal ones a matrix. What is left of them is clock
and position (or position alone), what is right of them the wrench. Without either, three numbers after the position are
taken for angles, if the count of columns fits. A unit of time is the one of s, ms, us, ns that gives between 5 and 5000
samples a second, of which there is one only. Positions beyond 20 are millimetres, since no arm reaches so many metres.
Angles beyond a turn are degrees. A column of velocities tells more: dp/dt over it is 1, 1000, ... Thresholds are our
choice.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from skillframe.demonstration.columns import MATRIX, POSITION, QUATERNION, ROTATION_VECTOR, WRENCH
from skillframe.frames import Float, norm

NORM, SHARE = 0.01, 0.99
LOWEST, HIGHEST = 5.0, 5000.0
FARTHEST = 20.0
TURN = 2.0 * np.pi + 0.1
TIMES: Mapping[str, float] = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
LENGTHS: Mapping[str, float] = {"m": 1.0, "mm": 1e-3, "cm": 1e-2}
LIKE = 0.2
"""How far from a unit's factor the ratio of dp/dt to a velocity may be."""


def quaternion_at(values: Float) -> int | None:
    """First of four columns side by side that have unit norm and are not the same in every row."""
    for i in range(values.shape[1] - 3):
        four = values[:, i : i + 4]
        if np.any(np.ptp(four, axis=0) > 1e-6) and float(np.mean(np.abs(norm(four) - 1.0) < NORM)) >= SHARE:
            return i
    return None


def matrix_at(values: Float) -> int | None:
    """First of nine columns side by side that are a rotation, by rows or by columns."""
    for i in range(values.shape[1] - 8):
        nine = values[:, i : i + 9].reshape(-1, 3, 3)
        off = np.abs(nine @ np.swapaxes(nine, -1, -2) - np.eye(3)).max(axis=(1, 2))
        if np.any(np.ptp(nine, axis=0) > 1e-6) and float(np.mean(off < NORM)) >= SHARE:
            return i
    return None


def picks_by_value(values: Float, pose: bool) -> dict[str, int]:
    """Columns of a table without names.

    Args:
        values: (T, C).
        pose: whether six numbers are a pose, because the wrench is in another file.
    """
    rows = values[np.all(np.isfinite(values), axis=1)]
    if len(rows) < 3:
        return {}
    clock = {"t": 0} if np.all(np.diff(rows[:, 0]) > 0.0) else {}
    for find, names in ((quaternion_at, QUATERNION), (matrix_at, MATRIX)):
        first = find(rows)
        if first is not None:
            return {**clock, **_run(names, first), **_around(rows, len(clock), first, first + len(names))}
    count, begin = rows.shape[1] - len(clock), len(clock)
    if count == 12 or (count == 6 and pose):
        angles = {**_run(POSITION, begin), **_run(ROTATION_VECTOR, begin + 3)}
        return {**clock, **angles, **(_run(WRENCH, begin + 6) if count == 12 else {})}
    return {**clock, **(_run(WRENCH, begin) if count == 6 else {})}


def _around(rows: Float, clock: int, first: int, last: int) -> dict[str, int]:
    """Position in the three columns before an attitude, and the wrench in six after it, or the other way round."""
    before, after = first - clock, rows.shape[1] - last
    if before >= 9 and after == 0:
        return {**_run(POSITION, first - 3), **_run(WRENCH, clock)}
    place = first - 3 if before >= 3 else last
    begin = last if before >= 3 else last + 3
    return {**_run(POSITION, place), **(_run(WRENCH, begin) if rows.shape[1] >= begin + 6 else {})}


def _run(names: tuple[str, ...], first: int) -> dict[str, int]:
    return {name: first + i for i, name in enumerate(names)}


def unit_of_time(time: Float) -> str | None:
    """The unit in which a clock's rate is one of recordings."""
    period = float(np.median(np.diff(time)))
    fitting = [unit for unit, factor in TIMES.items() if period > 0.0 and LOWEST <= 1.0 / (period * factor) < HIGHEST]
    return fitting[0] if fitting else None


def unit_of_length(position: Float, speed: Float | None, time: Float) -> tuple[str, str]:
    """The unit of positions (T, 3), and why.

    Args:
        position: as recorded.
        speed: (T, 3) of the file, in metres a second, or None.
        time: (T,) [s].
    """
    if speed is not None and (ratio := ratio_of(np.gradient(position, time, axis=0), speed)) is not None:
        near = [unit for unit, factor in LENGTHS.items() if abs(ratio * factor - 1.0) < LIKE]
        if near:
            return near[0], f"dp/dt is {ratio:.4g} times the velocity's columns"
    far = float(np.abs(position).max())
    if far > FARTHEST:
        return "mm", f"it reaches {far:.4g}, and no arm that many metres"
    return "m", f"it reaches {far:.3g}, as metres do"


def ratio_of(one: Float, other: Float) -> float | None:
    """Size of one (T, 3) over another that it is proportional to, None if it is not (correlation below 0.8)."""
    both, size = float((one * other).sum()), float(np.sqrt((one**2).sum() * (other**2).sum()))
    return float((one * other).sum() / (other**2).sum()) if size > 0.0 and both > 0.8 * size else None


def unit_of_angle(angles: Float) -> tuple[str, str]:
    """The unit of angles (T, 3), and why."""
    most = float(np.abs(angles).max())
    if most > TURN:
        return "deg", f"they reach {most:.4g}, more than a turn in radians"
    return "rad", f"they reach {most:.3g}, within a turn in radians"

"""Columns of a table without a header, from their values, and units from their size.

Four adjacent columns of unit norm are a quaternion, nine orthonormal ones a matrix; otherwise angles or a rotation
vector follow the position if the column count fits. Positions differ from wrenches in range and smoothness. The unit of
time gives 5 to 5000 Hz. Positions beyond 20 are millimetres; between 5 and 20 they may be a machine's metres. Angles
beyond a turn are degrees. Recorded velocities confirm units.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import permutations

import numpy as np

from skillframe.demonstration import MATRIX, POSITION, QUATERNION, ROTATION_VECTOR, SCALES, WRENCH
from skillframe.frames import Float, norm
from skillframe_recordings.thresholds import PROPOSAL


def quaternion_at(values: Float) -> int | None:
    """Return the first of four adjacent varying columns with the norm nearest to 1."""
    return _nearest(values, 4, lambda four: np.abs(norm(four) - 1.0))


def matrix_at(values: Float) -> int | None:
    """Return the first of the nine adjacent columns nearest to a rotation."""
    return _nearest(values, 9, _off_rotation)


def _off_rotation(columns: Float) -> Float:
    nine = columns.reshape(-1, 3, 3)
    return np.asarray(np.abs(nine @ np.swapaxes(nine, -1, -2) - np.eye(3)).max(axis=(1, 2)))


def _nearest(values: Float, width: int, off: Callable[[Float], Float]) -> int | None:
    """First of `width` columns with error (T,) below `PROPOSAL.norm` in nearly all rows, and least on average."""
    found = []
    for i in range(values.shape[1] - width + 1):
        block = values[:, i : i + width]
        error = off(block)
        if np.any(np.ptp(block, axis=0) > 1e-6) and float(np.mean(error < PROPOSAL.norm)) >= PROPOSAL.norm_rows:
            found.append((float(error.mean()), i))
    return min(found)[1] if found else None


def picks_by_value(values: Float, pose: bool, doubts: list[str]) -> dict[str, int]:
    """Return the columns of a table without names.

    Args:
        values: (T, C).
        pose: whether six numbers are a pose, as the wrench is in another file.
        doubts: receives ambiguities.
    """
    rows = values[np.all(np.isfinite(values), axis=1)]
    if len(rows) < 3:
        return {}
    step = np.diff(rows[:, 0])
    clock = {"t": 0} if np.all(step >= 0.0) and np.mean(step > 0.0) > PROPOSAL.clock_runs else {}
    begin, width = len(clock), rows.shape[1]
    for find, names in ((quaternion_at, QUATERNION), (matrix_at, MATRIX)):
        first = find(rows)
        if first is not None:
            fixed = {**clock, **_run(names, first)}
            return {**fixed, **_told(rows, _around(width, begin, first, first + len(names)), doubts, fixed)}
    angles = (*POSITION, *ROTATION_VECTOR)
    if width - begin == 12:
        orders = [(*angles, *WRENCH), (*WRENCH, *angles)]
        return {**clock, **_told(rows, [_run(order, begin) for order in orders], doubts, clock)}
    if width - begin == 6:
        return {**clock, **(_run(angles, begin) if pose else _one_block(rows, begin, doubts))}
    return clock


def _one_block(rows: Float, begin: int, doubts: list[str]) -> dict[str, int]:
    """Six numbers are a wrench if beyond an arm's reach, else ambiguous."""
    if np.abs(rows[:, begin : begin + 3]).max() > PROPOSAL.reach:
        return _run(WRENCH, begin)
    clock = "t," if begin else ""
    doubts.append(
        f"whether its six numbers are a wrench (--set columns={clock}{','.join(WRENCH)}), position and rotation vector "
        f"(--set columns={clock}px,py,pz,rvx,rvy,rvz) or position and angles "
        f"(--set columns={clock}px,py,pz,roll,pitch,yaw)"
    )
    return {}


def _around(width: int, clock: int, first: int, last: int) -> list[dict[str, int]]:
    size = {POSITION: 3, WRENCH: 6, (): last - first}
    found: list[dict[str, int]] = []
    for blocks in (*permutations((POSITION, (), WRENCH)), (POSITION, ()), ((), POSITION)):
        begins = np.cumsum([0, *(size[block] for block in blocks)])
        begins += first - begins[blocks.index(())]
        alone = len(blocks) == 2 and found
        if begins[0] >= clock and begins[-1] <= width and not alone:
            starts = zip(blocks, begins.tolist(), strict=False)
            found.append({name: i for block, at in starts for name, i in _run(block, at).items()})
    return found


def _told(rows: Float, readings: list[dict[str, int]], doubts: list[str], fixed: Mapping[str, int]) -> dict[str, int]:
    """The one layout within an arm's reach, or with by far the smoothest position, or {} if these disagree."""
    if len(readings) < 2:
        return readings[0] if readings else {}
    within = [r for r in readings if np.abs(_place(rows, r)).max() <= PROPOSAL.reach]
    rough = [_roughness(_place(rows, r)) for r in readings]
    first, second = np.argsort(rough)[:2]
    smooth = [readings[first]] if rough[second] > PROPOSAL.smoother * rough[first] else []
    told = [r[0] for r in (within, smooth) if len(r) == 1]
    if told and all(reading is told[0] for reading in told):
        return told[0]
    both = " or ".join(f"--set columns={_listed({**fixed, **r}, rows.shape[1])}" for r in readings)
    doubts.append(f"which of its columns are position and which the wrench: type {both}")
    return {}


def _place(rows: Float, reading: Mapping[str, int]) -> Float:
    return rows[:, [reading[name] for name in POSITION]]


def _roughness(columns: Float) -> float:
    """Second differences of (T, 3) over range: about 1e-5 for motion, 0.01 for force."""
    size = float(np.ptp(columns, axis=0).max())
    return float(np.sqrt(np.mean(np.diff(columns, 2, axis=0) ** 2))) / size if size > 0.0 else np.inf


def _listed(reading: Mapping[str, int], width: int) -> str:
    by_index = {index: name for name, index in reading.items()}
    return ",".join(by_index.get(i, "_") for i in range(width))


def _run(names: tuple[str, ...], first: int) -> dict[str, int]:
    return {name: first + i for i, name in enumerate(names)}


def unit_of_time(time: Float) -> str | None:
    """Return the unit in which a clock's rate is plausible."""
    period = float(np.median(np.diff(time)))
    rates = {unit: 1.0 / (period * SCALES["time"][unit]) for unit in ("s", "ms", "us", "ns") if period > 0.0}
    return next((unit for unit, rate in rates.items() if PROPOSAL.slow_hz <= rate < PROPOSAL.fast_hz), None)


def unit_of_length(position: Float, speed: Float | None, time: Float) -> tuple[str | None, str]:
    """Return the unit of positions (T, 3), None if undetermined, and the reason.

    Args:
        position: as recorded.
        speed: (T, 3) of the file [m/s], or None.
        time: (T,) [s].
    """
    if speed is not None and (ratio := ratio_of(np.gradient(position, time, axis=0), speed)) is not None:
        near = [u for u in ("m", "mm", "cm") if abs(ratio * SCALES["length"][u] - 1.0) < PROPOSAL.like]
        if near:
            return near[0], f"dp/dt is {ratio:.4g} times the velocity's columns"
    far = float(np.abs(position).max())
    if far > PROPOSAL.far:
        return "mm", f"it reaches {far:.4g}, and nothing that holds a tool reaches so many metres"
    if far > PROPOSAL.reach:
        return (
            None,
            f"they reach {far:.4g}; no arm reaches {PROPOSAL.reach:g} m, a machine may: if it is none, type "
            "--set units=mm",
        )
    return "m", f"it reaches {far:.3g}, as metres do"


def ratio_of(one: Float, other: Float) -> float | None:
    """Return the size of one (T, 3) over another, or None if their correlation is below 0.8."""
    both, size = float((one * other).sum()), float(np.sqrt((one**2).sum() * (other**2).sum()))
    return float((one * other).sum() / (other**2).sum()) if size > 0.0 and both > 0.8 * size else None


def unit_of_angle(angles: Float) -> tuple[str, str]:
    """Return the unit of angles (T, 3), and the reason."""
    most = float(np.abs(angles).max())
    if most > PROPOSAL.turn:
        return "deg", f"they reach {most:.4g}, more than a turn in radians"
    return "rad", f"they reach {most:.3g}, within a turn in radians"

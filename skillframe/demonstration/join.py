r"""Pose and wrench from two files with two clocks, joined on time over the interval that both cover.

One clock's samples are kept and the other file is interpolated at them: linearly for positions and wrenches, along the
shortest rotation for attitudes, \(R(s) = R_0 \exp(s \log(R_0^T R_1))\); whole numbers of further columns are held.
Files are never paired row by row unless both are given a rate instead of a clock.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skillframe.demonstration.checks import GAP
from skillframe.demonstration.columns import KNOWN, QUATERNION, WRENCH, Columns
from skillframe.demonstration.options import ReadOptions
from skillframe.errors import InputError
from skillframe.frames import (
    Float,
    matrix_from_quaternion,
    quaternion_from_matrix,
    rotation_matrix,
    rotation_vector,
)


def join(pose: Columns, wrench: Columns, options: ReadOptions, notes: list[str]) -> Columns:
    """Both files' columns on one clock.

    Args:
        pose: t, position, quaternion and whatever else the file holds.
        wrench: t, fx ... tz and whatever else; its columns win where both files have them.
        options: `clock`; the cut, to count what is left out of it.
        notes: what was done is added here.

    Raises:
        InputError: the clocks have no interval in common.
    """
    start, stop = max(pose["t"][0], wrench["t"][0]), min(pose["t"][-1], wrench["t"][-1])
    keep_pose = options.clock == "pose" or (options.clock == "auto" and _rate(pose) > 0.95 * _rate(wrench))
    kept, other = (pose, wrench) if keep_pose else (wrench, pose)
    inside = (kept["t"] >= start) & (kept["t"] <= stop)
    if inside.sum() < 2:
        raise InputError(
            wrench.source,
            f"its clock ({_span(wrench)}) has no interval in common with that of {pose.source} ({_span(pose)})",
            "check the units of time (--units, --wrench-units), or move its clock with --wrench-shift",
        )  # fmt: skip
    time = kept["t"][inside]
    found = interpolate(other, time)
    own = {name: column[inside] for name, column in kept.items()}
    first, second = (own, found) if keep_pose else (found, own)
    joined = {**{k: v for k, v in first.items() if k not in WRENCH}, **second, "t": time}
    wanted = within(kept["t"], options.start, options.stop)
    notes.append(_sentence(pose, wrench, keep_pose, int((wanted & ~inside).sum())))
    notes += _gaps(other, time)
    rows = None if kept.rows is None else np.asarray(kept.rows)[inside].tolist()
    return Columns(joined, kept.source, rows)


def _rate(columns: Columns) -> float:
    return float(1.0 / np.median(np.diff(columns["t"])))


def _span(columns: Columns) -> str:
    return f"{columns['t'][0]:.6g} to {columns['t'][-1]:.6g} s"


def _sentence(pose: Columns, wrench: Columns, keep_pose: bool, outside: int) -> str:
    text = f"pose at {_rate(pose):.4g} Hz and wrench at {_rate(wrench):.4g} Hz were joined on the clock of the "
    text += "pose" if keep_pose else "wrench"
    return text + (f"; {outside} samples that the other file does not cover were left out" if outside else "")


def _gaps(other: Columns, time: Float) -> list[str]:
    """A note where samples were interpolated across a gap of the other file."""
    step = np.diff(other["t"])
    wide = np.flatnonzero(step > GAP * np.median(step))
    wide = wide[(other["t"][wide + 1] > time[0]) & (other["t"][wide] < time[-1])]
    if not wide.size:
        return []
    return [f"{wide.size} gaps of up to {step[wide].max():.3g} s in {other.source} were bridged by interpolation"]


def interpolate(columns: Columns, time: Float) -> dict[str, Float]:
    """Every column at other times inside its clock. Attitudes turn along the shortest rotation."""
    clock = columns["t"]
    before = np.searchsorted(clock, time, side="right") - 1
    result = {
        name: column[before] if _counts(name, column) else np.interp(time, clock, column)
        for name, column in columns.items()
        if name != "t"
    }
    if columns.has(QUATERNION):
        quaternion = slerp(clock, columns.stack(QUATERNION), time)
        result.update({name: quaternion[:, i] for i, name in enumerate(QUATERNION)})
    return result


def _counts(name: str, column: Float) -> bool:
    """Whether a further column holds whole numbers, labels for example, which are held instead of interpolated."""
    return name not in KNOWN and bool(np.all(column == np.round(column)))


def within(time: Float, start: float | None, stop: float | None) -> NDArray[np.bool_]:
    """Mask (T,) of start <= t <= stop, None for no limit."""
    after = time >= (-np.inf if start is None else start)
    return np.asarray(after & (time <= (np.inf if stop is None else stop)))


def slerp(clock: Float, quaternion: Float, time: Float) -> Float:
    """Quaternions (T', 4) at `time` (T',), interpolated along the shortest rotation between samples (T, 4)."""
    left = np.clip(np.searchsorted(clock, time, side="right") - 1, 0, len(clock) - 2)
    share = ((time - clock[left]) / (clock[left + 1] - clock[left]))[:, None]
    rotation = matrix_from_quaternion(quaternion)
    first = rotation[left]
    turn = rotation_vector(np.swapaxes(first, -1, -2) @ rotation[left + 1])
    return quaternion_from_matrix(first @ rotation_matrix(share * turn))

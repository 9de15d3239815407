r"""Makes a `Demonstration` of named columns, with every refusal. All readers use it.

Joins pose and wrench from two files with two clocks over their common interval.

One clock's samples are kept, and the other file is interpolated at them: linearly for positions and wrenches, along the
shortest rotation for orientations, \(R(s) = R_0 \exp(s \log(R_0^T R_1))\); whole numbers of further columns are held.
Files are paired row by row only if both are given a rate instead of a clock.

Rows that share a stamp: identical rows are left out, others are spread in time.

A logger that is faster than its clock, or reads a controller twice, writes several rows with one stamp. n rows with
stamp \(t\), before the next \(t'\), get \(t + k \min((t' - t) / n, h)\), k = 0 ... n - 1, where h is the median of
\((t' - t) / n\) over all rows, for gaps. At the beginning they end one step before \(t'\), as a recording may begin in
the middle of a stamp. Time that runs back is refused (`checks`).

Tools that plot topics export one table with pose and wrench on clocks of their own: each row has one topic's stamp and
values. Such a table is split and joined like two files if the pose or the wrench is empty in a tenth of the rows or
more. The same is done to shift a wrench in time.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skillframe.demonstration import checks
from skillframe.demonstration.checks import GAP, refuse_contradiction
from skillframe.demonstration.columns import (
    CANONICAL,
    EULER,
    FORCE,
    KNOWN,
    MATRIX,
    POSITION,
    QUATERNION,
    ROTATION_VECTOR,
    TORQUE,
    WRENCH,
    Columns,
    name_columns,
    select_arm,
    with_quaternion,
)
from skillframe.demonstration.convention import UNMEASURED, declared_wrench, to_standard
from skillframe.demonstration.faults import fault
from skillframe.demonstration.faults.find import remembered
from skillframe.demonstration.options import ReadOptions, check_meta, nested
from skillframe.demonstration.record import Demonstration, resolve_point
from skillframe.demonstration.stalls import moved as moved_stalls
from skillframe.demonstration.table import read_table
from skillframe.errors import InputError
from skillframe.frames import (
    Float,
    matrix_from_quaternion,
    slerp,
)

NOTES = "reading"
"""Metadata key of the list of sentences on what reading changed."""
JOIN_MARGIN = 1.0
"""Seconds kept beyond a cut until two files are joined."""


def assemble(
    columns: Columns, meta: Mapping[str, Any], options: ReadOptions, notes: list[str], wrench: Columns | None = None
) -> Demonstration:
    """Make a demonstration of named columns in SI units, with the wrench perhaps on its own clock.

    Raises:
        InputError: anything of the contract's list of bad input.
    """
    meta = nested(meta)
    source = columns.source
    check_meta(source, meta)
    checks.refuse_w_first_meta(source, meta)
    rate = options.rate or _meta_rate(source, meta, columns)
    pose = _clocked(select_arm(columns, options.arm), rate, notes)
    zero = -float(pose["t"][0]) if options.zero_time else 0.0  # one shift for both files
    meta = fault.moved(moved_stalls(meta, zero, source), zero, source)
    if not pose.has(QUATERNION):
        meta = {**meta, "quaternion": "xyzw"}  # computed here, so its order is known
    pose = _checked_pose(_shifted(pose, zero), options, notes)
    if wrench is None:
        pose, meta = _three_axes(pose, meta)
    else:
        wrench, meta = _three_axes(wrench, meta)
        pose = join(pose, _checked_wrench_file(wrench, options, rate, zero, notes), options, notes)
    if not pose.has(WRENCH):
        given = any(name in pose for name in WRENCH) or _alike(pose)
        advice = "" if given else "name its columns, or give the wrench's own file with --set wrench"
        checks.refuse_missing(pose, WRENCH, "wrench", advice)
    pose = _cut(pose, options)
    checks.refuse_not_finite(pose)
    checks.refuse_dead_wrench(pose, meta)
    checks.refuse_jumps(pose)
    quaternion = pose.stack(QUATERNION)
    rotation = matrix_from_quaternion(quaternion)
    declared = declared_wrench(source, meta, options)
    refuse_contradiction(pose, rotation, declared)
    standard, said, more = to_standard(pose.stack(WRENCH), rotation, declared, meta, source)
    notes = list(dict.fromkeys([*meta.get(NOTES, []), *notes, *more]))
    meta = {**meta, **({"wrench": said} if said else {}), **({NOTES: notes} if notes else {})}
    meta = remembered(pose["t"], pose.stack((*POSITION, *QUATERNION)), pose.stack(WRENCH), meta, source)
    return Demonstration(
        time=pose["t"], position=pose.stack(POSITION), quaternion=quaternion, wrench=standard, meta=meta,
        extra={n: v for n, v in pose.items() if n not in CANONICAL}, source=source,
    )  # fmt: skip


def _three_axes(columns: Columns, meta: dict[str, Any]) -> tuple[Columns, dict[str, Any]]:
    """Columns and metadata of a sensor of forces only: zero torques, marked as unmeasured."""
    if not columns.has(FORCE) or any(name in columns for name in TORQUE) or _alike(columns):
        return columns, meta
    zero = np.zeros(len(columns[FORCE[0]]))
    unmeasured = sorted({*meta.get(UNMEASURED, ()), *TORQUE})
    return columns.with_values({**columns, **dict.fromkeys(TORQUE, zero)}), {**meta, UNMEASURED: unmeasured}


def _alike(columns: Columns) -> bool:
    return any(name not in KNOWN and checks.alias(name) in KNOWN for name in columns)


def _meta_rate(source: str, meta: Mapping[str, Any], columns: Columns) -> float | None:
    rate = meta.get("rate")
    if rate is None:
        return None
    if isinstance(rate, bool) or not isinstance(rate, int | float) or not 0.0 < rate < np.inf:
        raise InputError(f"{source}: rate", f"is no sample rate: {rate!r}", "give samples per second")
    return None if "t" in columns else float(rate)


def _clocked(columns: Columns, rate: float | None, notes: list[str]) -> Columns:
    count = len(next(iter(columns.values()), np.empty(0)))
    if rate is not None:
        if "t" in columns:
            notes.append(f"the clock was replaced by {rate:g} Hz")
        columns = columns.with_values({**columns, "t": np.arange(count) / rate})
    checks.refuse_missing(
        columns,
        ["t"],
        "time column",
        "" if _alike(columns) else "give the sample rate with --set rate, or add a column t",
    )
    if not np.all(np.isfinite(columns["t"])):
        checks.refuse_not_finite(columns.with_values({"t": columns["t"]}))
    checks.refuse_bad_clock(columns)
    return one_stamp_a_row(columns, notes)


def _shifted(columns: Columns, seconds: float) -> Columns:
    return columns.with_values({**columns, "t": columns["t"] + seconds}) if seconds else columns


def _checked_pose(columns: Columns, options: ReadOptions, notes: list[str]) -> Columns:
    if options.position is not None and not columns.has(POSITION):
        point = resolve_point(options.position, {})
        held = {name: np.full(len(columns["t"]), value) for name, value in zip(POSITION, point, strict=True)}
        columns = columns.with_values({**columns, **held})
        notes.append(f"the tool point was held at {options.position} m, since the file holds none")
    checks.refuse_missing(columns, POSITION, "position")
    columns = _cut(columns, options, JOIN_MARGIN if options.wrench is not None else 0.0)
    columns = with_quaternion(columns, options.euler)
    checks.refuse_missing(columns, QUATERNION, "orientation")
    checks.refuse_not_finite(columns)
    return checks.checked_quaternions(columns, notes)


def _checked_wrench_file(
    columns: Columns, options: ReadOptions, rate: float | None, zero: float, notes: list[str]
) -> Columns:
    rate = options.wrench_rate or (rate if "t" not in columns else None)
    columns = _shifted(_clocked(columns, rate, notes), zero + options.wrench_shift)
    advice = "" if _alike(columns) else "name its columns with --set wrench-columns"
    checks.refuse_missing(columns, WRENCH, "wrench", advice)
    columns = _cut(columns.with_values({name: columns[name] for name in ("t", *WRENCH)}), options, JOIN_MARGIN)
    checks.refuse_not_finite(columns)
    return columns


def _cut(columns: Columns, options: ReadOptions, margin: float = 0.0) -> Columns:
    """The rows between `start` and `stop`, and a margin [s]. Rows outside are not checked.

    Raises:
        InputError: fewer than two rows are left.
    """
    if options.start is None and options.stop is None:
        return columns
    time = columns["t"]
    start, stop = options.start, options.stop
    keep = within(time, None if start is None else start - margin, None if stop is None else stop + margin)
    if keep.sum() < 2:
        asked = f"{'the start' if start is None else f'{start:g} s'} to {'the end' if stop is None else f'{stop:g} s'}"
        raise InputError(
            columns.source, f"no samples from {asked} (it spans {time[0]:.6g} to {time[-1]:.6g} s)",
            "choose --set from and --set to inside the recording",
        )  # fmt: skip
    return columns.where(keep)


def join(pose: Columns, wrench: Columns, options: ReadOptions, notes: list[str]) -> Columns:
    """Both files' columns on one clock.

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
            "check the units of time (--set units, --set wrench-units), or move its clock with --set wrench-shift",
        )  # fmt: skip
    time = kept["t"][inside]
    found = interpolate(other, time)
    own = {name: column[inside] for name, column in kept.items()}
    first, second = (own, found) if keep_pose else (found, own)
    joined = {**{k: v for k, v in first.items() if k not in WRENCH}, **second, "t": time}
    text = f"pose at {_rate(pose):.4g} Hz and wrench at {_rate(wrench):.4g} Hz were joined on the clock of the "
    notes.append(text + ("pose" if keep_pose else "wrench"))
    notes += [*_left_out(pose, "pose", time, options), *_left_out(wrench, "wrench", time, options)]
    step = np.diff(other["t"])
    wide = np.flatnonzero(step > GAP * np.median(step))
    wide = wide[(other["t"][wide + 1] > time[0]) & (other["t"][wide] < time[-1])]
    if wide.size:
        text = f"{wide.size} gaps of up to {step[wide].max():.3g} s in {other.source} were bridged by interpolation"
        notes.append(text)
    return kept.where(inside).with_values(joined)


def _rate(columns: Columns) -> float:
    return float(1.0 / np.median(np.diff(columns["t"])))


def _span(columns: Columns) -> str:
    return f"{columns['t'][0]:.6g} to {columns['t'][-1]:.6g} s"


def _left_out(columns: Columns, name: str, time: Float, options: ReadOptions) -> list[str]:
    clock = columns["t"][within(columns["t"], options.start, options.stop)]
    lost = 0.0 if not len(clock) else max(time[0] - clock[0], 0.0) + max(clock[-1] - time[-1], 0.0)
    if lost <= 1.0 / _rate(columns) + float(np.median(np.diff(time))):
        return []
    return [
        f"{lost:.3g} of the {clock[-1] - clock[0]:.3g} s of the {name} were left out: the other file lasts no longer"
    ]


def interpolate(columns: Columns, time: Float) -> dict[str, Float]:
    """All columns at other times inside their clock."""
    clock = columns["t"]
    before = np.searchsorted(clock, time, side="right") - 1
    result = {
        name: column[before]
        if (name not in KNOWN and bool(np.all(column == np.round(column))))
        else np.interp(time, clock, column)
        for name, column in columns.items()
        if name != "t"
    }
    if columns.has(QUATERNION):
        quaternion = slerp(clock, columns.stack(QUATERNION), time)
        result.update({name: quaternion[:, i] for i, name in enumerate(QUATERNION)})
    return result


def within(time: Float, start: float | None, stop: float | None) -> NDArray[np.bool_]:
    """Mask (T,) of start <= t <= stop. None is no limit."""
    after = time >= (-np.inf if start is None else start)
    return np.asarray(after & (time <= (np.inf if stop is None else stop)))


def one_stamp_a_row(columns: Columns, notes: list[str]) -> Columns:
    """The same rows with increasing stamps, with notes on what was left out and spread."""
    if np.all(np.diff(columns["t"]) > 0.0):
        return columns
    values = columns.stack([name for name in columns if name in KNOWN])
    same = (values[1:] == values[:-1]) | (np.isnan(values[1:]) & np.isnan(values[:-1]))
    twice = np.concatenate([[False], np.all(same, axis=1)])
    if twice.any():
        notes.append(
            f"{columns.source}: {twice.sum()} samples stood twice, with the same stamp and values: one of each was kept"
        )
        columns = columns.where(~twice)
    shared = int((np.diff(columns["t"]) == 0.0).sum())
    if shared:
        most = int(np.unique(columns["t"], return_counts=True)[1].max())
        notes.append(
            f"{columns.source}: {shared} samples had the stamp of the one before them: up to {most} of one stamp were "
            "spread over the time until the next"
        )
        columns = columns.with_values({**columns, "t": spread(columns["t"])})
    return columns


def spread(time: Float) -> Float:
    """Increasing stamps (T,) from stamps that do not run back. Unshared ones stay."""
    first = np.flatnonzero(np.r_[True, np.diff(time) > 0.0])
    if len(first) in (1, len(time)):
        return time
    count = np.diff(np.r_[first, len(time)])
    step = np.diff(time[first]) / count[:-1]
    pace = float(np.median(np.repeat(step, count[:-1])))
    step = np.minimum(np.r_[step, pace], pace)
    result: Float = time + (np.arange(len(time)) - np.repeat(first, count)) * np.repeat(step, count)
    if count[0] > 1:
        result[: count[0]] = time[first[1]] - np.arange(count[0], 0, -1) * step[0]
    return result


POSE = (*POSITION, *QUATERNION, *EULER, *ROTATION_VECTOR, *MATRIX)


def assemble_split(
    columns: Columns, meta: Mapping[str, Any], options: ReadOptions, notes: list[str], wrench: Columns | None = None
) -> Demonstration:
    """A demonstration from a table whose pose and wrench may have clocks of their own. Arguments as `assemble`."""
    if wrench is None:
        chosen = select_arm(columns, options.arm)
        parts = _sparse(chosen, notes)
        if parts is None and options.wrench_shift and chosen.has(("t", *WRENCH)):
            own = {name: chosen[name] for name in ("t", *WRENCH)}
            others = {name: column for name, column in chosen.items() if name not in WRENCH}
            parts = chosen.with_values(others), chosen.with_values(own)
        if parts is not None:
            columns, wrench = parts
            options = replace(options, arm=None, wrench=Path(columns.source))  # so that cuts keep a margin until joined
    return assemble(columns, meta, options, notes, wrench)


def read_wrench_file(options: ReadOptions) -> Columns | None:
    """The columns of the separate wrench file, or None.

    Without header and names, six columns are fx ... tz, and seven have the time before them.
    """
    if options.wrench is None:
        return None
    table = read_table(options.wrench)
    spec = options.wrench_columns
    if spec is None and not table.names:
        spec = {6: ",".join(WRENCH), 7: ",".join(("t", *WRENCH))}.get(table.values.shape[1])
    return name_columns(table, spec, options.wrench_units or options.units)


def _sparse(columns: Columns, notes: list[str]) -> tuple[Columns, Columns] | None:
    """Pose and wrench of a sparse table, each with its own rows, or None for another table.

    Raises:
        InputError: a row holds a part of the pose or of the wrench.
    """
    groups = [[name for name in names if name in columns] for names in (POSE, WRENCH)]
    if not all(groups) or "t" not in columns:
        return None
    empty = [np.isnan(columns.stack(names)) for names in groups]
    rows = [np.any(~each, axis=1, keepdims=True)[:, 0] for each in empty]
    if min(each.sum() for each in rows) < 2 or min(each.mean() for each in rows) > 0.9:
        return None
    for names, each, some in zip(groups, empty, rows, strict=True):
        for row, column in np.argwhere(each & some[:, None])[:1]:
            raise InputError(
                columns.place(int(row), names[column]), "is empty, while other cells of the row are not",
                "export each topic's values together, or fill the cell",
            )  # fmt: skip
    pose, wrench = (int(each.sum()) for each in rows)
    notes.append(f"pose stands in {pose} rows and wrench in {wrench} of {len(columns['t'])}: joined on time")
    others = {n: v for n, v in columns.items() if n not in WRENCH and not np.isnan(v[rows[0]]).any()}
    own = {name: columns[name] for name in ("t", *groups[1])}
    return columns.with_values(others).where(rows[0]), columns.with_values(own).where(rows[1])

"""From named columns to a `Demonstration`: the one path that every reader takes, with every refusal on it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from skillframe.demonstration import checks, stalls
from skillframe.demonstration.columns import (
    CANONICAL,
    KNOWN,
    POSITION,
    QUATERNION,
    WRENCH,
    Columns,
    select_arm,
    with_quaternion,
)
from skillframe.demonstration.contradiction import refuse_contradiction
from skillframe.demonstration.convention import declared_wrench, to_standard
from skillframe.demonstration.faults import fault
from skillframe.demonstration.faults.find import remembered
from skillframe.demonstration.join import join, within
from skillframe.demonstration.metafile import check_meta, nested
from skillframe.demonstration.options import ReadOptions
from skillframe.demonstration.record import Demonstration, resolve_point
from skillframe.errors import InputError
from skillframe.frames import matrix_from_quaternion

NOTES = "reading"
"""Metadata key of the list of sentences about what was done at reading."""
JOIN_MARGIN = 1.0
"""Seconds kept beyond a cut until two files are joined."""


def assemble(
    columns: Columns, meta: Mapping[str, Any], options: ReadOptions, notes: list[str], wrench: Columns | None = None
) -> Demonstration:
    """A demonstration from one file's columns, or two.

    Args:
        columns: named, in SI units; pose and, unless `wrench` is given, wrench.
        meta: as read.
        options: reading settings.
        notes: sentences so far about what was done.
        wrench: a second file's columns on its own clock.

    Raises:
        InputError: anything of the contract's list of bad input.
    """
    meta = nested(meta)
    source = columns.source
    check_meta(source, meta)
    checks.refuse_w_first_meta(source, meta)
    rate = options.rate or _meta_rate(source, meta, columns)
    pose = _clocked(select_arm(columns, options.arm), rate, notes)
    zero = -float(pose["t"][0]) if options.zero_time else 0.0  # one shift for both files: their clocks stay together
    meta = fault.moved(stalls.moved(meta, zero, source), zero, source)
    pose = _checked_pose(_shifted(pose, zero), options, notes)
    if wrench is not None:
        pose = join(pose, _checked_wrench_file(wrench, options, rate, zero, notes), options, notes)
    else:
        given = any(name in pose for name in WRENCH) or _alike(pose)
        advice = "" if given else "name its columns, or give the wrench's own file with --wrench"
        checks.refuse_missing(pose, WRENCH, "wrench", advice)
    pose = _cut(pose, options)
    checks.refuse_not_finite(pose)
    checks.refuse_dead_wrench(pose, meta)
    checks.refuse_jumps(pose)
    return _finish(pose, meta, options, notes)


def _alike(columns: Columns) -> bool:
    return any(name not in KNOWN and checks.alias(name) in KNOWN for name in columns)


def _meta_rate(source: str, meta: Mapping[str, Any], columns: Columns) -> float | None:
    """The metadata's rate, which counts only where there is no clock."""
    rate = meta.get("rate")
    if rate is None:
        return None
    if isinstance(rate, bool) or not isinstance(rate, int | float) or not 0.0 < rate < np.inf:
        raise InputError(f"{source}: rate", f"is no sample rate: {rate!r}", "give samples per second")
    return None if "t" in columns else float(rate)


def _clocked(columns: Columns, rate: float | None, notes: list[str]) -> Columns:
    """Columns with a sound clock: the file's own, or one made from the rate."""
    count = len(next(iter(columns.values()), np.empty(0)))
    if rate is not None:
        if "t" in columns:
            notes.append(f"the clock was replaced by {rate:g} Hz")
        columns = columns.with_values({**columns, "t": np.arange(count) / rate})
    checks.refuse_missing(
        columns, ["t"], "time column", "" if _alike(columns) else "give the sample rate with --rate, or add a column t"
    )
    if not np.all(np.isfinite(columns["t"])):
        checks.refuse_not_finite(columns.with_values({"t": columns["t"]}))
    checks.refuse_bad_clock(columns)
    return columns


def _shifted(columns: Columns, seconds: float) -> Columns:
    return columns.with_values({**columns, "t": columns["t"] + seconds}) if seconds else columns


def _checked_pose(columns: Columns, options: ReadOptions, notes: list[str]) -> Columns:
    """Columns with position and unit quaternion."""
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
    """The separate file's clock and wrench, on the pose's zero."""
    rate = options.wrench_rate or (rate if "t" not in columns else None)
    columns = _shifted(_clocked(columns, rate, notes), zero + options.wrench_shift)
    advice = "" if _alike(columns) else "name its columns with --wrench-columns"
    checks.refuse_missing(columns, WRENCH, "wrench", advice)
    columns = _cut(columns.with_values({name: columns[name] for name in ("t", *WRENCH)}), options, JOIN_MARGIN)
    checks.refuse_not_finite(columns)
    return columns


def _cut(columns: Columns, options: ReadOptions, margin: float = 0.0) -> Columns:
    """The rows between `start` and `stop`, and a margin [s]. What lies outside is never judged.

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
            "choose --from and --to inside the recording",
        )  # fmt: skip
    rows = None if columns.rows is None else np.asarray(columns.rows)[keep].tolist()
    return Columns({name: column[keep] for name, column in columns.items()}, columns.source, rows)


def _finish(columns: Columns, meta: dict[str, Any], options: ReadOptions, notes: list[str]) -> Demonstration:
    """The wrench into the convention, and the record."""
    source = columns.source
    quaternion = columns.stack(QUATERNION)
    rotation = matrix_from_quaternion(quaternion)
    declared = declared_wrench(source, meta, options)
    refuse_contradiction(columns, rotation, declared)
    wrench, said, more = to_standard(columns.stack(WRENCH), rotation, declared, meta, source)
    notes = list(dict.fromkeys([*meta.get(NOTES, []), *notes, *more]))
    meta = {**meta, **({"wrench": said} if said else {}), **({NOTES: notes} if notes else {})}
    pose = columns.stack((*POSITION, *QUATERNION))
    meta = remembered(columns["t"], pose, columns.stack(WRENCH), meta, source)
    return Demonstration(
        time=columns["t"], position=columns.stack(POSITION), quaternion=quaternion, wrench=wrench, meta=meta,
        extra={n: v for n, v in columns.items() if n not in CANONICAL}, source=source,
    )  # fmt: skip

r"""Refusals: what no reader accepts, each with file, row or channel and what to do.

Orientation is judged as rotation, never by raw angles, because Euler angles jump at gimbal lock while the tool turns
smoothly, and a wrong order makes the tool jump. The tool jumps if it turns by more than \(\max(2^\circ, 10\,\Delta t)\)
(10 rad/s) within 5 ms (or one sample, if samples are farther apart), or, at low rates, by more than 20 degrees in one
sample and ten times faster than in the three samples before and after. Our choice, because nobody teaches a robot at
570 degrees a second, and a snap assembly read in ten wrong orders turned at 830 to 11 600.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from skillframe.demonstration.columns import ALIASES, KNOWN, QUATERNION, WRENCH, Columns
from skillframe.errors import InputError
from skillframe.frames import Float, matrix_from_quaternion, norm, rotation_vector

NORM_REFUSED = 0.01
LARGEST = 1e100
"""Beyond it squares overflow; clocks in nanoseconds are at 1e18."""
JUMP_WINDOW, JUMP_RATE, JUMP_ANGLE = 5e-3, 10.0, np.deg2rad(2.0)
LONE_ANGLE, LONE_RATIO, NEIGHBOURS = np.deg2rad(20.0), 10.0, 3
GAP = 3.0
"""A step of the clock this many times the median is a gap, across which nothing is judged as one sample."""


def alias(name: str) -> str:
    """What a header's name is probably meant to be: a familiar other name, or capitals for small letters."""
    small = name.strip().lower()
    return ALIASES.get(small, small)


def refuse_missing(columns: Columns, names: Iterable[str], what: str, advice: str = "") -> None:
    """Refuse a file without these columns. Suggests what a look-alike is probably meant to be."""
    missing = [name for name in names if name not in columns]
    if not missing:
        return
    native = columns.rows is None and columns.source.endswith(".npz")
    meant = {} if native else {name: alias(name) for name in columns if alias(name) in KNOWN and name not in KNOWN}
    fix = advice or ("store them as arrays" if native else "correct the header, or name the columns with --columns")
    if said := [f"{name} is {new}" for name, new in meant.items() if new in missing]:
        fix = f"if {', '.join(said)}, type --columns {','.join(meant.get(name, name) for name in columns)}"
    raise InputError(columns.source, f"has no {what} ({', '.join(missing)} missing)", fix)


def refuse_not_finite(columns: Columns) -> None:
    """Refuse NaN and infinity in every column that has a meaning. Other columns may hold gaps."""
    for name in (n for n in KNOWN if n in columns):
        bad = np.flatnonzero(~np.isfinite(columns[name]))
        beyond = np.flatnonzero(np.abs(columns[name]) > LARGEST)
        if beyond.size and not bad.size:
            raise InputError(
                columns.place(int(beyond[0]), name), f"is {columns[name][beyond[0]]:g}, which nothing measures",
                f"remove or fix the row ({beyond.size} like it in this column)",
            )  # fmt: skip
        if bad.size:
            raise InputError(
                columns.place(int(bad[0]), name), f"is not a finite number ({columns[name][bad[0]]})",
                f"remove or fix the row ({bad.size} like it in this column)",
            )  # fmt: skip


def refuse_bad_clock(columns: Columns) -> None:
    """Refuse a clock that stands still or runs back, and one row alone."""
    time = columns["t"]
    if len(time) < 2:
        raise InputError(columns.source, "has only one row", "a demonstration needs at least two samples")
    if np.all(time == time[0]):
        raise InputError(
            columns.source,
            f"every time stamp is {time[0]:g}",
            "give the sample rate with --rate, which replaces the clock",
        )
    back = np.flatnonzero(np.diff(time) <= 0.0)
    if back.size:
        row = int(back[0]) + 1
        raise InputError(
            columns.place(row, "t"), f"time does not increase ({time[row]:.9g} after {time[row - 1]:.9g})",
            f"sort or remove the row ({back.size} like it), or replace the clock with --rate",
        )  # fmt: skip


def refuse_w_first_header(source: str, names: Iterable[str]) -> None:
    """Refuse a header whose quaternion starts with w: files are x, y, z, w."""
    order = [name.rpartition("_")[2] for name in names if name.rpartition("_")[2] in QUATERNION]
    if order and order[0] == "qw":
        raise InputError(
            source,
            "the header says that quaternions are w-first",
            "store them as qx,qy,qz,qw, or say so with --columns",
        )


def refuse_w_first_meta(source: str, meta: Mapping[str, Any], path: str = "") -> None:
    """Refuse metadata that says that quaternions are w-first, or in another order than x, y, z, w."""
    for key, value in meta.items():
        name = f"{path}{key}"
        if isinstance(value, Mapping):
            refuse_w_first_meta(source, value, f"{name}.")
        said = "".join(c for c in str(value).lower() if c.isalnum())
        about = "quat" in name.lower() or "orientation" in name.lower() or "rotation" in name.lower()
        flag = "".join(c for c in str(key).lower() if c.isalpha()) in ("wfirst", "scalarfirst", "quaternionwfirst")
        said_w = about and any(w in said for w in ("wxyz", "wfirst", "scalarfirst", "qwqxqyqz"))
        if about and sorted(said) == list("wxyz") and said[0] != "w" and said != "xyzw":
            raise InputError(
                f"{source}: {name}", f"says that quaternions are in the order {value}", "store qx,qy,qz,qw and say xyzw"
            )
        if said_w or (flag and value is True):
            raise InputError(
                f"{source}: {name}",
                f"says that quaternions are w-first ({value})",
                "store them as qx,qy,qz,qw and say xyzw",
            )


def checked_quaternions(columns: Columns, notes: list[str]) -> Columns:
    """Columns with unit quaternions: norms a little off are scaled and noted, others refused."""
    q = columns.stack(QUATERNION)
    length = norm(q)
    worst = int(np.argmax(np.abs(length - 1.0)))
    if abs(length[worst] - 1.0) > NORM_REFUSED:
        raise InputError(
            columns.place(worst), f"the quaternion's norm is {length[worst]:.4f}",
            "check that qx,qy,qz,qw are the right columns, or normalise them",
        )  # fmt: skip
    if abs(length[worst] - 1.0) > 1e-5:
        notes.append(f"quaternion norms from {length.min():.6f} to {length.max():.6f} were scaled to 1")
    off = np.abs(length - 1.0) > 1e-12  # unit ones stay bit for bit
    q[off] /= length[off, None]
    return columns.with_values({**columns, **{name: q[:, i] for i, name in enumerate(QUATERNION)}})


def refuse_jumps(columns: Columns) -> None:
    """Refuse attitudes that no hand could have turned through."""
    rotation = matrix_from_quaternion(columns.stack(QUATERNION))
    time = columns["t"]
    found = _fast(rotation, time)
    if found is None:
        found = _lone(rotation, time)
    if found is not None:
        row, angle = found
        raise InputError(
            columns.place(row), f"the orientation jumps by {np.rad2deg(angle):.1f} degrees",
            "check the Euler order (--euler), the unit of angles (--units deg) and the columns' order",
        )  # fmt: skip


def angles_between(rotation: Float, stride: int = 1) -> Float:
    """Angles (T - stride,) turned through within `stride` samples [rad]."""
    return norm(rotation_vector(np.swapaxes(rotation[:-stride], -1, -2) @ rotation[stride:]))


def _fast(rotation: Float, time: Float) -> tuple[int, float] | None:
    period = float(np.median(np.diff(time)))
    stride = int(np.clip(round(JUMP_WINDOW / period), 1, len(time) - 1))
    angle = angles_between(rotation, stride)
    allowed = np.maximum(JUMP_ANGLE, JUMP_RATE * (time[stride:] - time[:-stride]))
    bad = np.flatnonzero(angle > allowed)
    return (int(bad[0]) + stride, float(angle[bad[0]])) if bad.size else None


def _lone(rotation: Float, time: Float) -> tuple[int, float] | None:
    step = np.diff(time)
    angle = angles_between(rotation)
    speed = angle / step
    for i in np.flatnonzero((angle > LONE_ANGLE) & (step < GAP * np.median(step))):
        near = np.r_[speed[max(0, i - NEIGHBOURS) : i], speed[i + 1 : i + 1 + NEIGHBOURS]]
        if near.size and speed[i] > LONE_RATIO * near.max():
            return int(i) + 1, float(angle[i])
    return None


def refuse_dead_wrench(columns: Columns, meta: Mapping[str, Any]) -> None:
    """Refuse a wrench that is exactly constant, unless the metadata says that there is no contact."""
    wrench = columns.stack(WRENCH)
    if meta.get("contact") is False or np.any(wrench != wrench[0]):
        return
    what = "zero" if not np.any(wrench) else "constant"
    raise InputError(
        f"{columns.source}: columns fx ... tz", f"the wrench is exactly {what} throughout",
        "check the sensor's connection; if there was no contact on purpose, say contact = false in the metadata",
    )  # fmt: skip

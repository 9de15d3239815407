r"""What every reader refuses, with file, row or channel and advice.

Orientations are judged as rotations, since Euler angles jump at gimbal lock. The tool jumps if it turns by more than
\(\max(2^\circ, 10\,\Delta t)\) (10 rad/s) within 5 ms (or one sample, if longer), or by more than 20 degrees in one
sample and ten times faster than in the three samples before and after.

A declared wrench frame is refused if the data contradict it, by two signatures:

- Weight and bias. A sensor on a turning tool has a bias fixed in the tool and a weight fixed in base: in tool axes
  \(F = b + R^T w\), in base axes \(F = w + R b\). Both are fitted robustly, at even steps of rotation, to growing
  shares of the recording, since contact comes late. The declared frame is refused if in one of them its median residual
  exceeds 0.5 N and five times the other's, and the other model explains the force. A weight that is declared to be in
  the wrench must also turn in tool axes and stand still in base axes.
- Work. A passive environment cannot push the tool along. Over the motion in contact, with
  \(c = \int F \cdot dx / \int |F| |dx|\), the declared frame is refused if its c is above 0.3 and the other's below
  -0.3, both for the wrench as it is and less its mean of the first 0.25 s, as it may hold a bias.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np

from skillframe.demonstration.columns import ALIASES, FORCE, KNOWN, POSITION, QUATERNION, WRENCH, Columns
from skillframe.errors import InputError
from skillframe.frames import Float, matrix_from_quaternion, norm, rotate, rotation_vector

GAP = 3.0
"""A step of the clock longer than this many medians is a gap, and not judged as one sample."""


def alias(name: str) -> str:
    """The column name that a header's name probably means: a known alias, or lower case."""
    small = name.strip().lower()
    return ALIASES.get(small, small)


def refuse_missing(columns: Columns, names: Iterable[str], what: str, advice: str = "") -> None:
    """Refuse a file without these columns. The message names likely aliases."""
    missing = [name for name in names if name not in columns]
    if not missing:
        return
    native = columns.rows is None and columns.source.endswith(".npz")
    meant = {} if native else {name: alias(name) for name in columns if alias(name) in KNOWN and name not in KNOWN}
    fix = advice or ("store them as arrays" if native else "correct the header, or name the columns with --set columns")
    if said := [f"{name} may be {new}" for name, new in meant.items() if new in missing]:
        fix = f"{', '.join(said)}: add --layout auto, which proposes the whole line"
    raise InputError(columns.source, f"has no {what} ({', '.join(missing)} missing)", fix)


def refuse_not_finite(columns: Columns) -> None:
    """Refuse NaN and infinity in known columns. Other columns may hold gaps."""
    for name in (n for n in KNOWN if n in columns):
        bad = np.flatnonzero(~np.isfinite(columns[name]))
        beyond = np.flatnonzero(np.abs(columns[name]) > 1e100)  # squares of larger numbers overflow
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
    """Refuse a clock that stands still or runs back, and a single row. Rows may share a stamp (`repeats`)."""
    time = columns["t"]
    if len(time) < 2:
        raise InputError(columns.source, "has only one row", "a demonstration needs at least two samples")
    if np.all(time == time[0]):
        raise InputError(
            columns.source,
            f"every time stamp is {time[0]:g}",
            "give the sample rate with --set rate, which replaces the clock",
        )
    back = np.flatnonzero(np.diff(time) < 0.0)
    if back.size:
        row = int(back[0]) + 1
        raise InputError(
            columns.place(row, "t"), f"time runs back ({time[row]:.9g} after {time[row - 1]:.9g})",
            f"sort or remove the row ({back.size} like it), or replace the clock with --set rate",
        )  # fmt: skip


def refuse_w_first_header(source: str, names: Iterable[str]) -> None:
    """Refuse a header whose quaternion starts with w. The order is x, y, z, w."""
    order = [name.rpartition("_")[2] for name in names if name.rpartition("_")[2] in QUATERNION]
    if order and order[0] == "qw":
        raise InputError(
            source,
            "the header says that quaternions are w-first",
            "store them as qx,qy,qz,qw, or say so with --set columns",
        )


def refuse_w_first_meta(source: str, meta: Mapping[str, Any], path: str = "") -> None:
    """Refuse metadata that declare another quaternion order than x, y, z, w."""
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
    """Columns with unit quaternions: norms up to 0.01 off 1 are scaled with a note, others refused."""
    q = columns.stack(QUATERNION)
    length = norm(q)
    worst = int(np.argmax(np.abs(length - 1.0)))
    if abs(length[worst] - 1.0) > 0.01:
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
    """Refuse orientations that jump."""
    rotation = matrix_from_quaternion(columns.stack(QUATERNION))
    time = columns["t"]
    found = _fast(rotation, time)
    if found is None:
        found = _lone(rotation, time)
    if found is not None:
        row, angle = found
        raise InputError(
            columns.place(row), f"the orientation jumps by {np.rad2deg(angle):.1f} degrees",
            "check the Euler order (--set euler), the unit of angles (--set units=deg) and the columns' order",
        )  # fmt: skip


def angles_between(rotation: Float, stride: int = 1) -> Float:
    """Rotation angles (T - stride,) within `stride` samples [rad]."""
    return norm(rotation_vector(np.swapaxes(rotation[:-stride], -1, -2) @ rotation[stride:]))


def _fast(rotation: Float, time: Float) -> tuple[int, float] | None:
    period = float(np.median(np.diff(time)))
    stride = int(np.clip(round(5e-3 / period), 1, len(time) - 1))  # 5 ms
    angle = angles_between(rotation, stride)
    allowed = np.maximum(np.deg2rad(2.0), 10.0 * (time[stride:] - time[:-stride]))  # 10 rad/s
    bad = np.flatnonzero(angle > allowed)
    return (int(bad[0]) + stride, float(angle[bad[0]])) if bad.size else None


def _lone(rotation: Float, time: Float) -> tuple[int, float] | None:
    step = np.diff(time)
    angle = angles_between(rotation)
    speed = angle / step
    for i in np.flatnonzero((angle > np.deg2rad(20.0)) & (step < GAP * np.median(step))):
        near = np.r_[speed[max(0, i - 3) : i], speed[i + 1 : i + 4]]
        if near.size and speed[i] > 10.0 * near.max():
            return int(i) + 1, float(angle[i])
    return None


def refuse_dead_wrench(columns: Columns, meta: Mapping[str, Any]) -> None:
    """Refuse an exactly constant wrench, unless metadata declare `contact = false`."""
    wrench = columns.stack(WRENCH)
    if meta.get("contact") is False or np.any(wrench != wrench[0]):
        return
    what = "zero" if not np.any(wrench) else "constant"
    raise InputError(
        f"{columns.source}: columns fx ... tz", f"the wrench is exactly {what} throughout",
        "check the sensor's connection; if there was no contact on purpose, say contact = false in the metadata",
    )  # fmt: skip


SHARES = (0.25, 0.5, 0.75, 1.0)  #: parts of a recording that are compared with the whole
LEAST_TURN = np.deg2rad(20.0)  #: of the tool, for its weight to show [rad]
LEAST_RESIDUAL, RESIDUAL_RATIO = 0.5, 5.0  #: of a fit of weight and bias [N], and to that of another convention
LEAST_PATH, WORK_COSINE = 0.02, 0.3  #: in contact [m], and cosine of force and motion: friction brakes
LEAST_WEIGHT, MOST_WEIGHT = 2.0, 981.0
"""Range of a tool's weight if none is declared [N]; more than 100 kg is a force, or another unit."""


class Turning(NamedTuple):
    """A tool's orientation (T, 3, 3) in base, and the torque on it (T, 3) at its point, base axes [N m]."""

    rotation: Float
    torque: Float


def refuse_contradiction(columns: Columns, rotation: Float, declared: Mapping[str, Any]) -> None:
    """Refuse a declared wrench frame that the data contradict.

    Args:
        columns: the file's, with the wrench as recorded.
        rotation: (T, 3, 3) tool orientation in base.
        declared: from `convention.declared_wrench`.

    Raises:
        InputError: with the evidence.
    """
    frame = declared.get("frame")
    if frame is None:
        return
    force = columns.stack(FORCE)
    evidence = weight_evidence(force, rotation, frame, bool(declared.get("includes_tool_weight")))
    if evidence is None and not declared.get("includes_tool_weight"):
        sign = -1.0 if declared.get("sign") == "teacher" else 1.0
        evidence = _work_evidence(columns.stack(POSITION), sign * force, rotation, columns["t"], frame)
    if evidence is not None:
        other = "tool" if frame == "base" else "base"
        raise InputError(
            f"{columns.source}: wrench.frame", f"says {frame!r}, but {evidence}",
            f"say {other!r} if the sensor's axes were mislabelled, or check wrench.sign and the pose's columns",
        )  # fmt: skip


def fit_weight_and_bias(force: Float, rotation: Float, frame: str) -> tuple[Float, float]:
    """Robust fit of \\(F = c + M d\\) with M = R^T (tool axes) or R (base axes).

    Returns:
        (6,) c and d [N], and the median residual [N].
    """
    matrix = rotation if frame == "base" else np.swapaxes(rotation, -1, -2)
    design = np.concatenate([np.broadcast_to(np.eye(3), matrix.shape), matrix], axis=-1)
    weight = np.ones(len(force))
    solution: Float = np.zeros(6)
    residual = norm(force)
    for _ in range(8):
        scaled = (design * weight[:, None, None]).reshape(-1, 6)
        solution = np.asarray(np.linalg.lstsq(scaled, (force * weight[:, None]).ravel(), rcond=1e-6)[0], dtype=float)
        residual = norm(force - design @ solution)
        weight = 1.0 / np.sqrt(np.maximum(residual, 1e-3 + 0.1 * np.median(residual)))
    return solution, float(np.median(residual))


def weight_evidence(force: Float, rotation: Float, frame: str, weighs: bool = False) -> str | None:
    """Evidence that forces (T, 3), declared to be in these axes, are in the others, or None."""
    pick = np.linspace(0, len(rotation) - 1, min(400, len(rotation))).round().astype(int)
    steps = norm(rotation_vector(np.swapaxes(rotation[pick[:-1]], -1, -2) @ rotation[pick[1:]]))
    turned = np.concatenate([[0.0], np.cumsum(steps)])
    # at even steps of rotation, as standing still shows no frame
    pick = pick[np.searchsorted(turned, np.linspace(0.0, turned[-1], len(pick)), side="right") - 1]
    force, rotation = force[pick], rotation[pick]
    other = "tool" if frame == "base" else "base"
    for share in SHARES:
        part = slice(0, max(2, round(share * len(force))))
        if norm(rotation_vector(rotation[0].T @ rotation[part])).max() < LEAST_TURN:
            continue
        ours = fit_weight_and_bias(force[part], rotation[part], frame)[1]
        theirs = fit_weight_and_bias(force[part], rotation[part], other)[1]
        spread = float(np.median(norm(force[part] - np.median(force[part], axis=0))))
        explained = theirs < max(LEAST_RESIDUAL, 0.05 * spread)
        if explained and ours > LEAST_RESIDUAL and ours > RESIDUAL_RATIO * theirs:
            return (
                f"weight and bias on the turning tool explain it in {other} axes to {theirs:.2f} N, "
                f"in {frame} axes only to {ours:.2f} N"
            )
        if weighs and (evidence := _still_weight(force[part], rotation[part], frame)) is not None:
            return evidence
    return None


def _still_weight(force: Float, rotation: Float, frame: str) -> str | None:
    """Evidence that a declared weight stands still in tool axes or turns in base axes, or None."""
    in_frame, in_other = force, rotate(rotation if frame == "tool" else np.swapaxes(rotation, -1, -2), force)
    spread, other_spread = (float(np.median(norm(f - np.median(f, axis=0)))) for f in (in_frame, in_other))
    if frame == "tool" and spread < 0.1 * other_spread and other_spread > LEAST_WEIGHT:
        return (
            f"the weight does not turn with the tool (spread {spread:.2f} N in tool axes, {other_spread:.2f} N in base)"
        )
    if frame == "base" and other_spread < 0.1 * spread and spread > LEAST_WEIGHT:
        return f"the weight turns in base axes (spread {spread:.2f} N there, {other_spread:.2f} N in tool axes)"
    return None


def work_cosine(position: Float, force: Float, time: Float, turning: Turning | None = None) -> tuple[float, float]:
    """Work of a force over the motion in contact, as a share of \\(\\int |F| |dx|\\), and that motion's length [m].

    Contact is where the force exceeds 3 N and 30 % of its 95th percentile; steps are taken at 20 Hz to suppress noise.
    With `turning`, work and share are those of the wrench, \\(\\int F \\cdot dx + T \\cdot d\\varphi\\) over
    \\(\\int |F| |dx| + |T| |d\\varphi|\\): where a tool levers, force and torque do opposite work.
    """
    stride = max(1, round(1.0 / (20.0 * float(np.median(np.diff(time))))))
    step = np.diff(position[::stride], axis=0)
    middle = force[::stride][: len(step)]
    strength = norm(middle)
    touching = strength > max(3.0, 0.3 * float(np.quantile(norm(force), 0.95)))
    length = norm(step)[touching]
    total = float((strength[touching] * length).sum())
    work = float((middle[touching] * step[touching]).sum())
    if turning is not None:
        orientation, torque = turning.rotation[::stride], turning.torque[::stride][: len(step)][touching]
        turn = rotate(orientation[:-1], rotation_vector(np.swapaxes(orientation[:-1], -1, -2) @ orientation[1:]))[
            touching
        ]
        total += float((norm(torque) * norm(turn)).sum())
        work += float((torque * turn).sum())
    return (work / total if total > 0.0 else 0.0), float(length.sum())


def _work_evidence(position: Float, force: Float, rotation: Float, time: Float, frame: str) -> str | None:
    evidence = None
    for level in (force[time <= time[0] + 0.25].mean(axis=0), np.zeros(3)):
        turned = rotate(rotation, force - level)
        in_base, wrong = (force - level, turned) if frame == "base" else (turned, force - level)
        ours, path = work_cosine(position, in_base, time)
        theirs, _ = work_cosine(position, wrong, time)
        if not (path > LEAST_PATH and ours > WORK_COSINE and theirs < -WORK_COSINE):
            return None
        evidence = (
            f"it would push the tool along (work {ours:+.0%} of |F||dx| over {path * 1e3:.0f} mm), "
            f"otherwise oppose it ({theirs:+.0%})"
        )
    return evidence

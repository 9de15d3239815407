"""Columns of a foreign header by content: clock, pose, wrench, velocities, acceleration.

Words and group sizes give the content (`names`). Measured groups precede desired ones; position, orientation and wrench
belong to one body. Fixed layouts: Franka's `O_T_EE` is a column-major 4x4 matrix, its `F_ext_hat` six numbers, in tool
axes with `K_`. A UR's `actual_TCP_pose` is position and rotation vector, `actual_TCP_force` is in base axes. KUKA's A,
B, C turn about moving z, y, x.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from skillframe.demonstration import EULER, FORCE, MATRIX, POSITION, QUATERNION, ROTATION_VECTOR, TORQUE, WRENCH, Table
from skillframe.frames import Float
from skillframe_recordings.proposal.names import (
    ACCELERATIONS,
    ANGLES,
    CLOCKS,
    FORCES,
    KUKA,
    NANOSECONDS,
    NO_MEANING,
    NOT_MEASURED,
    PLACES,
    POSES,
    SECONDS,
    SPEEDS,
    SPINS,
    TORQUES,
    TURNS,
    VECTORS,
    WRENCHES,
    Group,
    called,
    cut,
    groups_of,
    same_body,
)


class Picks(NamedTuple):
    """Columns by skillframe's names, and the table's bodies.

    Attributes:
        columns: index by name.
        body: name of their body; "" if there is only one.
        others: other bodies with a pose.
        numbered: whether quaternion columns are numbered, so that the header does not identify the scalar.
    """

    columns: dict[str, int]
    body: str = ""
    others: tuple[str, ...] = ()
    numbered: bool = False


def picks(names: Sequence[str], values: Float | None = None, arm: str | None = None) -> Picks:
    """Return a demonstration's columns that a header names, with orientations in the header's format.

    The body is the first with its own wrench, else the first.

    Args:
        names: the header.
        values: (T, C), which show the layout of 4x4 matrices, or None.
        arm: the body to read; None chooses.
    """
    groups = groups_of(names)
    found = {
        body: _pose([g for g in groups if g.body == body], values) for body in dict.fromkeys(g.body for g in groups)
    }
    poses = {body: pose for body, pose in found.items() if set(POSITION) <= pose.keys() and pose.keys() - {*POSITION}}
    titles = {body: called([names[pose[axis]] for axis in POSITION]) for body, pose in poses.items()}
    chosen = next((body for body, title in titles.items() if arm and same_body(title, arm)), None)
    own = [body for body in poses if set(FORCE) <= _wrench([g for g in groups if g.body == body]).keys()]
    body = chosen if chosen is not None else next(iter(own or poses), None)
    pose = poses[body] if body is not None else _pose(groups, values)
    others = [each for each in poses if each != body]
    theirs = [g for g in groups if g.body not in others]
    wrench = _wrench([g for g in groups if g.body == body]) if body in own else _wrench(theirs)
    four = [pose[name] for name in QUATERNION if name in pose]
    numbered = bool(four) and cut(names[four[0]])[1].isdigit()
    if numbered and cut(names[four[0]]) == (("q",), "0"):  # q0 ... q3, mostly scalar first
        pose = {**pose, **dict(zip(("qw", *QUATERNION[:3]), four, strict=True))}
    return Picks(
        {**_clock(groups), **pose, **wrench}, titles[body] if body is not None and others else "",
        tuple(titles[each] for each in others), numbered,
    )  # fmt: skip


def _clock(groups: Sequence[Group]) -> dict[str, int]:
    whole = [g for g in groups if "" in g.letters]
    seconds = next((g for g in whole if g.words[-1:] and g.words[-1] in SECONDS), None)
    parts = next((g for g in whole if g.words[-1:] and g.words[-1] in NANOSECONDS), None)
    if seconds is not None and parts is not None:
        return {"sec": seconds.columns[""], "nsec": parts.columns[""]}
    named = [g for g in whole if g.words and (g.words[-1] in CLOCKS | SECONDS or g.words[0] in CLOCKS)]
    header = [g for g in named if "stamp" in g.words or "header" in g.words]  # a message's stamp before its arrival
    best = (header or named)[:1]
    return {"t": best[0].columns[""]} if best else {}


def _measured(groups: Sequence[Group]) -> list[Group]:
    kept = [g for g in groups if not g.says(NO_MEANING)]
    return sorted(kept, key=lambda g: g.says(NOT_MEASURED))


def _pose(groups: Sequence[Group], values: Float | None) -> dict[str, int]:
    usable = [g for g in _measured(groups) if not g.says(SPEEDS | SPINS | ACCELERATIONS)]
    for group in usable:
        if found := _whole_pose(group, values):
            return found
    single = {g.words[-1]: g.columns[""] for g in groups if "" in g.letters and g.words and g.words[-1] in KUKA}
    kuka = {KUKA[letter]: index for letter, index in single.items()} if set(single) == set(KUKA) else {}
    return {**(_orientation(usable) or kuka), **_position(usable)}


def _whole_pose(group: Group, values: Float | None) -> dict[str, int]:
    """A numbered group that is a pose: matrix, or position with quaternion or rotation vector."""
    order = group.ordered()
    if len(order) == 16 and not (group.says({"f", "ne", "k"}) and not group.says({"o"})):
        return _homogeneous(order, values)
    if not group.says(POSES) or group.says(WRENCHES | FORCES | TORQUES):
        return {}
    if len(order) == 7:
        return dict(zip((*POSITION, *QUATERNION), order, strict=True))
    if len(order) == 6:
        return dict(zip((*POSITION, *ROTATION_VECTOR), order, strict=True))
    if len(order) == 12:
        return _matrix(order, by_rows=True)
    return {}


def _homogeneous(order: Sequence[int], values: Float | None) -> dict[str, int]:
    """A 4x4 matrix. Its last row, 0 0 0 1, shows row or column order."""
    if values is None:
        return _matrix(order, by_rows=False)
    sixteen = values[:, list(order)]
    rows = sixteen[np.all(np.isfinite(sixteen), axis=1)]
    last = (0.0, 0.0, 0.0, 1.0)
    if len(rows) and np.allclose(rows[:, [3, 7, 11, 15]], last, atol=1e-6):
        return _matrix(order, by_rows=False)
    return _matrix(order, by_rows=True) if len(rows) and np.allclose(rows[:, 12:], last, atol=1e-6) else {}


def _matrix(order: Sequence[int], by_rows: bool) -> dict[str, int]:
    """Rotation and position of a matrix of four columns, by rows, or of four rows, by columns."""
    row, column = (4, 1) if by_rows else (1, 4)
    turn = {f"r{i + 1}{j + 1}": order[row * i + column * j] for i in range(3) for j in range(3)}
    return {**turn, **{name: order[row * i + column * 3] for i, name in enumerate(POSITION)}}


def _orientation(groups: Sequence[Group]) -> dict[str, int]:
    for group in groups:
        order = group.ordered()
        if set("xyzw") <= group.letters and not group.says(SPEEDS | SPINS):
            return {f"q{axis}": group.columns[axis] for axis in "xyzw"}
        if group.says(TURNS) and len(order) == 4:
            return dict(zip(QUATERNION, order, strict=True))
        if group.says({*TURNS, "r"}) and len(order) == 9:
            return dict(zip(MATRIX, order, strict=True))
        if set(EULER) <= group.letters:
            return {name: group.columns[name] for name in EULER}
        if group.says(ANGLES) and len(order) == 3:
            return dict(zip(EULER, order, strict=True))
        if group.says(ANGLES) and set("xyz") <= group.letters:
            return dict(zip(EULER, (group.columns[axis] for axis in "xyz"), strict=True))
        if group.says(VECTORS) or group.words[-1:] == ("r",):
            columns = [group.columns[axis] for axis in "xyz"] if set("xyz") <= group.letters else order
            if len(columns) == 3:
                return dict(zip(ROTATION_VECTOR, columns, strict=True))
    for first in (1, 0):  # r11 ... r33 or R00 ... R22
        named = {f"{first + i}{first + j}": f"r{i + 1}{j + 1}" for i in range(3) for j in range(3)}
        for group in groups:
            if set(named) <= group.letters:
                return {name: group.columns[axis] for axis, name in named.items()}
    return {}


def _position(groups: Sequence[Group]) -> dict[str, int]:
    three = [g for g in groups if set("xyz") <= g.letters and "w" not in g.letters]
    said = [g for g in three if g.says(PLACES)]
    poses = [g for g in three if g.says(POSES) and not g.says(TURNS | FORCES | TORQUES | WRENCHES | ANGLES | VECTORS)]
    bare = [g for g in three if not g.words or g.words[-1] not in TURNS | FORCES | TORQUES | VECTORS | ANGLES | {"r"}]
    numbered = [g.ordered() for g in groups if g.says(PLACES) and len(g.ordered()) == 3]
    best = [[g.columns[axis] for axis in "xyz"] for g in (*said, *poses, *bare)] + numbered
    return dict(zip(POSITION, best[0], strict=True)) if best else {}


def _wrench(groups: Sequence[Group]) -> dict[str, int]:
    usable = [g for g in _measured(groups) if not g.says(SPEEDS | SPINS)]
    usable.sort(key=lambda g: g.words[:2] == ("o", "f"))  # Franka's estimate in tool axes before that in base axes
    for group in usable:
        if group.says(WRENCHES | FORCES) and len(order := group.ordered()) == 6:
            return dict(zip(WRENCH, order, strict=True))
    result: dict[str, int] = {}
    for names, words, other in ((FORCE, FORCES, TORQUES), (TORQUE, TORQUES, FORCES)):
        for group in usable:
            near = [word for word in group.words if word in words | other]
            if near and near[-1] in words:
                columns = [group.columns[axis] for axis in "xyz"] if set("xyz") <= group.letters else group.ordered()
                if len(columns) == 3:
                    result.update(zip(names, columns, strict=True))
                    break
    return result


def helpers(names: Sequence[str]) -> dict[str, list[int]]:
    """Return the columns of "speed", "spin" and "acceleration", three each, if present."""
    result: dict[str, list[int]] = {}
    for group in _measured(groups_of(names)):
        order = group.ordered()
        three = [group.columns[axis] for axis in "xyz"] if set("xyz") <= group.letters else order
        if group.says(SPEEDS) and not group.says(SPINS) and len(order) == 6:
            result.setdefault("speed", order[:3])
            result.setdefault("spin", order[3:])
        elif len(three) == 3 and group.says(SPINS):
            result.setdefault("spin", three)
        elif len(three) == 3 and group.says(SPEEDS):
            result.setdefault("speed", three)
        elif len(three) == 3 and group.words[-1:] and group.words[-1] in ACCELERATIONS:
            result.setdefault("acceleration", three)
    return result


def said_frame(table: Table, force: int) -> tuple[str | None, str]:
    """Return the stated axes of the wrench and their source: a known layout, or the one `frame_id`."""
    words = cut(table.names[force])[0]
    known = {("k", "f"): "tool", ("o", "f"): "base", ("tcp", "force"): "base"}
    frame = next((frame for two, frame in known.items() if two in (words[:2], words[-2:])), None)
    if frame is not None:
        return frame, "as this layout's makers state"
    said = {i: text for i, (_, text) in table.text.items() if cut(table.names[i])[0][-2:] == ("frame", "id")}
    near = [text for i, text in said.items() if i < force]
    ids = near[-1:] or list(said.values())[:1]
    axes = {"base": {"base", "world", "map"}, "tool": {"tool", "tcp", "ee", "eef", "flange"}}
    for frame, words_of in axes.items():
        if ids and words_of & set(re.findall(r"[a-z]+", ids[0].lower())):
            return frame, f"since its frame_id says {ids[0]}"
    return None, ""

"""Columns of a foreign header by what they hold: clock, pose, wrench, velocities, an accelerometer.

A name is cut into words and an axis at its end: a letter, also fused with a word ("fx", "pos_z"), or a number
("wrench[4]", "actual_TCP_pose_3"). Columns of the same words are a group, and words and size say what a group holds. A
measured group goes before a desired one. Fixed layouts: Franka's `O_T_EE` is a 4x4 matrix by columns, its `F_ext_hat`
six numbers, and `K_` before them means axes of the tool. A UR's `actual_TCP_pose` is position and rotation vector, its
`actual_TCP_force` in base axes. KUKA's A, B, C turn about moving z, y, x.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from skillframe.demonstration.columns import EULER, FORCE, MATRIX, POSITION, QUATERNION, ROTATION_VECTOR, TORQUE
from skillframe.demonstration.options import SCALES

CLOCKS = {"t", "time", "timestamp", "stamp", "timestamps", "clock", "elapsed", "times"}
SECONDS, NANOSECONDS = {"sec", "secs", "seconds"}, {"nsec", "nsecs", "nanosec", "nanosecs", "nanoseconds"}
PLACES = {"pos", "position", "translation", "trans", "p", "xyz", "place", "positions"}
TURNS = {"quat", "quaternion", "orientation", "q", "ori", "rotation", "rot", "attitude", "quats", "quaternions"}
VECTORS = {"rotvec", "rvec", "rv", "axisangle", "aa"}
ANGLES = {"rpy", "euler", "eul"}
FORCES, TORQUES = {"force", "forces", "f"}, {"torque", "torques", "moment", "moments", "m", "t", "tau", "trq", "mom"}
WRENCHES = {"wrench", "ft", "fts", "force", "ext", "loadcell", "forcetorque", "ati"}
POSES = {"pose", "tcp", "cart", "cartesian", "ee", "eef", "tool", "flange", "poses"}
SPEEDS = {"vel", "velocity", "speed", "twist", "v", "linvel"}
SPINS = {"w", "omega", "angular", "angvel", "gyro", "gyroscope"}
ACCELERATIONS = {"a", "acc", "accel", "acceleration", "imu"}
NOT_MEASURED = {
    "d",
    "des",
    "desired",
    "target",
    "cmd",
    "command",
    "ref",
    "reference",
    "goal",
    "c",
    "commanded",
    "action",
}
NO_MEANING = {"std", "cov", "covariance", "err", "error", "joint", "joints", "var", "variance", "limit", "actuator"}
FUSED = {"f", "t", "m", "p", "q", "r", "rv", "w", "v", "a", "pos", "quat", "force", "torque", "tau", "o", "acc", "vel"}
LETTERS = {"x": 0, "y": 1, "z": 2, "w": 3}
UNITS = {unit.lower(): unit for units in SCALES.values() for unit in units}
KUKA = {"a": "yaw", "b": "pitch", "c": "roll"}


class Group(NamedTuple):
    """Columns of the same words.

    Attributes:
        words: of their names without the axis.
        columns: column index by axis, a letter or a number.
    """

    words: tuple[str, ...]
    columns: dict[str, int]

    @property
    def letters(self) -> frozenset[str]:
        """The axes."""
        return frozenset(self.columns)

    def ordered(self) -> list[int]:
        """Columns by number, for a group whose axes are numbers 0 ... n - 1 or 1 ... n. None for any other."""
        if not all(axis.isdigit() for axis in self.columns):
            return []
        found = sorted((int(axis), index) for axis, index in self.columns.items())
        whole = [number - found[0][0] for number, _ in found] == list(range(len(found)))
        return [index for _, index in found] if whole and found[0][0] in (0, 1) else []

    def says(self, words: set[str]) -> bool:
        """Whether one of the words is among its own."""
        return not words.isdisjoint(self.words)


def groups_of(names: Sequence[str]) -> list[Group]:
    """Groups of a header in the order of their first columns."""
    found: dict[tuple[str, ...], dict[str, int]] = {}
    for index, name in enumerate(names):
        words, axis = cut(name)
        found.setdefault(words, {}).setdefault(axis, index)
    return [Group(words, columns) for words, columns in found.items()]


def cut(name: str) -> tuple[tuple[str, ...], str]:
    """Words of a name and its axis: a letter, a number, roll, pitch or yaw, or "" where it has none."""
    spaced = re.sub(r"([a-z])([A-Z][a-z])", r"\1 \2", name)
    words = re.findall(r"[a-z]+|\d+", spaced.lower())
    if not words:
        return (), ""
    *rest, last = words
    if (last.isdigit() and len(last) <= 2) or last in LETTERS or last in EULER:
        return tuple(rest), last
    if rest and last in UNITS and (rest[-1] in (*LETTERS, *EULER, *CLOCKS, *KUKA) or rest[-1][:-1] in FUSED):
        return cut(" ".join(rest))  # a unit after the axis: "Fx [N]"
    if last[-1] in LETTERS and last[:-1] in FUSED:
        return (*rest, last[:-1]), last[-1]
    return tuple(words), ""


def picks(names: Sequence[str]) -> dict[str, int]:
    """Columns of a demonstration that a header names, by our names. Attitudes in the form that the header has.

    A quaternion's letters are believed here; whether its numbers agree is judged elsewhere.
    """
    groups = groups_of(names)
    result = {**_clock(groups), **_pose(groups)}
    return {**result, **_wrench(groups)}


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
    """Groups that may be a measurement, those that say so first."""
    kept = [g for g in groups if not g.says(NO_MEANING)]
    return sorted(kept, key=lambda g: g.says(NOT_MEASURED))


def _pose(groups: Sequence[Group]) -> dict[str, int]:
    usable = [g for g in _measured(groups) if not g.says(SPEEDS | SPINS | ACCELERATIONS)]
    for group in usable:
        if found := _whole_pose(group):
            return found
    return {**(_attitude(usable) or _kuka(groups)), **_position(usable)}


def _whole_pose(group: Group) -> dict[str, int]:
    """A group of numbered columns that is a pose: 4x4 or 3x4 matrix, position and quaternion, or rotation vector."""
    order = group.ordered()
    if len(order) == 16 and not (group.says({"f", "ne", "k"}) and not group.says({"o"})):
        by_columns = {f"r{i + 1}{j + 1}": order[4 * j + i] for i in range(3) for j in range(3)}
        return {**by_columns, **dict(zip(POSITION, order[12:15], strict=True))}
    if not group.says(POSES) or group.says(WRENCHES | FORCES | TORQUES):
        return {}
    if len(order) == 7:
        return dict(zip((*POSITION, *QUATERNION), order, strict=True))
    if len(order) == 6:
        return dict(zip((*POSITION, *ROTATION_VECTOR), order, strict=True))
    if len(order) == 12:
        rows = {f"r{i + 1}{j + 1}": order[4 * i + j] for i in range(3) for j in range(3)}
        return {**rows, **{name: order[4 * i + 3] for i, name in enumerate(POSITION)}}
    return {}


def _attitude(groups: Sequence[Group]) -> dict[str, int]:
    for group in groups:
        order = group.ordered()
        if set("xyzw") <= group.letters:
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
    return _loose_attitude(groups)


def _loose_attitude(groups: Sequence[Group]) -> dict[str, int]:
    """A matrix named r11 ... r33 or R00 ... R22."""
    for first in (1, 0):
        named = {f"{first + i}{first + j}": f"r{i + 1}{j + 1}" for i in range(3) for j in range(3)}
        for group in groups:
            if set(named) <= group.letters:
                return {name: group.columns[axis] for axis, name in named.items()}
    return {}


def _kuka(groups: Sequence[Group]) -> dict[str, int]:
    single = {g.words[-1]: g.columns[""] for g in groups if "" in g.letters and g.words and g.words[-1] in KUKA}
    return {KUKA[letter]: index for letter, index in single.items()} if set(single) == set(KUKA) else {}


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
    usable.sort(
        key=lambda g: g.words[:2] == ("o", "f")
    )  # Franka's estimate in axes of the tool before that in base axes
    for group in usable:
        if group.says(WRENCHES) and len(order := group.ordered()) == 6:
            return dict(zip((*FORCE, *TORQUE), order, strict=True))
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
    """Columns beside a pose and a wrench that bear on them: "speed", "spin" and "acceleration", three each."""
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


def said_units(names: Sequence[str], columns: Iterable[int]) -> list[str]:
    """Units that the names of columns end with, "TCP x [mm]", each once."""
    ends = [re.findall(r"[A-Za-z]+", names[index])[-1:] for index in columns]
    return list(dict.fromkeys(UNITS[end[0].lower()] for end in ends if end and end[0].lower() in UNITS))


def said_frame(names: Sequence[str], force: int) -> str | None:
    """What a known layout says of the wrench's axes: Franka's K_F_ext_hat_K and O_F_ext_hat_K, a UR's TCP force."""
    words = cut(names[force])[0]
    known = {("k", "f"): "tool", ("o", "f"): "base", ("tcp", "force"): "base"}
    return next((frame for two, frame in known.items() if two in (words[:2], words[-2:])), None)

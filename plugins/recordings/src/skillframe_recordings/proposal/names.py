"""Foreign column names, split into words, axis and unit, and grouped by words and body.

A name ends with an axis: a letter, possibly fused with a word ("fx", "pos_z"), or a number ("wrench[4]"), and possibly
a unit ("Fx (N)", "x_mm"). Columns with the same words form a group. If only the axes' case differs, X, Y, Z and w, x,
y, z are two groups, as in motion capture. Words without a known meaning name the body: "objLeft", "gripper".
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from skillframe.demonstration import EULER, QUANTITY, SCALES

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
    "d", "des", "desired", "target", "cmd", "command", "ref", "reference", "goal", "c", "commanded", "action",
}  # fmt: skip
NO_MEANING = {"std", "cov", "covariance", "err", "error", "joint", "joints", "var", "variance", "limit", "actuator"}
LOGGED = {"log", "logs", "data", "actual", "measured", "meas", "current", "msg", "field", "header", "linear", "r"}
"""Words about recording without a quantity."""
MEANT = (
    CLOCKS | SECONDS | NANOSECONDS | PLACES | TURNS | VECTORS | ANGLES | FORCES | TORQUES | WRENCHES | POSES | SPEEDS
    | SPINS | ACCELERATIONS | NOT_MEASURED | LOGGED | {"a", "b", "c"}
)  # fmt: skip
FUSED = {"f", "t", "m", "p", "q", "r", "rv", "w", "v", "a", "pos", "quat", "force", "torque", "tau", "o", "acc", "vel"}
LETTERS = {"x": 0, "y": 1, "z": 2, "w": 3}
KUKA = {"a": "yaw", "b": "pitch", "c": "roll"}
WRITTEN_OUT: Mapping[str, str] = {
    "sec": "s", "secs": "s", "second": "s", "seconds": "s", "msec": "ms", "millisecond": "ms", "milliseconds": "ms",
    "usec": "us", "microseconds": "us", "µs": "us", "nsec": "ns", "nanoseconds": "ns", "meter": "m", "meters": "m",
    "metre": "m", "metres": "m", "millimeters": "mm", "millimetres": "mm", "degree": "deg", "degrees": "deg",
    "°": "deg", "radian": "rad", "radians": "rad", "newton": "N", "newtons": "N",
}  # fmt: skip
UNITS = [unit for units in SCALES.values() for unit in units]
BRACKET = re.compile(r"[\[(]\s*([^\[\]()]*?)\s*[\])]\s*$")
CAMEL = re.compile(r"(?<=[a-z])(?=[A-Z][a-z])|(?<=[a-z]{2})(?=[A-Z](?![A-Za-z]))")


class Group(NamedTuple):
    """Columns with the same words.

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

    @property
    def body(self) -> tuple[str, ...]:
        """Words that name the body, or ()."""
        return tuple(word for word in self.words if word not in MEANT)

    def ordered(self) -> list[int]:
        """Return the columns of axes 0 ... n - 1 or 1 ... n in order, else []."""
        if not all(axis.isdigit() for axis in self.columns):
            return []
        found = sorted((int(axis), index) for axis, index in self.columns.items())
        whole = [number - found[0][0] for number, _ in found] == list(range(len(found)))
        return [index for _, index in found] if whole and found[0][0] in (0, 1) else []

    def says(self, words: set[str]) -> bool:
        """Return whether the group has one of the words."""
        return not words.isdisjoint(self.words)


def unit_of(text: str) -> str | None:
    """Return the unit that a text names ("N m", "seconds"), or None."""
    plain = re.sub(r"[\s.*·-]", "", text)
    if plain in UNITS:
        return plain
    small = plain.lower()
    alike = [unit for unit in UNITS if unit.lower() == small]
    return WRITTEN_OUT.get(small, alike[0] if len(alike) == 1 else None)  # only case separates mN and MN


def split_unit(name: str) -> tuple[str, str | None]:
    """Return a name without its unit, and the unit in brackets or after an axis or clock."""
    bracket = BRACKET.search(name)
    if bracket and name[: bracket.start()].strip() and (unit := unit_of(bracket[1])):
        return name[: bracket.start()], unit
    parts = list(re.finditer(r"[A-Za-z]+|\d+", name))
    if len(parts) > 1 and (unit := unit_of(parts[-1][0])) and parts[-1][0].lower() not in WRITTEN_OUT:
        before = parts[-2][0].lower()
        if before in (*LETTERS, *EULER, *CLOCKS, *KUKA) or before[:-1] in FUSED:
            return name[: parts[-1].start()], unit
    return name, None


def cut(name: str) -> tuple[tuple[str, ...], str]:
    """Return a name's words and axis: a letter, number, roll, pitch, yaw, or ""."""
    name = split_unit(name)[0]
    words = []
    for word in re.findall(r"[a-z]+|\d+", CAMEL.sub(" ", name).lower()):
        short = re.sub(r"(log|logs|data|traj)$", "", word)  # "plog" is "p"
        words.append(short if short in MEANT - NOT_MEASURED else word)
    if not words:
        return (), ""
    *rest, last = words
    if (last.isdigit() and len(last) <= 2) or last in LETTERS or last in EULER:
        return tuple(rest), last
    if last[-1] in LETTERS and last[:-1] in FUSED:
        return (*rest, last[:-1]), last[-1]
    return tuple(words), ""


def groups_of(names: Sequence[str]) -> list[Group]:
    """Return the groups of a header in the order of their first columns."""
    cuts = []
    for name in names:
        letters = re.findall(r"[A-Za-z]", split_unit(name)[0])
        cuts.append((*cut(name), bool(letters) and letters[-1].isupper()))
    cases: dict[tuple[tuple[str, ...], str], set[bool]] = {}
    for words, axis, capital in cuts:
        cases.setdefault((words, axis), set()).add(capital)
    both = {words for (words, _), found in cases.items() if len(found) > 1}
    result: dict[tuple[tuple[str, ...], bool], dict[str, int]] = {}
    for index, (words, axis, capital) in enumerate(cuts):
        result.setdefault((words, capital and words in both), {}).setdefault(axis, index)
    return [Group(words, columns) for (words, _), columns in result.items()]


def said_units(names: Sequence[str], picks: Mapping[str, int]) -> dict[str, str]:
    """Return units by quantity ("time", "length" ...) that column names state, including SI."""
    found: dict[str, str] = {}
    for name, index in picks.items():
        quantity, unit = QUANTITY.get(name, ""), split_unit(names[index])[1]
        if unit is not None and unit in SCALES.get(quantity, ()):
            found.setdefault(quantity, unit)
    return found


def called(names: Sequence[str]) -> str:
    """Return the common beginning of the column names of a body."""
    alike = 0
    while len({name.strip()[: alike + 1] for name in names}) == 1 and alike < min(map(len, names)):
        alike += 1
    return names[0].strip()[:alike].rstrip(" _.-/[(")


def same_body(one: str, other: str) -> bool:
    """Return whether two texts name the same body, ignoring case and punctuation."""
    return re.sub(r"[^a-z0-9]", "", one.lower()) == re.sub(r"[^a-z0-9]", "", other.lower())

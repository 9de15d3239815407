"""Named columns of a file as clock, poses and wrenches in SI units.

An orientation is a quaternion (qx, qy, qz, qw), Euler angles (roll, pitch, yaw: about x, y, z in any order), a rotation
vector (rvx, rvy, rvz) or a matrix (r11 ... r33, by rows). Euler angles follow scipy's convention: R = R_c(c) R_b(b)
R_a(a) about fixed axes a, b, c (lower case), R_a(a) R_b(b) R_c(c) about moving ones (upper case). The columns are taken
by axis.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from skillframe.demonstration.options import scales
from skillframe.demonstration.table import Table
from skillframe.errors import InputError
from skillframe.frames import Float, matrix_from_quaternion, quaternion_from_matrix, rotation_matrix

POSITION = ("px", "py", "pz")  #: columns of the position [m]
QUATERNION = ("qx", "qy", "qz", "qw")  #: columns of the orientation, scalar last
FORCE, TORQUE = ("fx", "fy", "fz"), ("tx", "ty", "tz")  #: columns of the force [N] and torque [Nm]
WRENCH = FORCE + TORQUE  #: columns of the wrench [N, Nm]
EULER = ("roll", "pitch", "yaw")  #: columns of the fixed-axis angles about x, y, z [rad]
ROTATION_VECTOR = ("rvx", "rvy", "rvz")  #: columns of the rotation vector [rad]
MATRIX = tuple(f"r{i}{j}" for i in (1, 2, 3) for j in (1, 2, 3))  #: columns of the rotation matrix, row by row
CANONICAL = ("t", *POSITION, *QUATERNION, *WRENCH)
SECONDS, NANOSECONDS = "sec", "nsec"  #: columns of a time stamp in two parts
KNOWN = (*CANONICAL, *EULER, *ROTATION_VECTOR, *MATRIX)  #: all columns that are read
#: quantity of each column
QUANTITY = {
    "t": "time", **dict.fromkeys(POSITION, "length"), **dict.fromkeys((*EULER, *ROTATION_VECTOR), "angle"),
    **dict.fromkeys(FORCE, "force"), **dict.fromkeys(TORQUE, "torque"),
}  # fmt: skip
ALIASES = {
    "time": "t", "timestamp": "t", "stamp": "t", "x": "px", "y": "py", "z": "pz", "pos_x": "px", "pos_y": "py",
    "pos_z": "pz", "mx": "tx", "my": "ty", "mz": "tz", "secs": SECONDS, "nsecs": NANOSECONDS, "nanosec": NANOSECONDS,
}  # fmt: skip
"""Names that other tools use: suggested for a header, accepted in settings."""


class Columns(dict[str, Float]):
    """Columns by name, with their source and row numbers for messages."""

    def __init__(self, values: Mapping[str, Float], source: str, rows: Sequence[int] | None = None) -> None:
        super().__init__(values)
        self.source, self.rows = source, rows

    def place(self, row: int, column: str = "") -> str:
        """Place of a value, "file: row N, column c", rows counted as in an editor."""
        number = row + 1 if self.rows is None else int(self.rows[row])
        return f"{self.source}: row {number}" + (f", column {column}" if column else "")

    def with_values(self, values: Mapping[str, Float]) -> Columns:
        """Other values of the same rows."""
        return Columns(values, self.source, self.rows)

    def where(self, keep: NDArray[np.bool_]) -> Columns:
        """The rows of a mask (T,)."""
        rows = None if self.rows is None else np.asarray(self.rows)[keep].tolist()
        return Columns({name: column[keep] for name, column in self.items()}, self.source, rows)

    def has(self, names: Iterable[str]) -> bool:
        """Whether all of these columns exist."""
        return all(name in self for name in names)

    def stack(self, names: Sequence[str]) -> Float:
        """Columns side by side, (T, len(names))."""
        return np.stack([self[name] for name in names], axis=-1)


def name_columns(table: Table, spec: str | None, units: str | None) -> Columns:
    """A table's columns under their names and in SI units.

    Raises:
        InputError: neither header nor names, a wrong number of names, a repeated name, or words in place of numbers.
    """
    picks = _picks(table, spec)
    factors = scales(units)
    columns: dict[str, Float] = {}
    for name, index in picks.items():
        if index in table.stamps and name.rpartition("_")[2] == "t":
            columns[name] = table.stamps[index]
            continue
        if index in table.text:
            if name.rpartition("_")[2] in KNOWN:
                row, said = table.text[index]
                comma = said.count(",") == 1 and said.replace(",", "").replace("-", "").replace("+", "").isdigit()
                fix = "separate cells that have a decimal comma by semicolons or tabs" if comma else "fix that cell"
                raise InputError(f"{table.source}: row {row}, column {name}", f"is not a number ({said[:40]!r})", fix)
            continue
        factor = factors.get(QUANTITY.get(name.rpartition("_")[2], ""), 1.0)
        columns[name] = table.values[:, index] * factor if factor != 1.0 else table.values[:, index].copy()
    for name in [name for name in columns if name.rpartition("_")[2] == SECONDS]:
        arm = name.removesuffix(SECONDS)
        if f"{arm}t" not in columns and f"{arm}{NANOSECONDS}" in columns:
            columns[f"{arm}t"] = columns.pop(name) + 1e-9 * columns.pop(f"{arm}{NANOSECONDS}")
    return Columns(columns, table.source, table.rows.tolist())


def left_out(table: Table) -> list[str]:
    """Sentences on columns of words, which are left out."""
    return [
        f"column {table.names[i] if table.names else i + 1} holds words and was left out" for i in sorted(table.text)
    ]


def _picks(table: Table, spec: str | None) -> dict[str, int]:
    width = table.values.shape[1]
    if spec is None and not table.names:
        raise InputError(
            f"{table.source}: row {table.rows[0]}", "has no header",
            "add the header t,px,py,pz,qx,qy,qz,qw,fx,fy,fz,tx,ty,tz or give --set columns (see --layout auto)",
        )  # fmt: skip
    names = table.names if spec is None else split_names(spec)
    if spec is not None and "=" in spec:
        pairs = [
            (ALIASES.get(n.strip(), n.strip()), column.strip() or n.strip())
            for n, _, column in (p.partition("=") for p in names)
        ]
        return _unique(table.source, [(name, _column(table, column)) for name, column in pairs])
    if len(names) != width:
        raise InputError(
            table.source, f"has {width} columns, and columns names {len(names)}",
            'name every column in order, "_" for one to ignore, or pick by header with NAME=COLUMN',
        )  # fmt: skip
    return _unique(table.source, [(name, i) for i, name in enumerate(names) if name not in ("_", "")])


def split_names(spec: str) -> list[str]:
    """Names of a list separated by commas or blanks, aliases resolved."""
    names = [name.strip() for name in (spec.split(",") if "," in spec else spec.split())]
    return [name if "=" in name else ALIASES.get(name, name) for name in names]


def _column(table: Table, column: str) -> int:
    if column in table.names:
        return table.names.index(column)
    if column.isdigit() and 1 <= int(column) <= table.values.shape[1]:
        return int(column) - 1
    there = ", ".join(table.names) or f"numbers 1 to {table.values.shape[1]}"
    raise InputError(table.source, f"has no column {column!r}", f"there are: {there}")


def _unique(source: str, pairs: list[tuple[str, int]]) -> dict[str, int]:
    unique: dict[str, int] = {}
    for name, index in pairs:
        if name in unique:
            raise InputError(source, f"names column {name!r} twice", "give every column its own name")
        unique[name] = index
    return unique


def select_arm(columns: Columns, arm: str | None) -> Columns:
    """One arm's columns without their prefix, and all columns of no arm.

    Raises:
        InputError: several arms and none chosen, no such arm, or arms whose clocks differ.
    """
    arms = sorted({name[: -len("_px")] for name in columns if name.endswith("_px")})
    # a row is one moment of all arms
    found = {arm: columns.get(f"{arm}_t", columns.get("t")) for arm in arms}
    clocks = {arm: clock for arm, clock in found.items() if clock is not None}
    for (one, first), (other, second) in pairwise(clocks.items()):
        apart = np.abs(first - second)
        # a tenth of a sample allows for stamps taken one after the other
        if len(first) > 1 and apart.max() > 0.1 * abs(float(np.median(np.diff(first)))):
            raise InputError(
                columns.place(int(np.argmax(apart))),
                f"the clocks of the arms {one} and {other} differ by {1e3 * apart.max():.3g} ms",
                "resample the arms onto one clock, or write a file for each",
            )
    if arm is None:
        if arms and "px" not in columns:
            raise InputError(
                columns.source, f"holds the arms {', '.join(arms)}", f"choose one with --set arm={arms[0]}"
            )
        return columns
    if arm not in arms:
        raise InputError(columns.source, f"has no arm {arm!r}", f"there are: {', '.join(arms) or 'none'}")
    prefix = f"{arm}_"
    own = {name.removeprefix(prefix) for name in columns if name.startswith(prefix)}
    kept = {n: v for n, v in columns.items() if not n.startswith(prefix) and n not in own}
    return columns.with_values({**kept, **{n: columns[prefix + n] for n in own}})


def with_quaternion(columns: Columns, euler: str | None) -> Columns:
    """The same columns with the orientation as a quaternion.

    Raises:
        InputError: Euler angles without their order, a bad order, or a matrix that is no rotation.
    """
    if columns.has(QUATERNION):
        if euler is not None:
            raise InputError(columns.source, "holds quaternions, no Euler angles", "leave euler out")
        return columns
    for names, convert in ((EULER, _from_euler), (ROTATION_VECTOR, _from_vector), (MATRIX, _from_matrix)):
        if columns.has(names):
            quaternion = quaternion_from_matrix(convert(columns, euler))
            rest = {n: v for n, v in columns.items() if n not in names}
            return columns.with_values({**rest, **{n: quaternion[:, i] for i, n in enumerate(QUATERNION)}})
    return columns


def _from_euler(columns: Columns, euler: str | None) -> Float:
    order = euler or ""
    axes = order.lower()
    proper = len(axes) == 3 and sorted(axes) == ["x", "y", "z"] and order in (axes, axes.upper())
    if not proper:
        what = f"the order {euler!r} is not one of x, y, z" if euler else "has roll, pitch, yaw without their order"
        raise InputError(
            columns.source, what, "give --set euler=xyz (fixed axes) or --set euler=ZYX (moving axes), for example"
        )
    result = np.eye(3)
    for axis in axes:
        index = "xyz".index(axis)
        vector = np.zeros((len(columns["roll"]), 3))
        vector[:, index] = columns[EULER[index]]
        turn = rotation_matrix(vector)
        result = result @ turn if order.isupper() else turn @ result
    return result


def _from_vector(columns: Columns, _: str | None) -> Float:
    return rotation_matrix(columns.stack(ROTATION_VECTOR))


def _from_matrix(columns: Columns, _: str | None) -> Float:
    matrix = columns.stack(MATRIX).reshape(-1, 3, 3)
    quaternion = quaternion_from_matrix(matrix)
    error = np.abs(matrix_from_quaternion(quaternion) - matrix).max(axis=(1, 2))
    if error.max() > 0.01:
        raise InputError(
            columns.place(int(np.argmax(error))), f"r11 ... r33 is no rotation matrix (off by {error.max():.3f})",
            "check the columns' order (by rows) and sign",
        )  # fmt: skip
    return matrix

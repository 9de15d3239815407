"""Compact rows, in the file and in memory: floats as their bits, shared values stored once.

A layout states the columns of rows, which are 64-bit floats, and the values that all rows share (skill, seed,
environment). A packed row is its trial, its floats (little-endian IEEE 754; base64 in the file) and the other values,
in the order of the columns. Numbers, also inf and NaN, are exact.
"""

from __future__ import annotations

import json
import struct
from base64 import b64decode, b64encode
from binascii import Error as NotBase64
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, overload

from skillframe.campaign.rows import Row

Key = tuple[int, str]
TRIAL, SKILL, SEED = "trial", "skill", "seed"
LAYOUT, BITS, REST = "layout", "bits", "rest"


@dataclass(frozen=True, slots=True, eq=False)
class RowLayout:
    """What rows have in common.

    Attributes:
        columns: in order, without the trial.
        floats: columns of 64-bit floats.
        shared: values that are the same in all rows, by column.
        ran_on: number of their environment, or None.
        rest: the other columns.
    """

    columns: tuple[str, ...]
    floats: tuple[str, ...]
    shared: Mapping[str, Any]
    ran_on: int | None
    rest: tuple[str, ...] = field(init=False)
    _struct: struct.Struct = field(init=False, repr=False)
    _blank: Row = field(init=False, repr=False)

    def __post_init__(self) -> None:
        taken = {*self.floats, *self.shared}
        object.__setattr__(self, "rest", tuple(name for name in self.columns if name not in taken))
        object.__setattr__(self, "_struct", struct.Struct(f"<{len(self.floats)}d"))
        blank = {TRIAL: 0} | {name: self.shared.get(name) for name in self.columns}
        object.__setattr__(self, "_blank", blank)

    @classmethod
    def of(cls, row: Row, ran_on: int | None) -> RowLayout:
        """The layout of a row."""
        columns = tuple(name for name in row if name != TRIAL)
        floats = tuple(name for name in columns if isinstance(row[name], float))
        shared = {name: row[name] for name in (SKILL, SEED) if isinstance(row.get(name), str | int)}
        return cls(columns, floats, shared, ran_on)

    def record(self, number: int) -> dict[str, Any]:
        """The layout as JSON values, under a number."""
        said = {LAYOUT: number, "columns": self.columns, "floats": self.floats, "shared": self.shared}
        return said if self.ran_on is None else {**said, "ran_on": self.ran_on}

    @classmethod
    def from_record(cls, record: Mapping[str, Any]) -> RowLayout:
        """Read a layout, the inverse of `record`.

        Raises:
            ValueError: the record is no layout.
        """
        columns, floats, shared = (record.get(key) for key in ("columns", "floats", "shared"))
        ran_on = record.get("ran_on")
        if not isinstance(columns, list) or not isinstance(floats, list) or not isinstance(shared, dict):
            raise ValueError("states no layout of rows")
        names = [*floats, *shared]
        if not all(isinstance(name, str) for name in (*columns, *names)) or not {*names} <= {*columns}:
            raise ValueError("states a layout with columns that it does not have")
        if len({*columns}) != len(columns) or len({*names}) != len(names) or TRIAL in columns:
            raise ValueError("states a layout that names a column twice")
        if not (ran_on is None or type(ran_on) is int):
            raise ValueError(f"says that rows ran on {ran_on!r}")
        return cls(tuple(columns), tuple(floats), shared, ran_on)

    def bits(self, row: Row) -> bytes:
        """The floats of a row, packed."""
        return self._struct.pack(*[row[name] for name in self.floats])

    def others(self, row: Row) -> list[Any]:
        """Values of a row that are neither trial nor float nor shared."""
        return [row[name] for name in self.rest]

    def row(self, trial: int, bits: bytes, others: Sequence[Any]) -> Row:
        """Unpack a row.

        Raises:
            ValueError: it does not fit this layout.
        """
        if len(bits) != self._struct.size or len(others) != len(self.rest):
            raise ValueError("does not fit its layout")
        row = self._blank.copy()
        row[TRIAL] = trial
        row.update(zip(self.floats, self._struct.unpack(bits), strict=True))
        row.update(zip(self.rest, others, strict=True))
        return row


def line_of(number: int, layout: RowLayout, row: Row) -> dict[str, Any]:
    """A row as JSON values: trial, number of its layout, floats and other values."""
    bits = b64encode(layout.bits(row)).decode().rstrip("=")
    return {TRIAL: row[TRIAL], LAYOUT: number, BITS: bits, REST: layout.others(row)}


def row_of(record: Mapping[str, Any], layouts: Mapping[int, RowLayout]) -> tuple[Row, int | None]:
    """Unpack `line_of`: the row, and the number of its environment.

    Raises:
        ValueError: the layout is unknown, or the row does not fit it.
    """
    number, bits, rest = record[LAYOUT], record.get(BITS), record.get(REST)
    if type(number) is not int or number not in layouts:
        raise ValueError(f"is of layout {number!r}, which no line states")
    if not isinstance(bits, str) or not isinstance(rest, list):
        raise ValueError("does not fit its layout")
    layout = layouts[number]
    try:
        found = b64decode(bits + "=" * (-len(bits) % 4), validate=True)
    except (NotBase64, ValueError):
        raise ValueError("does not fit its layout") from None
    return layout.row(record[TRIAL], found, rest), layout.ran_on


class PackedRows(Mapping[Key, Row]):
    """Rows by trial and skill, unpacked on access: about 400 bytes per row instead of 2000."""

    def __init__(self) -> None:
        self._packed: dict[Key, tuple[RowLayout, tuple[Any, ...], bytes]] = {}
        self._layouts: dict[tuple[Any, ...], RowLayout] = {}
        self._others: dict[str, tuple[Any, ...]] = {}
        self._labels: dict[str, str] = {}

    def layout(self, row: Row, ran_on: int | None) -> RowLayout:
        """The layout of a row, one object for all rows that share it."""
        kind = (ran_on, row.get(SKILL), row.get(SEED), *row, *map(type, row.values()))
        return self._layouts.get(kind) or self._layouts.setdefault(kind, RowLayout.of(row, ran_on))

    def add(self, row: Row, ran_on: int | None) -> None:
        """Add a row that ran in the environment of that number."""
        layout = self.layout(row, ran_on)
        others = layout.others(row)
        # equal tuples are shared; compared as text, since 1 == True
        kept = self._others.setdefault(json.dumps(others), tuple(others))
        label = self._labels.setdefault(row[SKILL], row[SKILL])
        self._packed[row[TRIAL], label] = layout, kept, layout.bits(row)

    def ran_on(self, key: Key) -> int | None:
        """Number of the environment in which a row ran, or None."""
        return self._packed[key][0].ran_on

    def __getitem__(self, key: Key) -> Row:
        layout, others, bits = self._packed[key]
        return layout.row(key[0], bits, others)

    def __contains__(self, key: object) -> bool:
        return key in self._packed

    def __iter__(self) -> Iterator[Key]:
        return iter(self._packed)

    def __len__(self) -> int:
        return len(self._packed)


class RowView(Sequence[Row]):
    """Rows in an order, each made on access."""

    def __init__(self, at: Callable[[Any], Row], places: Sequence[Any]) -> None:
        self._at, self._places = at, places

    @overload
    def __getitem__(self, index: int) -> Row: ...
    @overload
    def __getitem__(self, index: slice) -> RowView: ...
    def __getitem__(self, index: int | slice) -> Row | RowView:
        places = self._places[index]
        return RowView(self._at, places) if isinstance(index, slice) else self._at(places)

    def __iter__(self) -> Iterator[Row]:
        return map(self._at, self._places)

    def __len__(self) -> int:
        return len(self._places)

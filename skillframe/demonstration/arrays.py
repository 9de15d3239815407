"""Named arrays of a foreign file as one table: a column per number, "name[i]", as `--columns` takes them.

A file may hold arrays of several lengths, one per sensor. The table is made of those whose length fits most columns of
a demonstration by their names, or else of the longest, and the others are told. Arrays that lie on their side, (3, T),
are turned.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skillframe.demonstration.columns import KNOWN, left_out, name_columns
from skillframe.demonstration.delimited import read_wrench_file
from skillframe.demonstration.merged import assemble_split
from skillframe.demonstration.metafile import read_meta
from skillframe.demonstration.options import read_options
from skillframe.demonstration.proposal.headers import picks
from skillframe.demonstration.record import Demonstration
from skillframe.demonstration.table import Table
from skillframe.errors import InputError

WIDEST = 64
"""Numbers in a row of an array from which on it is an image or a cloud, and no column of a recording."""
LISTED = 20


def table_of(source: str, arrays: Mapping[str, NDArray[Any]], notes: list[str] | None = None) -> Table:
    """One table of named arrays.

    Args:
        source: the file, for messages.
        arrays: of any shape; those of numbers with a row per sample become columns.
        notes: takes a sentence on what was left out.

    Raises:
        InputError: none of them has a row per sample.
    """
    numbers = {name: array for name, array in arrays.items() if array.dtype.kind in "fiub" and array.size}
    usable = {name: array for name, array in numbers.items() if array.ndim in (1, 2, 3)}
    count = _rows(usable)
    columns: dict[str, NDArray[np.float64]] = {}
    for name, array in usable.items():
        columns.update(_columns(name, array, count))
    if count < 2 or not columns:
        there = ", ".join(f"{name} {array.shape}" for name, array in [*arrays.items()][:LISTED])
        raise InputError(
            source, f"holds no arrays with a row per sample; there are: {there or 'none'}", "check the file"
        )
    taken = {name for name in usable if any(c == name or c.startswith(f"{name}[") for c in columns)}
    left = [f"{name} {array.shape}" for name, array in arrays.items() if name not in taken]
    if left and notes is not None:
        notes.append(f"left out, not {count} samples long: {', '.join(left[:LISTED])}")
    return Table(
        source=source, names=list(columns), values=np.column_stack([*columns.values()]),
        rows=np.arange(1, count + 1), text={},
    )  # fmt: skip


def _rows(arrays: Mapping[str, NDArray[Any]]) -> int:
    """The number of samples: the length under which most columns of a demonstration stand."""
    lengths = Counter(size for array in arrays.values() for size in array.shape[:2] if size > 1)
    best, most = 0, (-1, -1)
    for length in lengths:
        names = [name for key, array in arrays.items() for name in _names(key, array, length)]
        score = (len(picks(names)), length)
        if score > most:
            best, most = length, score
    return best


def _names(name: str, array: NDArray[Any], count: int) -> list[str]:
    shape = _upright(array, count)
    if shape is None:
        return []
    return [name] if shape.ndim == 1 else [f"{name}[{i}]" for i in range(shape.shape[1])]


def _upright(array: NDArray[Any], count: int) -> NDArray[Any] | None:
    """The array with a row per sample, (T,) or (T, n), or None where it has none."""
    if array.shape[0] != count and array.ndim == 2 and array.shape[1] == count:
        array = array.T
    if array.shape[0] != count:
        return None
    flat = array if array.ndim == 1 else array.reshape(count, -1)
    return (
        flat[:, 0]
        if flat.ndim == 2 and flat.shape[1] == 1
        else flat
        if flat.ndim == 1 or flat.shape[1] <= WIDEST
        else None
    )


def _columns(name: str, array: NDArray[Any], count: int) -> Iterator[tuple[str, NDArray[np.float64]]]:
    upright = _upright(array, count)
    if upright is None:
        return
    if upright.ndim == 1:
        yield name, upright.astype(float)
        return
    for i in range(upright.shape[1]):
        yield f"{name}[{i}]", upright[:, i].astype(float)


def read_as_table(path: Path, options: Mapping[str, Any], table: Table, notes: list[str]) -> Demonstration:
    """A demonstration from a table of a foreign file.

    Raises:
        InputError: its columns are not named, or anything of the contract's list of bad input.
    """
    chosen = read_options(options)
    if chosen.columns is None and not any(name.rpartition("_")[2] in KNOWN for name in table.names):
        there = ", ".join(table.names[:LISTED]) + (", ..." if len(table.names) > LISTED else "")
        has = f"holds {there}" if table.names else f"holds {table.values.shape[1]} columns without names"
        raise InputError(
            path, f"{has}: none is called as a demonstration's",
            f"name them with --columns; skillframe demonstration check {path} --columns auto proposes the line",
        )  # fmt: skip
    columns = name_columns(table, chosen.columns, chosen.units)
    return assemble_split(columns, read_meta(path), chosen, [*notes, *left_out(table)], read_wrench_file(chosen))

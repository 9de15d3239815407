"""Named arrays of a foreign file as one table: a column per number, "name[i]", for `--set columns`.

Of arrays with several lengths, the table takes those that `--set columns` names, else those that fit most columns of a
demonstration, else the most or longest ones; a note lists the others. Arrays (3, T) or (4, 4, T) are transposed.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skillframe.demonstration import (
    KNOWN,
    Demonstration,
    Table,
    assemble_split,
    left_out,
    name_columns,
    read_meta,
    read_options,
    read_wrench_file,
)
from skillframe.errors import InputError
from skillframe_recordings.proposal.headers import picks

WIDEST = 64
"""Numbers per row above which an array is an image or a point cloud."""
LISTED = 20


def table_of(
    source: str, arrays: Mapping[str, NDArray[Any]], notes: list[str] | None = None, spec: str | None = None
) -> Table:
    """Return one table of named arrays.

    Args:
        source: the file, for messages.
        arrays: of any shape; numeric ones with a row per sample become columns.
        notes: receives a sentence on omitted arrays.
        spec: `ReadOptions.columns`, whose arrays determine the number of rows.

    Raises:
        InputError: no array has a row per sample.
    """
    numbers = {name: array for name, array in arrays.items() if array.dtype.kind in "fiub" and array.size}
    usable = {name: array for name, array in numbers.items() if array.ndim in (1, 2, 3)}
    count = _rows(usable, {part.rpartition("=")[2].partition("[")[0].strip() for part in (spec or "").split(",")})
    columns: dict[str, NDArray[np.float64]] = {}
    for name, array in usable.items():
        upright = _upright(array, count)
        if upright is not None and upright.ndim == 1:
            columns[name] = upright.astype(float)
        elif upright is not None:
            columns |= {f"{name}[{i}]": upright[:, i].astype(float) for i in range(upright.shape[1])}
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
        single={name: float(array.flat[0]) for name, array in numbers.items() if array.size == 1},
    )  # fmt: skip


def _rows(arrays: Mapping[str, NDArray[Any]], wanted: set[str]) -> int:
    lengths = {size for array in arrays.values() for size in (*array.shape[:2], array.shape[-1]) if size > 1}
    best, most = 0, (-1, -1, -1, -1)
    for length in sorted(lengths):
        fitting = {key: names for key, array in arrays.items() if (names := _names(key, array, length))}
        names = [name for found in fitting.values() for name in found]
        longest = sum(max(arrays[key].shape) == length for key in fitting)
        score = (len(wanted & fitting.keys()), len(picks(names).columns), longest, length)
        if score > most:
            best, most = length, score
    return best


def _names(name: str, array: NDArray[Any], count: int) -> list[str]:
    shape = _upright(array, count)
    if shape is None:
        return []
    return [name] if shape.ndim == 1 else [f"{name}[{i}]" for i in range(shape.shape[1])]


def _upright(array: NDArray[Any], count: int) -> NDArray[Any] | None:
    """The array with a row per sample, (T,) or (T, n), or None."""
    if array.shape[0] != count and array.ndim > 1 and array.shape[-1] == count:
        array = np.moveaxis(array, -1, 0)
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


def read_as_table(path: Path, options: Mapping[str, Any], table: Table, notes: list[str]) -> Demonstration:
    """Return a demonstration from a table of a foreign file.

    Raises:
        InputError: unnamed columns, or anything in the contract's list of bad input.
    """
    chosen = read_options(options)
    if chosen.columns is None and not any(name.rpartition("_")[2] in KNOWN for name in table.names):
        there = ", ".join(table.names[:LISTED]) + (", ..." if len(table.names) > LISTED else "")
        has = f"holds {there}" if table.names else f"holds {table.values.shape[1]} columns without names"
        raise InputError(
            path, f"{has}: none is called as a demonstration's",
            f"name them with --set columns; skillframe check {path} --layout auto proposes the line",
        )  # fmt: skip
    columns = name_columns(table, chosen.columns, chosen.units)
    return assemble_split(columns, read_meta(path), chosen, [*notes, *left_out(table)], read_wrench_file(chosen))

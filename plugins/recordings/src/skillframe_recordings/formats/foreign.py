"""Array files of other tools: .npy, foreign .npz, .mat, .json and .jsonl, as named arrays.

Nothing is unpickled. Library errors become one sentence.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skillframe.demonstration import Demonstration, Table
from skillframe.errors import InputError
from skillframe.files.documents import parse_json, read_arrays, read_text
from skillframe_recordings.formats.arrays import read_as_table, table_of
from skillframe_recordings.formats.guards import Arrays, foreign, refuse_no_file
from skillframe_recordings.formats.hdf5 import hdf5_table
from skillframe_recordings.formats.matfile import whole_variables

HDF5 = b"\x89HDF\r\n\x1a\n"


def npy_table(path: Path, options: Mapping[str, Any], notes: list[str] | None = None) -> Table:
    """Return the table of one array (T, n), with numbered columns or the fields of a structured array."""
    refuse_no_file(path)
    with foreign(path, "an npy file"):
        _refuse_short(path)
        array = np.load(path, allow_pickle=False)
    if array.dtype.names:
        return table_of(str(path), {name: array[name] for name in array.dtype.names}, notes, options.get("columns"))
    if array.ndim != 2 or array.dtype.kind not in "fiub" or len(array) < 2:
        raise InputError(
            path, f"is {array.dtype} of shape {array.shape}, no table", "store a row per sample, or a structured array"
        )
    rows = np.arange(1, len(array) + 1)
    return Table(source=str(path), names=[], values=array.astype(float), rows=rows, text={})


def _refuse_short(path: Path) -> None:
    """Refuse an npy file shorter than its header states, before memory is allocated.

    Raises:
        ValueError: with the header's sizes.
    """
    size = path.stat().st_size
    with path.open("rb") as file:
        version = np.lib.format.read_magic(file)  # type: ignore[no-untyped-call]
        length = int.from_bytes(file.read(2 if version == (1, 0) else 4), "little")
        if file.tell() + length > size:
            raise ValueError(f"a header of {length} bytes in a file of {size}")
        file.seek(-2 if version == (1, 0) else -4, 1)
        read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        shape, _, kind = read(file)  # type: ignore[no-untyped-call]
        if kind.hasobject:
            raise ValueError("it holds Python objects, which are never loaded: save arrays of numbers")
        if math.prod(shape) * kind.itemsize > size - file.tell():
            raise ValueError(f"says {kind} of shape {shape}, more than its {size} bytes")


def npz_table(path: Path, options: Mapping[str, Any], notes: list[str] | None = None) -> Table:
    """Return the table of an npz file's arrays."""
    return table_of(str(path), read_arrays(path, "npz file", "save it again"), notes, options.get("columns"))


def mat_table(path: Path, options: Mapping[str, Any], notes: list[str] | None = None) -> Table:
    """Return the table of a MATLAB file's matrices and struct fields, "log.force"."""
    refuse_no_file(path)
    with path.open("rb") as file:
        newer = HDF5 in file.read(1024)
    if newer:  # version 7.3 is HDF5 behind its own header
        return hdf5_table(path, options, notes)
    from scipy.io import loadmat

    with foreign(path, "a MATLAB file"):
        names = whole_variables(path.read_bytes(), str(path))
        content = loadmat(str(path), squeeze_me=True, struct_as_record=False, variable_names=names)
        arrays = dict(_fields({k: v for k, v in content.items() if not k.startswith("__")}, ""))
    episode = options.get("episode")
    cells = {name: cell for name, cell in arrays.items() if cell.dtype == object and any(map(_holds_arrays, cell.flat))}
    arrays = {name: array for name, array in arrays.items() if array.dtype != object}
    if cells and (episode is not None or not any(array.size > 1 for array in arrays.values())):
        arrays |= _recording(path, cells, episode)
    elif episode is not None:
        raise InputError(path, "holds no cells of several recordings", "leave episode out")
    return table_of(str(path), arrays, notes, options.get("columns"))


def _holds_arrays(value: Any) -> bool:
    return hasattr(value, "_fieldnames") or (isinstance(value, np.ndarray) and value.dtype.kind in "fiub")


def _recording(path: Path, cells: Arrays, episode: str | None) -> Arrays:
    """One recording of several in cells or struct arrays.

    Raises:
        InputError: none of several was named, or it does not exist.
    """
    count = max(cell.size for cell in cells.values())
    last, what = f"{path}: {', '.join(cells)}", f"{'holds' if len(cells) == 1 else 'hold'} {count} recordings"
    if episode is None and count > 1:
        raise InputError(last, what, f"choose one with --set episode, 0 to {count - 1}")
    if episode is not None and not (episode.isdigit() and int(episode) < count):
        raise InputError(last, f"{what}, and episode is {episode!r}", f"choose a number from 0 to {count - 1}")
    at = int(episode or 0)
    chosen = {name: cell.flat[at] for name, cell in cells.items() if cell.size == count}
    return {name: array for name, array in _fields(chosen, "") if array.dtype != object}


def _fields(content: Any, path: str) -> Iterator[tuple[str, NDArray[Any]]]:
    inside = content if isinstance(content, dict) else {n: getattr(content, n) for n in content._fieldnames}
    for name, value in inside.items():
        if isinstance(value, dict) or hasattr(value, "_fieldnames"):
            yield from _fields(value, f"{path}{name}.")
        elif isinstance(value, np.ndarray | int | float) and not isinstance(value, bool):
            yield f"{path}{name}", np.asarray(value)


def json_table(path: Path, options: Mapping[str, Any], notes: list[str] | None = None) -> Table:
    """Return the table of a JSON file: a list of records, one record a line, or lists by name (nested with dots)."""
    refuse_no_file(path)
    fix = "give a list of records, or lists by name"
    text = read_text(path, fix)
    lines = text.splitlines() if path.suffix.lower() == ".jsonl" else []
    records = [parse_json(line, f"{path}: row {i}", fix) for i, line in enumerate(lines, 1) if line.strip()]
    content = records if lines else parse_json(text, path, fix)
    if isinstance(content, list) and content and all(isinstance(record, dict) for record in content):
        rows = [dict(_numbers(record, "")) for record in content]
        names = list(dict.fromkeys(name for row in rows for name in row))
        return table_of(
            str(path),
            {name: np.array([row.get(name, np.nan) for row in rows]) for name in names},
            notes,
            options.get("columns"),
        )
    if isinstance(content, dict):
        return table_of(str(path), dict(_lists(content, "")), notes, options.get("columns"))
    raise InputError(path, "is JSON without records", fix)


def _numbers(value: Any, path: str) -> Iterator[tuple[str, float]]:
    """Numbers of a record by name: "pose.position.x", "force[2]"."""
    if isinstance(value, dict):
        for name, inside in value.items():
            yield from _numbers(inside, f"{path}.{name}" if path else str(name))
    elif isinstance(value, list):
        for i, inside in enumerate(value):
            yield from _numbers(inside, f"{path}[{i}]")
    elif isinstance(value, int | float) and not isinstance(value, bool):
        yield path, float(value)


def _lists(content: dict[str, Any], path: str) -> Iterator[tuple[str, NDArray[Any]]]:
    for name, value in content.items():
        if isinstance(value, dict):
            yield from _lists(value, f"{path}{name}.")
        elif isinstance(value, list) and value:
            try:
                array = np.array(value, dtype=float)
            except (TypeError, ValueError):
                continue  # words, or lists of different length
            yield f"{path}{name}", array


TABLES = {".npy": npy_table, ".npz": npz_table, ".mat": mat_table, ".json": json_table, ".jsonl": json_table}


def read_foreign(path: Path, options: Mapping[str, Any]) -> Demonstration:
    """Return a demonstration from a file of arrays.

    Args:
        path: the file; `NAME.meta.toml` beside it is read too.
        options: fields of `ReadOptions`; `columns` names foreign arrays.

    Raises:
        InputError: anything in the contract's list of bad input.
    """
    notes = list[str]()
    return read_as_table(path, options, foreign_table(path, options, notes), notes)


def foreign_table(path: Path, options: Mapping[str, Any], notes: list[str] | None = None) -> Table:
    """Return the table of a file of arrays, by its extension."""
    return TABLES[path.suffix.lower()](path, options, notes)

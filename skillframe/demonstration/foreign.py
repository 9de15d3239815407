"""Files of arrays that other tools write: .npy, .npz without our metadata, .mat, .json and .jsonl, as named arrays.

Nothing is unpickled. What a library raises on foreign bytes becomes one sentence.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skillframe.demonstration.arrays import read_as_table, table_of
from skillframe.demonstration.matfile import whole_variables
from skillframe.demonstration.record import Demonstration
from skillframe.demonstration.table import Table
from skillframe.errors import InputError, SkillframeError
from skillframe.files.documents import parse_json, read_text
from skillframe.files.npz import read_arrays

Arrays = dict[str, NDArray[Any]]
LARGEST = 1_000_000_000
"""Bytes of a file that is read as a whole."""
HDF5 = b"\x89HDF\r\n\x1a\n"


@contextmanager
def foreign(path: Path, kind: str) -> Iterator[None]:
    """Whatever a library raises on foreign bytes, as one sentence."""
    try:
        yield
    except (SkillframeError, MemoryError, ImportError):
        raise
    except Exception as error:  # foreign code on foreign bytes: ValueError, TypeError, struct.error, OSError ...
        said = " ".join(str(error).split())[:120]
        problem = f"cannot be read as {kind} ({type(error).__name__}{f': {said}' if said else ''})"
        raise InputError(path, problem, "it may be damaged, or of another kind: check what wrote it") from None


def refuse_no_file(path: Path) -> None:
    """Refuse what is missing, a folder, empty or larger than is read as a whole."""
    try:
        size = path.stat().st_size
    except OSError:
        raise InputError(path, "no such file", "check the path") from None
    if path.is_dir():
        raise InputError(path, "is a folder", "give a file")
    if not size:
        raise InputError(path, "is empty", "record it again")
    if size > LARGEST:
        raise InputError(path, f"has {size / 1e9:.1f} GB, and 1 GB is read as a whole", "cut it, or save it as CSV")


def npy_table(path: Path, options: Mapping[str, Any], notes: list[str] | None = None) -> Table:
    """The table of one array (T, n): numbered columns, or the fields of a structured array."""
    refuse_no_file(path)
    with foreign(path, "an npy file"):
        _refuse_short(path)
        array = np.load(path, allow_pickle=False)
    if array.dtype.names:
        return table_of(str(path), {name: array[name] for name in array.dtype.names}, notes)
    if array.ndim != 2 or array.dtype.kind not in "fiub" or len(array) < 2:
        raise InputError(
            path, f"is {array.dtype} of shape {array.shape}, no table", "store a row per sample, or a structured array"
        )
    rows = np.arange(1, len(array) + 1)
    return Table(source=str(path), names=[], values=array.astype(float), rows=rows, text={})


def _refuse_short(path: Path) -> None:
    """Refuse an npy file that is shorter than its header says, before memory is asked for it.

    Raises:
        ValueError: what the header says.
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
        if kind.hasobject or math.prod(shape) * kind.itemsize > size - file.tell():
            raise ValueError(f"says {kind} of shape {shape}, more than its {size} bytes")


def npz_table(path: Path, options: Mapping[str, Any], notes: list[str] | None = None) -> Table:
    """The table of an npz file's arrays."""
    return table_of(str(path), read_arrays(path, "npz file", "save it again"), notes)


def mat_table(path: Path, options: Mapping[str, Any], notes: list[str] | None = None) -> Table:
    """The table of a MATLAB file's matrices and of the fields of its structs, "log.force"."""
    refuse_no_file(path)
    with path.open("rb") as file:
        newer = HDF5 in file.read(1024)
    if newer:  # version 7.3 is HDF5 behind a block of its own
        from skillframe.demonstration.hdf5 import hdf5_table

        return hdf5_table(path, options, notes)
    from scipy.io import loadmat

    with foreign(path, "a MATLAB file"):
        names = whole_variables(path.read_bytes())
        content = loadmat(str(path), squeeze_me=True, struct_as_record=False, variable_names=names)
        arrays = dict(_fields({k: v for k, v in content.items() if not k.startswith("__")}, ""))
    return table_of(str(path), arrays, notes)


def _fields(content: Any, path: str) -> Iterator[tuple[str, NDArray[Any]]]:
    """Arrays of numbers in dictionaries and structs within each other."""
    inside = content if isinstance(content, dict) else {n: getattr(content, n) for n in content._fieldnames}
    for name, value in inside.items():
        if isinstance(value, dict) or hasattr(value, "_fieldnames"):
            yield from _fields(value, f"{path}{name}.")
        elif isinstance(value, np.ndarray):
            yield f"{path}{name}", value


def json_table(path: Path, options: Mapping[str, Any], notes: list[str] | None = None) -> Table:
    """The table of a JSON file: a list of records, a record a line, or lists by name. Names within names get a dot."""
    refuse_no_file(path)
    fix = "give a list of records, or lists by name"
    text = read_text(path, fix)
    lines = text.splitlines() if path.suffix.lower() == ".jsonl" else []
    content = (
        [parse_json(line, f"{path}: row {i}", fix) for i, line in enumerate(lines, 1) if line.strip()]
        if lines
        else None
    )
    content = parse_json(text, path, fix) if content is None else content
    if isinstance(content, list) and content and all(isinstance(record, dict) for record in content):
        return table_of(str(path), _records(path, content), notes)
    if isinstance(content, dict):
        return table_of(str(path), dict(_lists(content, "")), notes)
    raise InputError(path, "is JSON without records", fix)


def _records(path: Path, records: list[dict[str, Any]]) -> Arrays:
    """Columns of records, a number each. A record without a name of the first has a gap there."""
    rows = [dict(_numbers(record, "")) for record in records]
    names = list(dict.fromkeys(name for row in rows for name in row))
    return {name: np.array([row.get(name, np.nan) for row in rows]) for name in names}


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
    """A demonstration from a file of arrays.

    Args:
        path: the file; `NAME.meta.toml` beside it is read too.
        options: fields of `ReadOptions`; `columns` names the arrays, unless they have a demonstration's names.

    Raises:
        InputError: anything of the contract's list of bad input.
    """
    notes = list[str]()
    return read_as_table(path, options, foreign_table(path, options, notes), notes)


def foreign_table(path: Path, options: Mapping[str, Any], notes: list[str] | None = None) -> Table:
    """The table of a file of arrays, by its ending."""
    return TABLES[path.suffix.lower()](path, options, notes)

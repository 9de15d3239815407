"""Arrays from an npz file that anybody may have made: sizes are judged before anything is unpacked.

An npz is a zip of npy members. A zip says how much each member unpacks to, and an npy header says its array's shape;
both are checked against each other and against a limit first, so that a small file cannot ask for all memory. Nothing
is ever unpickled. The checksums of the zip are verified by Python's `zipfile` as the members are read.
"""

from __future__ import annotations

import math
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skillframe.errors import InputError
from skillframe.files.documents import parse_json

MOST_BYTES = 1_000_000_000
"""Bytes that a file may unpack to: an hour at 1 kHz with 30 columns is 864 MB (our choice)."""
SMALL = 64_000_000
"""Bytes that any file may unpack to, however well it is packed: constant columns pack to a thousandth."""
RATIO = 100
"""Largest ratio of unpacked to packed bytes beyond `SMALL`; recorded numbers reach 10 (our choice)."""
MOST_MEMBERS = 1000
ENDING = ".npy"
Arrays = dict[str, NDArray[Any]]


def read_arrays(path: Path, kind: str, fix: str) -> Arrays:
    """Every array of an npz file, by name.

    Args:
        path: the file.
        kind: what it should be, for messages ("npz file", "trace file").
        fix: what to do if it is none, for messages.

    Raises:
        InputError: missing, no npz, damaged, with Python objects in it, or unpacking to more than the limits.
    """
    try:
        size = path.stat().st_size
        if path.is_dir():
            raise InputError(path, "is a folder", "give a file")
        if not size:
            raise InputError(path, "is empty", fix)
        with zipfile.ZipFile(path) as archive:
            _check_members(path, archive.infolist(), size, fix)
            return {info.filename.removesuffix(ENDING): _array(path, archive, info) for info in archive.infolist()}
    except FileNotFoundError:
        raise InputError(path, "no such file", "check the path") from None
    except (InputError, MemoryError):  # too little memory is no damage to the file
        raise
    except Exception as error:  # foreign bytes: BadZipFile, zlib.error, EOFError, SyntaxError, struct.error ...
        said = " ".join(str(error).split())[:120]
        problem = f"is not a readable {kind}, or is damaged" + (f" ({said})" if said else "")
        raise InputError(path, problem, fix) from None


def json_member(path: Path, arrays: Arrays, name: str, fix: str) -> dict[str, Any] | None:
    """The JSON object that one array holds as text, or None where it holds something else.

    Raises:
        InputError: it is text and no JSON, or JSON that `documents.parse_json` refuses.
    """
    array = arrays[name]
    if array.size != 1 or array.dtype.kind not in "US":
        return None
    text = array.reshape(-1)[0]
    try:
        value = parse_json(text if isinstance(text, bytes) else str(text), f"{path}: {name}", fix)
    except InputError as error:
        raise InputError(error.where, f"is not a JSON object ({error.problem})", fix) from None
    return value if isinstance(value, dict) else None


def _check_members(path: Path, members: list[zipfile.ZipInfo], size: int, fix: str) -> None:
    names = [info.filename for info in members]
    if len(members) > MOST_MEMBERS:
        raise InputError(path, f"holds {len(members)} arrays, and {MOST_MEMBERS} are allowed", fix)
    if len(set(names)) != len(names):
        raise InputError(path, "holds two arrays of one name", fix)
    total = sum(info.file_size for info in members)
    if total > min(MOST_BYTES, max(SMALL, RATIO * size)):
        raise InputError(path, f"has {size} bytes and would unpack to {total}, which no recording does", fix)
    for info in members:
        if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise InputError(path, f"{info.filename!r} is packed in another way than npz files are", fix)


def _array(path: Path, archive: zipfile.ZipFile, info: zipfile.ZipInfo) -> NDArray[Any]:
    """One member, after its header was held against its size."""
    with archive.open(info) as file:
        version = np.lib.format.read_magic(file)
        read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        shape, _, dtype = read(file)
        if dtype.hasobject:
            raise ValueError("it holds Python objects, which are never loaded")
        declared, held = math.prod(shape) * dtype.itemsize, info.file_size - file.tell()
        if declared != held or min(shape, default=0) < 0:
            raise ValueError(f"{info.filename} says {declared} bytes and holds {held}")
    with archive.open(info) as file:
        array: NDArray[Any] = np.lib.format.read_array(file, allow_pickle=False)
        return array

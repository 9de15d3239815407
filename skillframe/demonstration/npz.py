"""The native form: one array per column and a JSON text `meta` with format and version, in an uncompressed npz.

An npz file without metadata is read as arrays of another tool, if `--set columns` names them.
"""

from __future__ import annotations

import io
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from skillframe.demonstration.assemble import assemble_split, read_wrench_file
from skillframe.demonstration.columns import KNOWN, Columns
from skillframe.demonstration.csv import demonstration_columns
from skillframe.demonstration.options import read_options
from skillframe.demonstration.record import Demonstration
from skillframe.errors import InputError
from skillframe.files import write_whole
from skillframe.files.documents import json_member, read_arrays
from skillframe.frames import Float

FORMAT, VERSION = "skillframe.demonstration", 1


def read_npz(path: Path, options: Mapping[str, Any]) -> Demonstration:
    """Read a demonstration from its native form.

    Raises:
        InputError: no npz, of another format or a newer version, or anything of the contract's list of bad input.
    """
    chosen = read_options(options)
    arrays = read_arrays(path, "npz file", "write it again")
    for name in ("columns", "units"):
        if getattr(chosen, name) is not None:
            raise InputError(
                path, f"{name} does not apply to the native form", "leave it out; its arrays are named, in SI units"
            )
    meta = _meta(path, arrays)
    notes = list[str]()
    columns = Columns(_columns(path, arrays, notes), str(path))
    return assemble_split(columns, meta, chosen, notes, read_wrench_file(chosen))


def _meta(path: Path, arrays: dict[str, Any]) -> dict[str, Any]:
    if "meta" not in arrays:
        raise InputError(
            path,
            "holds no meta",
            "name its arrays with --set columns (--layout auto proposes them), or store a JSON text meta with format "
            f"{FORMAT!r}",
        )
    meta = json_member(path, arrays, "store one JSON text")
    if meta is None:
        raise InputError(f"{path}: meta", "is not a JSON object", "store one JSON text")
    form, version = meta.pop("format", None), meta.pop("version", None)
    if form != FORMAT:
        raise InputError(f"{path}: meta.format", f"is {form!r}, not {FORMAT!r}", "give a demonstration")
    if not isinstance(version, int) or isinstance(version, bool) or not 1 <= version <= VERSION:
        newer = isinstance(version, int) and version > VERSION
        raise InputError(
            f"{path}: meta.version", f"is {version!r}; this skillframe reads up to {VERSION}",
            "update skillframe" if newer else f"store the number {VERSION}",
        )  # fmt: skip
    return meta


def _columns(path: Path, arrays: dict[str, Any], notes: list[str]) -> dict[str, Float]:
    """One number per sample and name. Other arrays are left out with a note."""
    columns: dict[str, Float] = {}
    for name, array in arrays.items():
        if name == "meta":
            continue
        fits = array.ndim == 1 and array.dtype.kind in "fiub"
        if not fits and "t" in arrays and (not any(name == known or name.endswith(f"_{known}") for known in KNOWN)):
            notes.append(f"array {name}, {array.dtype} of shape {array.shape}, was left out")
            continue
        if not fits:
            raise InputError(
                f"{path}: {name}", f"is {array.dtype} of shape {array.shape}", "store one number per sample"
            )
        columns[name] = array.astype(float)
    lengths = {name: len(column) for name, column in columns.items()}
    reference = lengths.get("t", next(iter(lengths.values()), 0))
    for name, length in lengths.items():
        if length != reference:
            raise InputError(f"{path}: {name}", f"has {length} values, t has {reference}", "store arrays of one length")
    if not reference:
        raise InputError(path, "has no rows", "record again, or check the export")
    return columns


def write_npz(demonstration: Demonstration, path: Path) -> None:
    """Write the native form as a whole."""
    meta = {"quaternion": "xyzw", **demonstration.meta, "format": FORMAT, "version": VERSION}
    columns = demonstration_columns(demonstration)
    if "meta" in columns:
        raise InputError(path, "a column is called meta", "rename it")
    buffer = io.BytesIO()
    np.savez(buffer, allow_pickle=False, meta=np.array(json.dumps(meta, sort_keys=True)), **columns)
    write_whole(path, buffer.getvalue())

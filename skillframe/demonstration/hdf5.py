"""HDF5 recordings: robomimic and robosuite (`data/demo_0/obs/...`), REASSEMBLE and others, as named arrays.

Read through h5py, the extra `hdf5`. Files that `robomimic` wrote are read without `--columns`. Where a group `data`
holds groups of one recording each, `--episode` names the one. Images are never loaded.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from skillframe.demonstration.arrays import WIDEST, read_as_table, table_of
from skillframe.demonstration.foreign import Arrays, foreign, refuse_no_file
from skillframe.demonstration.record import Demonstration
from skillframe.demonstration.robomimic import metadata_of, read_own
from skillframe.demonstration.table import Table
from skillframe.errors import InputError, UnknownName, extras_named

MOST_ROWS = 20_000_000


def read_hdf5(path: Path, options: Mapping[str, Any]) -> Demonstration:
    """A demonstration from an HDF5 file.

    Args:
        path: the file; `NAME.meta.toml` beside it is read too.
        options: fields of `ReadOptions`; `columns` names the data sets, `episode` the recording.

    Raises:
        InputError: anything of the contract's list of bad input.
        MissingDependency: h5py is not installed.
    """
    notes = list[str]()
    table = hdf5_table(path, options, notes)
    if options.get("columns") is None and (meta := _own_metadata(path, options)) is not None:
        return read_own(table, meta, options)
    return read_as_table(path, options, table, notes)


def _own_metadata(path: Path, options: Mapping[str, Any]) -> dict[str, Any] | None:
    import h5py

    with foreign(path, "HDF5"), h5py.File(path, "r") as file:
        return metadata_of(path, _episode(path, file, options.get("episode")))


def hdf5_table(path: Path, options: Mapping[str, Any], notes: list[str] | None = None) -> Table:
    """The table of an HDF5 file, or of one of its recordings."""
    refuse_no_file(path)
    with extras_named():
        import h5py
    with foreign(path, "HDF5"), h5py.File(path, "r") as file:
        group = _episode(path, file, options.get("episode"))
        arrays: Arrays = {}

        def take(name: str | bytes, item: Any) -> None:
            name = name if isinstance(name, str) else name.decode(errors="replace")
            if isinstance(item, h5py.Dataset) and _is_signal(item):
                arrays[name] = item[()]

        group.visititems(take)
    if not arrays:
        raise InputError(path, "holds no data sets of numbers", "check what wrote it")
    return table_of(str(path), arrays, notes)


def _is_signal(item: Any) -> bool:
    width = 1
    for size in item.shape[1:]:
        width *= int(size)
    sideways = len(item.shape) == 2 and item.shape[0] <= WIDEST
    fits = len(item.shape) in (1, 2, 3) and (width <= WIDEST or sideways) and max(item.shape, default=0) <= MOST_ROWS
    return bool(fits and item.dtype.kind in "fiub" and item.size)


def _episode(path: Path, file: Any, name: str | None) -> Any:
    """The group of one recording.

    Raises:
        UnknownName: no such recording.
        InputError: there are several and none was named.
    """
    place = file["data"] if "data" in file and hasattr(file["data"], "keys") else None
    found = {} if place is None else {key: group for key, group in place.items() if hasattr(group, "keys")}
    if name is None and len(found) > 1:
        some = ", ".join(sorted(found, key=lambda key: (len(key), key))[:8])
        raise InputError(path, f"holds {len(found)} recordings: {some}, ...", "choose one with --episode")
    if name is not None and name not in found:
        raise UnknownName("episode", name, found, where=str(path))
    return found[name] if name is not None else next(iter(found.values()), file)

"""HDF5 recordings (robomimic, robosuite, REASSEMBLE and others) as named arrays.

h5py (extra `hdf5`) reads them. `--set episode` chooses a group of `data`. Images are not loaded.

`write_robomimic` writes a demonstration in robomimic's format, one file each, in full precision. The layout follows
robomimic's documentation ("Dataset Structure"):

    data                     total, env_args                    attributes
    data/demo_0              num_samples                        attribute
      obs/robot0_eef_pos     (T, 3)  tool point in base [m]
      obs/robot0_eef_quat    (T, 4)  its orientation, x, y, z, w
      obs/robot0_ee_force    (T, 3)  environment on the tool, at the tool point, base axes [N]
      obs/robot0_ee_torque   (T, 3)  [Nm]
      obs/time               (T,)    [s]
      obs/further/NAME       (T,)    further columns
      next_obs/...                   the same of the next sample, at the end of the last
      actions                (T, 6)  motion to the next sample: position in 0.05 m, rotation vector (base) in 0.5 rad
      rewards, dones         (T,)    1 at the last sample
      states                 (T, 1)  0, as documented for data without simulator states

Actions must be within -1 and 1. `env_args` holds the task's name and type 2, "gym". The attribute `skillframe` of
`data/demo_0` keeps the metadata, so reading needs no `--set columns`.
"""

from __future__ import annotations

import io
import json
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from skillframe.demonstration import (
    POSITION,
    QUATERNION,
    WRENCH,
    Columns,
    Demonstration,
    Table,
    assemble_split,
    read_options,
    read_wrench_file,
)
from skillframe.errors import InputError, UnknownName, extras_named
from skillframe.files import write_whole
from skillframe.files.documents import NUMBER, refuse_bomb
from skillframe.frames import Float, rotation_vector
from skillframe_recordings.formats.arrays import WIDEST, read_as_table, table_of
from skillframe_recordings.formats.guards import Arrays, foreign, refuse_no_file

ODD = "check what wrote it, or store its numbers without packing them"
OURS, FORMAT, VERSION = "skillframe", "skillframe.demonstration", 1
OBSERVED = {
    "robot0_eef_pos": POSITION, "robot0_eef_quat": QUATERNION,
    "robot0_ee_force": WRENCH[:3], "robot0_ee_torque": WRENCH[3:],
}  # fmt: skip
"""Data sets under obs, and their columns."""
FURTHER = "further/"


def read_hdf5(path: Path, options: Mapping[str, Any]) -> Demonstration:
    """Return a demonstration from an HDF5 file.

    Args:
        path: the file; `NAME.meta.toml` beside it is read too.
        options: fields of `ReadOptions`; `columns` names the data sets, `episode` the recording.

    Raises:
        InputError: anything in the contract's list of bad input.
        MissingDependency: h5py is not installed.
    """
    notes = list[str]()
    table = hdf5_table(path, options, notes)
    if options.get("columns") is None:
        import h5py

        with foreign(path, "HDF5"), h5py.File(path, "r") as file:
            meta = metadata_of(path, _episode(path, file, options.get("episode")))
        if meta is not None:
            return read_own(table, meta, options)
    return read_as_table(path, options, table, notes)


def hdf5_table(path: Path, options: Mapping[str, Any], notes: list[str] | None = None) -> Table:
    """Return the table of an HDF5 file, or of one of its recordings."""
    refuse_no_file(path)
    with extras_named():
        import h5py
    with foreign(path, "HDF5"), h5py.File(path, "r") as file:
        group = _episode(path, file, options.get("episode"))
        found: dict[str, Any] = {}

        def take(name: str | bytes, item: Any) -> None:
            name = name if isinstance(name, str) else name.decode(errors="replace")
            if isinstance(item, h5py.Dataset) and _is_signal(item):
                found[name] = item

        group.visititems(take)
        refuse_bomb(path, path.stat().st_size, NUMBER * sum(int(item.size) for item in found.values()), ODD)
        for name, item in found.items():
            _refuse_longer_chunks(path, name, item)
        arrays: Arrays = {name: item[()] for name, item in found.items()}
    if not arrays:
        raise InputError(path, "holds no data sets of numbers", "check what wrote it")
    return table_of(str(path), arrays, notes, options.get("columns"))


def _is_signal(item: Any) -> bool:
    width = 1
    for size in item.shape[1:]:
        width *= int(size)
    sideways = len(item.shape) == 2 and item.shape[0] <= WIDEST
    fits = len(item.shape) in (1, 2, 3) and (width <= WIDEST or sideways) and max(item.shape, default=0) <= 2e7
    return bool(fits and item.dtype.kind in "fiub" and item.size)


def _refuse_longer_chunks(path: Path, name: str, item: Any) -> None:
    """Refuse oversized chunks, which HDF5 would unpack whole.

    Raises:
        InputError: such a chunk, or one that is packed more than once.
    """
    plan = item.id.get_create_plist()
    filters = [plan.get_filter(i)[0] for i in range(plan.get_nfilters())]
    packing = [number for number in filters if number not in (2, 3)]  # shuffle and checksum keep the size
    if not packing:
        return
    room = int(np.prod(item.chunks)) * item.dtype.itemsize
    for i in range(item.id.get_num_chunks() if packing == [1] else 0):  # deflate
        offset = item.id.get_chunk_info(i).chunk_offset
        skipped, raw = item.id.read_direct_chunk(offset)
        if not skipped and len(zlib.decompressobj().decompress(raw, room + 1)) > room:
            raise InputError(f"{path}: {name}", f"holds a chunk of {room} bytes that unpacks to more", ODD)
    if len(packing) > 1:
        raise InputError(f"{path}: {name}", "is packed more than once, which hides its size", ODD)


def _episode(path: Path, file: Any, name: str | None) -> Any:
    """The group of one recording.

    Raises:
        UnknownName: no such recording.
        InputError: none of several was named.
    """
    place = file["data"] if "data" in file and hasattr(file["data"], "keys") else None
    found = {} if place is None else {key: group for key, group in place.items() if hasattr(group, "keys")}
    if name is None and len(found) > 1:
        some = ", ".join(sorted(found, key=lambda key: (len(key), key))[:8])
        raise InputError(path, f"holds {len(found)} recordings: {some}, ...", "choose one with --set episode")
    if name is not None and name not in found:
        raise UnknownName("episode", name, found, where=str(path))
    return found[name] if name is not None else next(iter(found.values()), file)


def write_robomimic(demonstration: Demonstration, path: Path) -> None:
    """Write a demonstration, whole or not at all.

    Raises:
        InputError: the place cannot be written.
        MissingDependency: h5py is not installed.
    """
    with extras_named():
        import h5py
    d, count = demonstration, len(demonstration)
    follows = np.minimum(np.arange(count) + 1, count - 1)
    last = np.arange(count) == follows
    signals = dict(zip(OBSERVED, (d.position, d.quaternion, d.wrench[:, :3], d.wrench[:, 3:]), strict=True))
    signals |= {"time": d.time, **{FURTHER + name: column for name, column in d.extra.items()}}
    buffer = io.BytesIO()
    with h5py.File(buffer, "w") as file:
        data = file.create_group("data")
        task = str(d.meta.get("task") or "demonstration")
        data.attrs["total"] = count
        data.attrs["env_args"] = json.dumps({"env_name": task, "type": 2, "env_kwargs": {}})
        episode = data.create_group("demo_0")
        episode.attrs["num_samples"] = count
        episode.attrs[OURS] = json.dumps({"format": FORMAT, "version": VERSION, "meta": d.meta}, sort_keys=True)
        for name, values in signals.items():
            episode[f"obs/{name}"], episode[f"next_obs/{name}"] = values, values[follows]
        rotation = d.pose.rotation
        turned = rotation_vector(rotation[follows] @ np.swapaxes(rotation, -1, -2))
        found: Float = np.hstack([(d.position[follows] - d.position) / 0.05, turned / 0.5])
        episode["actions"] = found
        episode["rewards"], episode["dones"] = last.astype(float), last.astype(np.int64)
        episode["states"] = np.zeros((count, 1))
    write_whole(path, buffer.getvalue())


def metadata_of(path: Path, group: Any) -> dict[str, Any] | None:
    """Return the metadata of a group by `write_robomimic`, or None for others.

    Raises:
        InputError: they have another version or are damaged.
    """
    text = group.attrs.get(OURS)
    if not isinstance(text, str):
        return None
    try:
        found = json.loads(text)
        if (found["format"], found["version"]) != (FORMAT, VERSION) or not isinstance(found["meta"], dict):
            raise ValueError
    except (ValueError, KeyError, TypeError):
        fix = "update skillframe, or name the columns with --set columns"
        raise InputError(path, f"its metadata are no {FORMAT} of version {VERSION}", fix) from None
    meta: dict[str, Any] = found["meta"]
    return meta


def read_own(table: Table, meta: Mapping[str, Any], options: Mapping[str, Any]) -> Demonstration:
    """Return the demonstration of a table with the columns of `write_robomimic`.

    Raises:
        InputError: a column is missing, or anything in the contract's list of bad input.
    """
    named = {f"obs/{data}[{i}]": name for data, names in OBSERVED.items() for i, name in enumerate(names)}
    named["obs/time"] = "t"
    if lost := [column for column in named if column not in table.names]:
        raise InputError(table.source, f"lacks {lost[0]}", "write it again, or name the columns with --set columns")
    further = f"obs/{FURTHER}"
    named |= {column: column.removeprefix(further) for column in table.names if column.startswith(further)}
    columns = {name: table.values[:, table.names.index(column)] for column, name in named.items()}
    chosen = read_options(options)
    return assemble_split(Columns(columns, table.source), dict(meta), chosen, [], read_wrench_file(chosen))

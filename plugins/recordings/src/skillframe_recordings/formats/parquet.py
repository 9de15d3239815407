"""Parquet files and LeRobot data sets (versions 2.x and 3) as named arrays.

pyarrow (extra `parquet`) reads them. In a LeRobot folder, `meta/info.json` gives the frame rate and names of features.
Version 2 has a file per episode, version 3 several; `--set episode=3` chooses one. Videos are not loaded.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from skillframe.demonstration import Columns, Demonstration, Table, assemble_split, read_options, read_wrench_file
from skillframe.errors import InputError, UnknownName, extras_named
from skillframe.files.documents import NUMBER, read_json, refuse_bomb
from skillframe_recordings.formats.arrays import read_as_table, table_of
from skillframe_recordings.formats.guards import Arrays, foreign, refuse_no_file

INFO = Path("meta") / "info.json"
EPISODE = "episode_index"
LARGE = "check what wrote it, or write its episodes into files of their own"
BESIDE = (EPISODE, "frame_index", "index", "task_index")
OURS = Path("meta") / "skillframe.json"
"""Metadata of each episode, in data sets by `demonstration.lerobot`."""
FORMAT, FORMAT_VERSION, FURTHER = "skillframe.demonstrations", 1, "observation.further."


def is_lerobot(path: Path) -> bool:
    """Return whether a folder is a LeRobot data set."""
    return (path / INFO).is_file()


def read_parquet(path: Path, options: Mapping[str, Any]) -> Demonstration:
    """Return a demonstration from a parquet file or an episode of a LeRobot data set.

    Args:
        path: the file, or the data set's folder.
        options: fields of `ReadOptions`; `columns` names the features, `episode` the episode's number.

    Raises:
        InputError: anything in the contract's list of bad input.
        MissingDependency: pyarrow is not installed.
    """
    notes = list[str]()
    if (path / OURS).is_file() and options.get("columns") is None:
        return _read_own(path, options)
    return read_as_table(path, options, parquet_table(path, options, notes), notes)


def _read_own(path: Path, options: Mapping[str, Any]) -> Demonstration:
    ours = read_json(path / OURS, "write the data set again")
    metas = ours.get("episodes") if isinstance(ours, dict) else None
    if not isinstance(metas, list) or ours.get("format") != FORMAT or ours.get("version") != FORMAT_VERSION:
        fix = "update skillframe, or name the columns with --set columns"
        raise InputError(path / OURS, f"is no {FORMAT} of version {FORMAT_VERSION}", fix)
    table = parquet_table(path, options)
    columns = {
        name.removeprefix(prefix): table.values[:, index]
        for index, name in enumerate(table.names)
        for prefix in ("observation.state.", "observation.wrench.", FURTHER)
        if name.startswith(prefix)
    }
    number = int(options.get("episode") or 0)
    if "timestamp" not in table.names or not number < len(metas) or not isinstance(metas[number], dict):
        raise InputError(
            path / OURS, f"and the data do not go together at episode {number}", "write the data set again"
        )
    columns["t"] = table.values[:, table.names.index("timestamp")]
    chosen = read_options(options)
    return assemble_split(Columns(columns, str(path)), metas[number], chosen, [], read_wrench_file(chosen))


def parquet_table(path: Path, options: Mapping[str, Any], notes: list[str] | None = None) -> Table:
    """Return the table of a parquet file, or of one episode."""
    episode = options.get("episode")
    if not is_lerobot(path):
        refuse_no_file(path)
        return table_of(str(path), _one_episode(path, _arrays(path), episode), notes)
    info = read_json(path / INFO, "give a data set of LeRobot")
    features = info.get("features") if isinstance(info, dict) else None
    if not isinstance(features, dict):
        raise InputError(path / INFO, "names no features", "give a data set of LeRobot, version 2 or 3")
    arrays = _one_episode(path, _data_set(path, episode), episode)
    named: Arrays = {}
    for name, array in arrays.items():
        feature = features.get(name)
        labels = feature.get("names") if isinstance(feature, dict) else None
        labels = next(iter(labels.values()), None) if isinstance(labels, dict) and len(labels) == 1 else labels
        told = [str(label) for label in labels] if isinstance(labels, list) and array.ndim == 2 else []
        if told and len(set(told)) == len(told) == array.shape[1]:
            named |= {f"{name}.{label}": array[:, i] for i, label in enumerate(told)}
        else:
            named[name] = array
    return table_of(str(path), {n: a for n, a in named.items() if n not in BESIDE}, notes)


def _data_set(path: Path, episode: str | None) -> Arrays:
    files = sorted((path / "data").glob("*/*.parquet"))
    own = [f for f in files if episode is not None and episode.isdigit() and f.stem == f"episode_{int(episode):06d}"]
    if not files:
        raise InputError(path, "holds no data/*/*.parquet", "fetch the data set whole")
    parts = [_arrays(file) for file in own or files]
    shared = [
        name
        for name in parts[0]
        if all(name in part and part[name].shape[1:] == parts[0][name].shape[1:] for part in parts)
    ]
    return {name: np.concatenate([part[name] for part in parts]) for name in shared}


def _one_episode(path: Path, arrays: Arrays, episode: str | None) -> Arrays:
    """The rows of one episode.

    Raises:
        UnknownName: no such episode.
        InputError: none of several was named.
    """
    if EPISODE not in arrays:
        return arrays
    found = np.unique(arrays[EPISODE]).astype(int).tolist()
    if episode is None and len(found) > 1:
        raise InputError(
            path, f"holds {len(found)} episodes, {found[0]} to {found[-1]}", "choose one with --set episode"
        )
    number = found[0] if episode is None else int(episode) if episode.isdigit() else -1
    if number not in found:
        raise UnknownName("episode", str(episode), map(str, found), where=str(path))
    return {name: array[arrays[EPISODE] == number] for name, array in arrays.items()}


def _arrays(path: Path) -> Arrays:
    with extras_named():
        import pyarrow
        import pyarrow.parquet
    with foreign(path, "parquet"):
        schema = pyarrow.parquet.read_schema(path)
        t = pyarrow.types
        numbers = (t.is_floating, t.is_integer, t.is_boolean, t.is_timestamp)
        wanted = [f.name for f in schema if any(is_it(f.type) for is_it in numbers) or _is_list(pyarrow, f.type)]
        if not wanted:
            there = ", ".join(f"{f.name} ({f.type})" for f in schema)
            raise InputError(path, f"holds no numbers; its columns are {there}", "give a table of samples")
        metadata = pyarrow.parquet.read_metadata(path)
        groups = (metadata.row_group(i) for i in range(metadata.num_row_groups))
        columns = (group.column(j) for group in groups for j in range(group.num_columns))
        wide = [c for c in columns if c.path_in_schema.split(".")[0] in wanted or c.path_in_schema in wanted]
        declared = sum(max(NUMBER * int(c.num_values), int(c.total_uncompressed_size)) for c in wide)
        refuse_bomb(path, path.stat().st_size, declared, LARGE)
        table = pyarrow.parquet.read_table(path, columns=wanted)
        arrays = {name: _column(pyarrow, table.column(name).combine_chunks()) for name in wanted}
    return {name: array for name, array in arrays.items() if array is not None}


def _is_list(pyarrow: Any, kind: Any) -> bool:
    types = pyarrow.types
    lists = types.is_list(kind) or types.is_large_list(kind) or types.is_fixed_size_list(kind)
    return bool(lists and (types.is_floating(kind.value_type) or types.is_integer(kind.value_type)))


def _column(pyarrow: Any, column: Any) -> Any:
    """A column (T,) or (T, n), or None if its lists differ in length."""
    if not _is_list(pyarrow, column.type):
        array = column.to_numpy(zero_copy_only=False)
        return array.astype("datetime64[ns]").astype(np.int64) * 1e-9 if array.dtype.kind == "M" else array
    flat, count = column.flatten().to_numpy(zero_copy_only=False), len(column)
    if count == 0 or column.null_count or len(flat) % count:
        return None
    lengths = np.array([len(row) for row in column])
    return flat.reshape(count, -1) if np.all(lengths == lengths[0]) else None

"""Writer of LeRobot data sets, version 3.0, with forces.

The layout is that of LeRobot's `LeRobotDatasetMetadata` and `DatasetWriter`, with these features, all float32:

    observation.state   (7)  px ... qw   pose of the tool point in base [m, 1]
    observation.wrench  (6)  fx ... tz   environment on the tool, at the tool point, base axes [N, Nm]
    action              (7)  px ... qw   the next frame's state, the last frame's own

Other columns are further features. `meta/skillframe.json` keeps the metadata, so reading needs no `--set columns`.
"""

from __future__ import annotations

import io
import json
import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skillframe.demonstration import POSITION, QUATERNION, WRENCH, Demonstration
from skillframe.errors import InputError, extras_named
from skillframe.files import not_written, write_whole
from skillframe_recordings.formats.parquet import FORMAT, FORMAT_VERSION, FURTHER, OURS

VERSION, POSE = "v3.0", (*POSITION, *QUATERNION)
CHUNK_FILES, DATA_MB = 1000, 100
"""Settings in info.json: files per chunk, and size of a file of frames [MB]."""
QUANTILES = {"q01": 0.01, "q10": 0.1, "q50": 0.5, "q90": 0.9, "q99": 0.99}
_DATA, _EPISODES = "data/chunk-{c:03d}/file-{f:03d}.parquet", "meta/episodes/chunk-000/file-000.parquet"
Arrays = dict[str, NDArray[Any]]


def write_lerobot(demonstrations: Sequence[Demonstration], folder: Path) -> None:
    """Write a data set, whole or not at all.

    Raises:
        InputError: the folder holds something, or the demonstrations' rates or columns do not fit.
        MissingDependency: pyarrow is not installed.
    """
    check_new(folder)
    with extras_named():
        import pyarrow
        import pyarrow.parquet  # before the work
    fps = _rate(demonstrations)
    own = {"observation.state": POSE, "observation.wrench": WRENCH, "action": POSE}
    about = {name: {"dtype": "float32", "shape": [len(n)], "names": [*n]} for name, n in own.items()}
    names = sorted(demonstrations[0].extra)
    for d in demonstrations:
        if sorted(d.extra) != names:
            text = f"has the further columns {sorted(d.extra)}, and the first demonstration {names}"
            raise InputError(d.source or "demonstration", text, "write the same columns into all")
    about |= {f"{FURTHER}{name}": _scalar("float32") for name in names}
    kinds = ("episode_index", "frame_index", "index", "task_index")
    features = {**about, "timestamp": _scalar("float32"), **{name: _scalar("int64") for name in kinds}}
    with _whole_folder(folder) as made:
        rows, shared = _write_frames(demonstrations, features, fps, made)
        _save(made / _EPISODES, pyarrow.table({name: [row[name] for row in rows] for name in rows[0]}))
        tasks = _tasks(demonstrations)
        column = {"field_name": "task_index", "metadata": None, "name": "task_index", "numpy_type": "int64"}
        index = {"field_name": "task", "metadata": None, "name": "task", "numpy_type": "object"}
        frame = {
            "column_indexes": [],
            "columns": [{**column, "pandas_type": "int64"}, {**index, "pandas_type": "unicode"}],
            "creator": {"library": "skillframe", "version": VERSION}, "index_columns": ["task"],
            "pandas_version": "2.0.0",
        }  # fmt: skip
        table = pyarrow.table({"task_index": list(range(len(tasks))), "task": tasks})  # as pandas writes it for LeRobot
        _save(made / "meta" / "tasks.parquet", table.replace_schema_metadata({"pandas": json.dumps(frame)}))
        _write_json(made / "meta" / "stats.json", shared)
        robots = {str(d.meta["robot"]) for d in demonstrations if d.meta.get("robot")}
        info = {
            "codebase_version": VERSION, "robot_type": robots.pop() if len(robots) == 1 else None,
            "total_episodes": len(demonstrations), "total_frames": sum(map(len, demonstrations)),
            "total_tasks": len(tasks), "chunks_size": CHUNK_FILES, "data_files_size_in_mb": DATA_MB,
            "video_files_size_in_mb": 200, "fps": fps, "splits": {"train": f"0:{len(demonstrations)}"},
            "data_path": "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet", "video_path": None,
            "features": dict(features),
        }  # fmt: skip
        _write_json(made / "meta" / "info.json", info)
        metas = [json.loads(json.dumps({"quaternion": "xyzw", **d.meta})) for d in demonstrations]
        _write_json(made / OURS, {"format": FORMAT, "version": FORMAT_VERSION, "episodes": metas})


def check_new(folder: Path) -> None:
    """Refuse a folder that holds something, before the work that fills it.

    Raises:
        InputError: a file, or a folder that is not empty.
    """
    if folder.exists() and not (folder.is_dir() and not any(folder.iterdir())):
        raise InputError(folder, "is there already", "choose another name, or remove it")


def _rate(demonstrations: Sequence[Demonstration]) -> int:
    """Common rate in whole frames per second, which LeRobot requires."""
    rates = [d.rate for d in demonstrations]
    fps = round(float(np.median(rates)))
    for d, rate in zip(demonstrations, rates, strict=True):
        frames = (d.time - d.time[0]) * fps
        late = float(np.max(np.abs(frames - np.arange(len(d)))))
        if fps < 1 or late > 0.05:  # frames
            where = d.source or "demonstration"
            text = f"its samples at {rate:.6g} Hz are up to {late:.2g} frames from {fps} frames a second"
            raise InputError(where, f"{text}, and a LeRobot data set has one whole rate", "record at an even rate")
    return fps


def _scalar(kind: str) -> dict[str, Any]:
    return {"dtype": kind, "shape": [1], "names": None}


def _tasks(demonstrations: Sequence[Demonstration]) -> list[str]:
    return list(dict.fromkeys(_task(d) for d in demonstrations))


def _task(demonstration: Demonstration) -> str:
    return str(demonstration.meta.get("task") or "demonstration")


def _write_frames(
    demonstrations: Sequence[Demonstration], features: Mapping[str, Any], fps: int, folder: Path
) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """Write the frames, one row group per episode, and return the episodes' rows and all frames' statistics."""
    import pyarrow
    import pyarrow.parquet

    tasks, rows, total, stats = _tasks(demonstrations), [], 0, list[dict[str, dict[str, Any]]]()
    fields = []
    for name, about in features.items():
        kind = pyarrow.float32() if about["dtype"] == "float32" else pyarrow.int64()
        fields.append((name, kind if about["shape"] == [1] else pyarrow.list_(kind, about["shape"][0])))
    schema = pyarrow.schema(fields)
    number, written, writer = 0, 0, None
    try:
        for episode, d in enumerate(demonstrations):
            arrays = _frames(d, episode, total, tasks.index(_task(d)), fps)
            size = sum(array.nbytes for array in arrays.values())
            if writer is not None and written + size > DATA_MB * 2**20:
                writer.close()
                number, written, writer = number + 1, 0, None
            if writer is None:
                path = folder / _DATA.format(c=number // CHUNK_FILES, f=number % CHUNK_FILES)
                path.parent.mkdir(parents=True, exist_ok=True)
                writer = pyarrow.parquet.ParquetWriter(path, schema)
            columns = [
                pyarrow.array(array, type=schema.field(name).type)
                if array.ndim == 1
                else pyarrow.FixedSizeListArray.from_arrays(pyarrow.array(array.ravel()), array.shape[1])
                for name, array in ((name, arrays[name]) for name in features)
            ]
            writer.write_table(pyarrow.Table.from_arrays(columns, schema=schema))
            written += size
            stats.append({name: _statistics(array) for name, array in arrays.items()})
            rows.append({
                "episode_index": episode, "tasks": [_task(d)], "length": len(d),
                "data/chunk_index": number // CHUNK_FILES, "data/file_index": number % CHUNK_FILES,
                "dataset_from_index": total, "dataset_to_index": total + len(d),
                **{f"stats/{n}/{k}": v for n, each in stats[-1].items() for k, v in each.items()},
                "meta/episodes/chunk_index": 0, "meta/episodes/file_index": 0,
            })  # fmt: skip
            total += len(d)
    finally:
        if writer is not None:
            writer.close()
    return rows, {name: _together([each[name] for each in stats]) for name in features}


def _frames(d: Demonstration, episode: int, first: int, task: int, fps: int) -> Arrays:
    """An episode's features by name, (T,) or (T, n)."""
    count = len(d)
    state = np.concatenate([d.position, d.quaternion], axis=1).astype(np.float32)
    index = np.arange(count)
    return {
        "observation.state": state, "observation.wrench": d.wrench.astype(np.float32),
        "action": np.concatenate([state[1:], state[-1:]]),
        **{f"{FURTHER}{name}": d.extra[name].astype(np.float32) for name in sorted(d.extra)},
        "timestamp": (index / fps).astype(np.float32), "episode_index": np.full(count, episode),
        "frame_index": index, "index": first + index, "task_index": np.full(count, task),
    }  # fmt: skip


def _statistics(array: NDArray[Any]) -> dict[str, Any]:
    values = array.reshape(len(array), -1).astype(float)
    found = {"min": values.min(0), "max": values.max(0), "mean": values.mean(0), "std": values.std(0)}
    found |= {name: np.quantile(values, q, axis=0) for name, q in QUANTILES.items()}
    return {**{name: v.tolist() for name, v in found.items()}, "count": [len(array)]}


def _together(parts: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Statistics of all frames from those of the episodes.

    Mean and standard deviation are exact (law of total variance). Quantiles are weighted means of the episodes', as in
    LeRobot.
    """
    count = np.array([part["count"][0] for part in parts], dtype=float)
    weight = (count / count.sum())[:, None]
    each = {name: np.array([part[name] for part in parts]) for name in parts[0]}
    mean = (weight * each["mean"]).sum(0)
    variance = (weight * (each["std"] ** 2 + (each["mean"] - mean) ** 2)).sum(0)
    found = {"min": each["min"].min(0), "max": each["max"].max(0), "mean": mean, "std": np.sqrt(variance)}
    found |= {name: (weight * each[name]).sum(0) for name in QUANTILES}
    return {**{name: v.tolist() for name, v in found.items()}, "count": [int(count.sum())]}


def _save(path: Path, table: Any) -> None:
    import pyarrow.parquet

    buffer = io.BytesIO()
    pyarrow.parquet.write_table(table, buffer)
    write_whole(path, buffer.getvalue())


def _write_json(path: Path, content: Mapping[str, Any]) -> None:
    write_whole(path, (json.dumps(content, indent=4) + "\n").encode())


@contextmanager
def _whole_folder(folder: Path) -> Iterator[Path]:
    """A temporary folder that replaces a new one if the block succeeds."""
    import tempfile

    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        made = Path(tempfile.mkdtemp(prefix=f".{folder.name[:40]}.", dir=folder.parent))
    except OSError as error:
        raise not_written(folder, error) from None
    try:
        yield made
        made.chmod(0o755)
        made.replace(folder)
    except OSError as error:
        raise not_written(folder, error) from None
    finally:
        shutil.rmtree(made, ignore_errors=True)

"""Demonstrations written as robomimic's HDF5, a file each, in full precision.

The layout is the one that robomimic's data sets have (its documentation, "Dataset Structure"):

    data                     total, env_args                    attributes
    data/demo_0              num_samples                        attribute
      obs/robot0_eef_pos     (T, 3)  tool point in base [m]
      obs/robot0_eef_quat    (T, 4)  its attitude, x, y, z, w
      obs/robot0_ee_force    (T, 3)  environment on the tool, at the tool point, base axes [N]
      obs/robot0_ee_torque   (T, 3)  [Nm]
      obs/time               (T,)    [s]
      obs/further/NAME       (T,)    further columns
      next_obs/...                   the same of the next sample, of the last one its own
      actions                (T, 6)  motion to the next sample: position in 0.05 m, rotation vector (base) in 0.5 rad
      rewards, dones         (T,)    1 at the last sample
      states                 (T, 1)  0, as documented for what has no simulator's states

Actions, rewards, dones and environment in `env_args` (the task's name, type 2, "gym") are our choice. Actions have to
stay within -1 and 1. Metadata stands in the attribute `skillframe` of `data/demo_0`, so that reading needs no
`--columns`.
"""

from __future__ import annotations

import io
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skillframe.demonstration.columns import POSITION, QUATERNION, WRENCH, Columns
from skillframe.demonstration.delimited import read_wrench_file
from skillframe.demonstration.merged import assemble_split
from skillframe.demonstration.options import read_options
from skillframe.demonstration.record import Demonstration
from skillframe.demonstration.table import Table
from skillframe.errors import InputError, extras_named
from skillframe.files import write_whole
from skillframe.frames import Float, rotation_vector

OURS, FORMAT, VERSION = "skillframe", "skillframe.demonstration", 1
OBSERVED = {
    "robot0_eef_pos": POSITION, "robot0_eef_quat": QUATERNION,
    "robot0_ee_force": WRENCH[:3], "robot0_ee_torque": WRENCH[3:],
}  # fmt: skip
"""Data sets under obs, and the columns that they hold."""
FURTHER = "further/"
GYM = 2
"""robomimic's `EnvType.GYM_TYPE`."""
STEP, TURN = 0.05, 0.5
"""Motions [m, rad] that are an action of 1."""


def write_robomimic(demonstration: Demonstration, path: Path) -> None:
    """Write a demonstration. The file appears complete or not at all.

    Raises:
        InputError: a place that cannot be written to.
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
        data.attrs["env_args"] = json.dumps({"env_name": task, "type": GYM, "env_kwargs": {}})
        episode = data.create_group("demo_0")
        episode.attrs["num_samples"] = count
        episode.attrs[OURS] = json.dumps({"format": FORMAT, "version": VERSION, "meta": d.meta}, sort_keys=True)
        for name, values in signals.items():
            episode[f"obs/{name}"], episode[f"next_obs/{name}"] = values, values[follows]
        episode["actions"] = _actions(d, follows)
        episode["rewards"], episode["dones"] = last.astype(float), last.astype(np.int64)
        episode["states"] = np.zeros((count, 1))
    write_whole(path, buffer.getvalue())


def _actions(d: Demonstration, follows: NDArray[np.intp]) -> Float:
    """(T, 6) the motion from each sample to the one that follows, scaled."""
    rotation = d.pose.rotation
    turned = rotation_vector(rotation[follows] @ np.swapaxes(rotation, -1, -2))
    found: Float = np.hstack([(d.position[follows] - d.position) / STEP, turned / TURN])
    return found


def metadata_of(path: Path, group: Any) -> dict[str, Any] | None:
    """Metadata of a group that `write_robomimic` wrote, None of any other.

    Raises:
        InputError: it says that it is ours, and is not of this version.
    """
    text = group.attrs.get(OURS)
    if not isinstance(text, str):
        return None
    try:
        found = json.loads(text)
        if (found["format"], found["version"]) != (FORMAT, VERSION) or not isinstance(found["meta"], dict):
            raise ValueError
    except (ValueError, KeyError, TypeError):
        fix = "update skillframe, or name the columns with --columns"
        raise InputError(path, f"its metadata are no {FORMAT} of version {VERSION}", fix) from None
    meta: dict[str, Any] = found["meta"]
    return meta


def read_own(table: Table, meta: Mapping[str, Any], options: Mapping[str, Any]) -> Demonstration:
    """The demonstration of a table whose columns are those that `write_robomimic` writes.

    Raises:
        InputError: a column is missing, or anything of the contract's list of bad input.
    """
    named = {f"obs/{data}[{i}]": name for data, names in OBSERVED.items() for i, name in enumerate(names)}
    named["obs/time"] = "t"
    if lost := [column for column in named if column not in table.names]:
        raise InputError(table.source, f"lacks {lost[0]}", "write it again, or name the columns with --columns")
    further = f"obs/{FURTHER}"
    named |= {column: column.removeprefix(further) for column in table.names if column.startswith(further)}
    columns = {name: table.values[:, table.names.index(column)] for column, name in named.items()}
    chosen = read_options(options)
    return assemble_split(Columns(columns, table.source), dict(meta), chosen, [], read_wrench_file(chosen))

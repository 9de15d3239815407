"""What a run leaves behind: a table over time and what is needed to draw it again, in one npz file.

A trace file needs nothing else to be plotted, replayed in 3-D or reported on: the scene's geometry is in its metadata
and the bodies' poses are in its arrays.
"""

from __future__ import annotations

import io
import json
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

import numpy as np

from skillframe.errors import InputError
from skillframe.execution.tracemeta import LARGEST, check_meta
from skillframe.files import write_whole
from skillframe.files.npz import json_member, read_arrays
from skillframe.frames import Float

FORMAT, VERSION = "skillframe.trace", 1
GIVE = "give a .npz written by skillframe run"
MACHINE = "machine_"
"""Begins the names of a hydraulic machine's arrays in a file."""
COLUMNS = {
    "time": (),
    "position": (3,),
    "quaternion": (4,),
    "twist": (6,),
    "wrench": (6,),
    "wrench_true": (6,),
    "desired_position": (3,),
    "desired_quaternion": (4,),
    "command_wrench": (6,),
}
DRAWN = ("time", "position", "quaternion", "body_position", "body_quaternion")


@dataclass(frozen=True, slots=True, kw_only=True)
class Trace:
    """One trial over time.

    Attributes:
        time: (T,) [s].
        position, quaternion: (T, 3), (T, 4) measured pose of the centre of compliance in base.
        twist: (T, 6) of that point, base axes.
        wrench: (T, 6) filtered wrench of the environment on the tool at that point, base axes.
        wrench_true: (T, 6) the simulator's contact wrench at that point, base axes.
        desired_position, desired_quaternion: (T, 3), (T, 4) what the skill wanted.
        command_wrench: (T, 6) the law's output at that point, robot on environment, base axes.
        q: (T, nq) configuration.
        body_position, body_quaternion: (T, B, 3), (T, B, 4) poses of the drawn bodies in base, x, y, z, w.
        machine: of a robot with k actuators of its own, else empty. Servos: `servo_command` (T, k) [N m or rad] and
            `servo_` with each output that is mapped, such as `servo_force` [N m] and `servo_motor_velocity` [rad/s].
            A hydraulic machine: `pressure_a`, `pressure_b` (T, k) measured [Pa],
            `valve` (T, k) commanded, `piston_force` (T, k) from pressures and friction as known, `piston_force_true`
            (T, k) [N], `force_sigma` (T, 2) of the estimated contact force in the machine's plane [N], `force_valid`
            (T,), `energy_supply` and `energy_pistons` (T,) since the start [J].
        meta: `robot`, `world`, `params`, `seed`, `trial`, `draws`, `success`, `failure`, `status`, `reason`,
            `duration_s`, `peak_force_n`, `peak_force_filtered_n`, `peak_force_10ms_n`, `peak_torque_share`,
            `peak_speed_share`, `ended_by`, `goal_reached`, `ended_itself`, `distance_to_collision_m`,
            `final_error_m`, `final_error_rad`, `center_of_compliance`, `skill`, `events` ([[t, text]]),
            `progress` (`word`, `of_m`, `reached_m`; null in a world without a depth),
            `scores` ({name: {`value`, `unit`, `summary`}}, null for a trial without that figure; where asked for),
            `actuators` (joints with one of their own), `notes` (sentences about what stood in for what), `touched`
            (names of two bodies, where that ended it), and `bodies`:
            [{`name`, `geoms`: [{`kind`, `size`, `position`, `quaternion`, `rgba`, `vertices`, `faces`}]}] in the order
            of the body arrays.
    """

    time: Float
    position: Float
    quaternion: Float
    twist: Float
    wrench: Float
    wrench_true: Float
    desired_position: Float
    desired_quaternion: Float
    command_wrench: Float
    q: Float
    body_position: Float
    body_quaternion: Float
    machine: dict[str, Float] = field(default_factory=dict)
    meta: dict[str, Any] = field(default_factory=dict)

    @property
    def estimated(self) -> bool:
        """Whether the contact force was estimated, as from a hydraulic machine's pressures, and not measured."""
        return "force_sigma" in self.machine

    def save(self, path: Path) -> None:
        """Write the trace, whole or not at all.

        Raises:
            InputError: the file cannot be written.
        """
        arrays = {name: getattr(self, name) for name in [*COLUMNS, "q", "body_position", "body_quaternion"]}
        arrays.update({MACHINE + name: array for name, array in self.machine.items()})
        meta = json.dumps({"format": FORMAT, "version": VERSION, **self.meta}, sort_keys=True, ensure_ascii=False)
        meta = meta.encode("utf-8", "replace").decode()  # half a surrogate pair is no text
        buffer = io.BytesIO()
        np.savez_compressed(buffer, meta=np.array(meta), **arrays)
        write_whole(path, buffer.getvalue())

    @classmethod
    def load(cls, path: Path) -> Trace:
        """Read a trace file.

        Raises:
            InputError: missing, not a trace, or of a newer version.
        """
        arrays = read_arrays(path, "trace file", GIVE)
        meta = json_member(path, arrays, "meta", GIVE) if "meta" in arrays else None
        if meta is None:
            raise InputError(path, "is not a readable trace file, or is damaged (it holds no JSON object meta)", GIVE)
        del arrays["meta"]
        if meta.get("format") != FORMAT:
            raise InputError(path, f"has format {meta.get('format')!r}, not {FORMAT!r}", "give a trace file")
        if not isinstance(meta.get("version"), int) or meta["version"] > VERSION:
            raise InputError(path, f"is of version {meta.get('version')}, newer than {VERSION}", "update skillframe")
        machine = {name: arrays.pop(name) for name in list(arrays) if name.startswith(MACHINE)}
        _check_arrays(path, arrays)
        _check_numbers(path, {**arrays, **machine})
        check_meta(path, meta)
        for name, array in machine.items():
            if not array.ndim or len(array) != len(arrays["time"]):
                raise InputError(path, f"array {name} has the shape {array.shape}", "write the trace again")
        return cls(**arrays, machine={name.removeprefix(MACHINE): array for name, array in machine.items()}, meta=meta)


def _check_arrays(path: Path, arrays: dict[str, Float]) -> None:
    wanted = {f.name for f in fields(Trace)} - {"machine", "meta"}
    if set(arrays) != wanted:
        odd = ", ".join(sorted(set(arrays) ^ wanted))
        raise InputError(path, f"lacks, or does not know, the arrays {odd}", "write the trace again")
    rows = {name: len(array) if array.ndim else 0 for name, array in arrays.items()}
    for name, shape in COLUMNS.items():
        if rows[name] != rows["time"] or arrays[name].shape[1:] != shape:
            raise InputError(path, f"array {name} has the shape {arrays[name].shape}", "write the trace again")
    for name in ("q", "body_position", "body_quaternion"):
        if rows[name] != rows["time"]:
            raise InputError(path, f"array {name} has {rows[name]} rows, time {rows['time']}", "write the trace again")


def _check_numbers(path: Path, arrays: dict[str, Float]) -> None:
    """Numbers everywhere, none that overflows when squared, and places that can be drawn."""
    for name, array in arrays.items():
        if array.dtype.kind not in "fiub":
            raise InputError(path, f"array {name} holds {array.dtype}, no numbers", "write the trace again")
        size = np.abs(array.astype(float))
        good = size < LARGEST if name in DRAWN else ~(size >= LARGEST)
        if not good.all():
            row = int(np.argwhere(~good)[0][0])
            raise InputError(path, f"array {name} holds a number out of all bounds in row {row}", "run it again")
    if np.any(np.diff(arrays["time"]) <= 0.0):
        raise InputError(path, "its time does not increase", "write the trace again")

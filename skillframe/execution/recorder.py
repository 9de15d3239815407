"""Records a running batch into preallocated arrays of bounded size, and gives one `Trace` per trial.

When the arrays are full, every other sample is dropped and the rate is halved, so that an hour-long run keeps a bounded
trace of the whole run instead of growing without end.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skillframe.execution.trace import COLUMNS, MACHINE, Trace
from skillframe.frames import Float
from skillframe.skill import Command, Observation
from skillframe.world.drawing import drawn_bodies
from skillframe.world.plant import Plant
from skillframe.world.reading import Quaternions

CAPACITY, FIRST = 20_000, 1000  # samples per trial: at most, and before the arrays first grow


class Recorder:
    """Columns over time, a sample every `every` control ticks. True wrenches are taken at `point` of the tool frame.

    `machine` names what a hydraulic machine has besides, with the shape of one trial's sample.
    """

    def __init__(
        self, plant: Plant, every: int, point: Float, capacity: int = CAPACITY,
        machine: Mapping[str, tuple[int, ...]] | None = None,
    ) -> None:  # fmt: skip
        self._plant, self._every, self._point, self._capacity = plant, every, point, capacity
        count = plant.count
        self._quaternions = Quaternions(count)
        positions, _ = plant.body_poses()
        shapes: dict[str, tuple[int, ...]] = {
            **COLUMNS, "q": (plant.configuration.shape[1],), "body_position": positions.shape[1:],
            "body_quaternion": (positions.shape[1], 4),
            **{MACHINE + name: shape for name, shape in (machine or {}).items()},
        }  # fmt: skip
        self._data = {
            name: np.zeros((min(capacity, FIRST), count, *shape), np.float32 if name.startswith("body") else np.float64)
            for name, shape in shapes.items()
        }
        self._length = 0
        self._stop = np.full(count, -1.0)
        self._time = 0.0
        self._bodies: list[dict[str, Any]] | None = None

    def due(self, tick: int) -> bool:
        """Is a sample taken at this tick?"""
        return tick % self._every == 0

    def record(
        self, tick: int, time: float, observation: Observation, command: Command, law: Float,
        machine: Mapping[str, Float] | None = None,
    ) -> None:  # fmt: skip
        """Take a sample if one is due at this tick."""
        self._time = time
        if not self.due(tick):
            return
        if self._length == len(self._data["time"]):
            self._make_room()
        positions, quaternions = self._plant.body_poses()
        seen, desired = self._quaternions.of(observation.pose.rotation, command.pose.rotation)
        sample: dict[str, Any] = {
            "time": observation.time, "position": observation.pose.position, "twist": observation.twist,
            "quaternion": seen, "wrench": observation.wrench,
            "wrench_true": self._plant.contact_wrench(self._point), "desired_position": command.pose.position,
            "desired_quaternion": desired, "command_wrench": law,
            "q": self._plant.configuration, "body_position": positions, "body_quaternion": quaternions,
            **{MACHINE + name: value for name, value in (machine or {}).items()},
        }  # fmt: skip
        for name, value in sample.items():
            self._data[name][self._length] = value
        self._length += 1

    def _make_room(self) -> None:
        if self._length < self._capacity:
            for name, array in self._data.items():
                grown = np.zeros((min(2 * self._length, self._capacity), *array.shape[1:]), array.dtype)
                grown[: self._length] = array
                self._data[name] = grown
            return
        kept = (self._length + 1) // 2
        for array in self._data.values():
            array[:kept] = array[: self._length : 2]
        self._length, self._every = kept, 2 * self._every

    def close(self, rows: NDArray[np.int64]) -> None:
        """Mark trials as ended now. Their later rows are not part of their trace."""
        self._stop[rows] = self._time

    def trace(self, i: int, meta: dict[str, Any]) -> Trace:
        """The trace of trial i. Its arrays are views, so that N traces take no more memory than the recording."""
        length = self._length
        if self._stop[i] >= 0.0:
            length = int(np.searchsorted(self._data["time"][: self._length, i], self._stop[i], side="right"))
        arrays = {name: array[:length, i] for name, array in self._data.items()}
        machine = {name.removeprefix(MACHINE): arrays.pop(name) for name in list(arrays) if name.startswith(MACHINE)}
        if self._bodies is None:
            self._bodies = drawn_bodies(self._plant)
        return Trace(**arrays, machine=machine, meta={**meta, "bodies": self._bodies})

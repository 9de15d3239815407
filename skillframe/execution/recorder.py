"""Records a running batch into arrays of bounded size, with one `Trace` per trial.

When the arrays are full, every other sample is dropped and the rate halved, so that the trace covers the whole run.

A trace holds the bodies of the scene as JSON values, so that it can be drawn without its world.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from skillframe.errors import SkillframeError
from skillframe.execution.drive import Trials
from skillframe.execution.trace import COLUMNS, MACHINE, Trace
from skillframe.frames import Float
from skillframe.robot.meshes import hull_of
from skillframe.skill import Command, Observation
from skillframe.world.convert import BASE, FIXTURE, SPRUNG, TOOL
from skillframe.world.link_shapes import link_geoms
from skillframe.world.parts import obstacle_geoms
from skillframe.world.plant import Plant
from skillframe.world.reading import Quaternions
from skillframe.world.scene import Geom


def drawn_bodies(plant: Plant) -> list[dict[str, Any]]:
    """Name and geoms of every body but the world, in the order of `Plant.body_poses`."""
    scene = plant.scene
    links = link_geoms(plant.robot)
    still = (*links[plant.robot.model.names[0]], *obstacle_geoms(plant.robot).values())
    known = {**links, BASE: still, FIXTURE: scene.fixture, TOOL: scene.tool.geoms}
    known.update({SPRUNG + part.name: part.geoms for part in scene.sprung})
    bodies = []
    for body in range(1, plant.model.nbody):
        name = mujoco.mj_id2name(plant.model, mujoco.mjtObj.mjOBJ_BODY, body)
        bodies.append({"name": name, "geoms": [geom_json(g) for g in known.get(name, ()) if g.visible]})
    return bodies


def geom_json(geom: Geom) -> dict[str, Any]:
    """JSON values of a geom, lengths rounded to a micrometre."""
    result: dict[str, Any] = {
        "kind": geom.kind, "size": [round(float(s), 6) for s in geom.size],
        "position": [round(float(p), 6) for p in geom.position],
        "quaternion": [round(float(q), 8) for q in geom.quaternion], "rgba": list(geom.rgba),
    }  # fmt: skip
    if geom.vertices is not None:
        hull = hull_of(geom.vertices) if geom.faces is None else None
        if hull is not None:
            vertices, faces = hull.vertices, hull.faces
        else:
            vertices = geom.vertices
            faces = np.zeros((0, 3), dtype=np.int64) if geom.faces is None else np.asarray(geom.faces)
        result["vertices"], result["faces"] = np.round(vertices, 6).tolist(), faces.tolist()
    return result


FIRST = 1000  # samples per trial before the arrays first grow


class Recorder:
    """Records a sample every `every` control ticks, with true wrenches at `point` of the tool frame.

    `machine` gives names and sample shapes of the drive's own columns.
    """

    def __init__(
        self, plant: Plant, every: int, point: Float, capacity: int = 20_000,
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
        """Whether a sample is due."""
        return tick % self._every == 0

    def record(
        self, tick: int, time: float, observation: Observation, command: Command, law: Float,
        machine: Mapping[str, Float] | None = None,
    ) -> None:  # fmt: skip
        """Record a sample if one is due."""
        self._time = time
        if not self.due(tick):
            return
        if self._length == len(self._data["time"]):
            if self._length < self._capacity:
                for name, array in self._data.items():
                    grown = np.zeros((min(2 * self._length, self._capacity), *array.shape[1:]), array.dtype)
                    grown[: self._length] = array
                    self._data[name] = grown
            else:
                kept = (self._length + 1) // 2
                for array in self._data.values():
                    array[:kept] = array[: self._length : 2]
                self._length, self._every = kept, 2 * self._every
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

    def close(self, rows: NDArray[np.int64]) -> None:
        """Mark trials as ended, which cuts off later samples of their trace."""
        self._stop[rows] = self._time

    def trace(self, i: int, meta: dict[str, Any]) -> Trace:
        """The trace of trial i, whose arrays are views to save memory."""
        length = self._length
        if self._stop[i] >= 0.0:
            length = int(np.searchsorted(self._data["time"][: self._length, i], self._stop[i], side="right"))
        arrays = {name: array[:length, i] for name, array in self._data.items()}
        machine = {name.removeprefix(MACHINE): arrays.pop(name) for name in list(arrays) if name.startswith(MACHINE)}
        if self._bodies is None:
            self._bodies = drawn_bodies(self._plant)
        return Trace(**arrays, machine=machine, meta={**meta, "bodies": self._bodies})


class WithColumns:
    """A recorder with columns of a drive, computed only when a sample is due.

    Args:
        recorder: made with the columns' names and shapes.
        columns: returns the current columns, each (N, ...).
        seen: turns an observation into the one that is recorded.
    """

    def __init__(
        self, recorder: Recorder, columns: Callable[[], Mapping[str, Float]],
        seen: Callable[[Observation], Observation] = lambda observation: observation,
    ) -> None:  # fmt: skip
        self._recorder, self._columns, self._seen = recorder, columns, seen

    def record(self, tick: int, time: float, observation: Observation, command: Command, law: Float) -> None:
        """As `Recorder.record`."""
        due = self._recorder.due(tick)
        seen, columns = (self._seen(observation), self._columns()) if due else (observation, None)
        self._recorder.record(tick, time, seen, command, law, columns)

    def close(self, rows: Trials) -> None:
        """As `Recorder.close`."""
        self._recorder.close(rows)

    def trace(self, i: int, meta: dict[str, Any]) -> Trace:
        """As `Recorder.trace`."""
        return self._recorder.trace(i, meta)


def ratio(fast_hz: float, slow_hz: float, fast: str, slow: str) -> int:
    """Number of fast periods in a slow one.

    Raises:
        SkillframeError: a rate is not positive, or the ratio no whole number.
    """
    for name, rate in ((fast, fast_hz), (slow, slow_hz)):
        if not 0.0 < rate < float("inf"):
            raise SkillframeError(f"{name} at {rate:g} Hz is no rate; give samples per second, above 0")
    value = fast_hz / slow_hz
    count = round(value)
    if count < 1 or abs(value - count) > 1e-9 * value:
        raise SkillframeError(
            f"{fast} at {fast_hz:g} Hz is not a whole multiple of {slow} at {slow_hz:g} Hz; choose rates that divide"
        )
    return count

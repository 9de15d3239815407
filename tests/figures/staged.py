"""Demonstrations of several stages from the contact simulation, with the times between which their phases change.

The person goes over to the next stage at one instant; the tool follows when the push has turned and friction is
overcome. Between the two neither phase is wrong, so the truth is that interval: from the hand's change to the moment
when the recorded point has moved 1 mm (or the tool has turned 1 degree) in the new stage's way.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from skillframe_teaching.sessions import record
from skillframe_teaching.teacher import TeacherSettings

from skillframe.demonstration.record import Demonstration
from skillframe.execution.prepare import load_robot_model, load_world
from skillframe.frames import Float, matrix_from_quaternion, rotation_vector

MOVED_M, TURNED_RAD = 1e-3, float(np.deg2rad(1.0))


class StagedTask(NamedTuple):
    """A world with several stages, and how the second one moves: velocity direction (3,) or axis of turning (3,)."""

    world: str
    params: dict[str, Any]
    moves: tuple[float, float, float] | None = None
    turns: tuple[float, float, float] | None = None


TASKS = {
    "valley 45": StagedTask("valley", {"wall_distance": 0.05}, moves=(0.0, 1.0, 0.0)),
    "valley 30": StagedTask("valley", {"wall_distance": 0.05, "slope": float(np.deg2rad(30.0))}, moves=(0.0, 1.0, 0.0)),
    "corner": StagedTask("corner", {}, moves=(0.5**0.5, 0.5**0.5, 0.0)),
    "hose coupler": StagedTask("hose_coupler", {"interlock": 0.7}, turns=(0.0, 0.0, 1.0)),
}


class Taught(NamedTuple):
    """A demonstration and the interval (start, stop) [s] in which its phase truly changes."""

    demonstration: Demonstration
    change: tuple[float, float]


def taught(task: StagedTask, *, count: int, seed: int, noise_deg: float = 8.0) -> tuple[list[Taught], int]:
    """Demonstrations of a task, its starts in turn, and how many attempts were rejected."""
    person = TeacherSettings(aim_noise=float(np.deg2rad(noise_deg)))
    scene = load_world(task.world, task.params)
    recording = record(load_robot_model("free_tool"), scene, person, count=count, seed=seed, duration_s=20.0)
    return [Taught(d, change_of(d, task)) for d in recording.demonstrations], len(recording.rejected)


def change_of(demonstration: Demonstration, task: StagedTask) -> tuple[float, float]:
    """From when the hand goes over to the next stage to when the tool follows [s]."""
    (start,) = demonstration.meta["stages"]
    first = int(np.searchsorted(demonstration.time, start))
    progress: Float
    if task.moves is not None:
        progress = (demonstration.position[first:] - demonstration.position[first]) @ np.array(task.moves) / MOVED_M
    else:
        rotation = matrix_from_quaternion(demonstration.quaternion[first:])
        progress = rotation_vector(rotation @ rotation[0].T) @ np.array(task.turns) / TURNED_RAD
    return float(start), float(demonstration.time[first + int(np.argmax(progress > 1.0))])

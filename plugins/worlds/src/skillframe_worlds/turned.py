"""Rotates a whole scene about the fixture's origin, so that no axis of base or fixture is special."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TypeVar

import numpy as np

from skillframe.frames import Float, Pose, matrix_from_quaternion, quaternion_from_matrix, rotate, rotation_matrix
from skillframe.world import Geom, Mover, Scene, Sprung, State, Task, Vector

_T = TypeVar("_T")


def turned(scene: Scene, vector: Vector) -> Scene:
    """The scene with fixture, starts, goal and push turned by a rotation vector [rad] about the fixture's origin.

    The tool keeps its orientation relative to the parts. Scenes with a start lift, a holder, sprung parts or stages are
    not supported.
    """
    if not any(vector):
        return scene
    turn = rotation_matrix(np.array(vector))
    return replace(
        scene,
        fixture=tuple(_geom(geom, turn) for geom in scene.fixture),
        sprung=tuple(_mover(part, turn) for part in scene.sprung),
        start_tip=as_vector(turn @ np.array(scene.start_tip)),
        start_quaternion=turned_quaternion(turn, scene.start_quaternion),
        goal=_seen(scene.goal, turn),
        goal_error=_seen(scene.goal_error, turn),
        task=_task(scene.task, turn),
    )


def _geom(geom: Geom, turn: Float) -> Geom:
    place = as_vector(turn @ np.array(geom.position))
    return replace(geom, position=place, quaternion=turned_quaternion(turn, geom.quaternion))


def _mover(part: Sprung | Mover, turn: Float) -> Mover:
    assert isinstance(part, Mover)
    return replace(
        part, geoms=tuple(_geom(geom, turn) for geom in part.geoms), anchor=as_vector(turn @ np.array(part.anchor)),
        axis=as_vector(turn @ np.array(part.axis)), center_of_mass=as_vector(turn @ np.array(part.center_of_mass)),
        inertia=turn @ part.inertia @ turn.T,
    )  # fmt: skip


def _task(task: Task, turn: Float) -> Task:
    starts = []
    for start in task.starts:
        moved: dict[str, float] = {}
        for kind in ("offset", "tilt"):
            if kind == "offset" or any(key.startswith("start.tilt_") for key in start):
                vector = turn @ np.array([start.get(f"start.{kind}_{a}", 0.0) for a in "xyz"])
                moved |= {f"start.{kind}_{a}": float(vector[i]) for i, a in enumerate("xyz")}
        starts.append(moved)
    way = None if task.turn is None else as_vector(turn @ np.array(task.turn))
    return replace(task, direction=as_vector(turn @ np.array(task.direction)), turn=way, starts=tuple(starts))


def _seen(look: Callable[[State], _T], turn: Float) -> Callable[[State], _T]:
    def asked(state: State) -> _T:
        tip = Pose(rotate(turn.T, state.tip.position), turn.T @ state.tip.rotation)
        wrench = np.concatenate([rotate(turn.T, state.wrench[..., :3]), rotate(turn.T, state.wrench[..., 3:])], axis=-1)
        return look(State(tip, wrench, state.second))

    return asked


def as_vector(values: Float) -> Vector:
    """Three numbers as a tuple."""
    return (float(values[0]), float(values[1]), float(values[2]))


def turned_quaternion(turn: Float, given: tuple[float, float, float, float]) -> tuple[float, float, float, float]:
    """A quaternion after a rotation (3, 3) about the fixture's axes."""
    x, y, z, w = quaternion_from_matrix(turn @ matrix_from_quaternion(given))
    return (float(x), float(y), float(z), float(w))

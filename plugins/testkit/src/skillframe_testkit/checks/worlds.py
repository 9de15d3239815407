"""Checks of a world: a reproducible scene from defaults, with a goal not reached at the start.

It is also compiled and run (`skillframe_testkit.checks.trials`), its goal evaluated in many states
(`skillframe_testkit.checks.goals`).
"""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from skillframe.extend import WorldType
from skillframe.frames import Pose, matrix_from_quaternion
from skillframe_testkit.checks import goals, trials
from skillframe_testkit.checks.problems import attempt
from skillframe_testkit.checks.watch import left_behind, printed, watched

if TYPE_CHECKING:
    from skillframe.world import Geom, Scene


def check_world(world: WorldType) -> list[str]:
    """Problems of a world, built from its defaults."""
    with watched() as seen, np.errstate(all="ignore"):
        problems = _problems(world)
    return problems or list(printed(seen))


def _problems(world: WorldType) -> list[str]:
    for what, check in (("parameters", _parameter_problems), ("scene", _scene_problems)):
        if problems := attempt(what, partial(check, world)):
            return problems
    scene = world.build(world.params())
    problems = [p for what, check in SCENES.items() for p in attempt(what, partial(check, scene))]
    problems += attempt("parameters", partial(goals.idle_parameters, world, scene))
    problems = problems or attempt("runs", partial(trials.runs, scene))
    return problems or attempt("demonstration", partial(trials.taught, scene))


def _parameter_problems(world: WorldType) -> Iterator[str]:
    if not (isinstance(world.params, type) and dataclasses.is_dataclass(world.params)):
        yield f"params is {world.params!r}, not a dataclass"
        return
    if not world.params.__dataclass_params__.frozen:  # type: ignore[attr-defined]
        yield "params is not frozen; write @dataclass(frozen=True, slots=True, kw_only=True)"
    values = dataclasses.asdict(world.params())
    if json.loads(json.dumps(values, allow_nan=False)).keys() != values.keys():
        yield "the names of params do not survive JSON"


def _scene_problems(world: WorldType) -> Iterator[str]:
    with watched() as seen:
        scene = world.build(world.params())
    yield from left_behind(seen)
    if scene.name != world.name:
        yield f"the scene calls itself {scene.name!r}"
    if scene.friction < 0.0:
        yield f"friction is {scene.friction}"
    tool = scene.tool
    if "tip" not in tool.frames:
        yield "the tool has no frame 'tip'"
    if tool.hand not in tool.frames:
        yield f"the tool's hand {tool.hand!r} is not one of its frames ({', '.join(sorted(tool.frames))})"
    x, y, z = sorted(tool.inertia)
    if tool.mass <= 0.0 or x <= 0.0 or z > (x + y) * (1.0 + 1e-9):
        yield f"no body has mass {tool.mass} and principal inertia {tool.inertia}"
    yield from _placement_problems(scene)
    yield from _goal_problems(scene)
    if _fingerprint(world.build(world.params())) != _fingerprint(scene):
        yield "building twice from the same parameters gives different geometry"


def _placement_problems(scene: Scene) -> Iterator[str]:
    placed = {"start": scene.start_quaternion, **{f"geom {i}": g.quaternion for i, g in enumerate(_geoms(scene))}}
    if scene.task.aligned is not None:
        placed["task.aligned"] = scene.task.aligned
    for name, quaternion in placed.items():
        if abs(float(np.linalg.norm(quaternion)) - 1.0) > 1e-6:
            yield f"the quaternion of {name} is not of unit length: {quaternion}"
    if scene.task.direction is not None and abs(float(np.linalg.norm(scene.task.direction)) - 1.0) > 1e-6:
        yield f"task.direction is not of unit length: {scene.task.direction}"


def _goal_problems(scene: Scene) -> Iterator[str]:
    from skillframe.world import State

    position = np.tile(np.array(scene.start_tip, dtype=float), (3, 1))
    rotation = np.tile(matrix_from_quaternion(scene.start_quaternion), (3, 1, 1))
    state = State(Pose(position, rotation), np.zeros((3, 6)))
    reached, (distance, angle) = np.asarray(scene.goal(state)), scene.goal_error(state)
    for name, value in (("goal", reached), ("goal_error[0]", distance), ("goal_error[1]", angle)):
        if np.shape(value) != (3,) or not np.all(np.isfinite(value)):
            yield f"{name} gave {value!r} for 3 trials; expected one finite value a trial"
    if reached.dtype != np.bool_:
        yield f"goal gives {reached.dtype}, expected bool"
    elif len(scene.fixture) and np.any(reached):
        yield "the goal is reached at the start"


def _geoms(scene: Scene) -> list[Geom]:
    return [*scene.fixture, *scene.tool.geoms, *(g for part in scene.sprung for g in part.geoms)]


def _fingerprint(scene: Scene) -> str:
    rows = [
        {k: np.asarray(v).tolist() for k, v in dataclasses.asdict(geom).items() if v is not None}
        for geom in _geoms(scene)
    ]
    values = [rows, scene.start_tip, scene.start_quaternion, scene.friction, scene.tool.mass, scene.analytic]
    return json.dumps(values, default=lambda array: np.asarray(array).tolist())  # nested arrays of a surface


SCENES: Mapping[str, Callable[[Scene], Iterable[str]]] = {
    "size": trials.right_size,
    "orientation": trials.points_into_the_fixture,
    "start": trials.compiles,
    "goal": goals.rows_alone,
}
"""Checks of a scene."""

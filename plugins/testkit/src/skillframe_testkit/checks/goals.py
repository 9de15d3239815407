"""States for checks of a world's goal, from around the start to the smallest goal error."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from skillframe.errors import SkillframeError
from skillframe.extend import WorldType
from skillframe.frames import Float, Pose, matrix_from_quaternion, rotation_matrix
from skillframe_testkit.checks.playback import AGREEMENT, Rows

if TYPE_CHECKING:
    from skillframe.world import Scene, State, Task

TRIED, SPREAD = 60, (0.1, 0.3)
"""States per round, and the first spread [m, rad]."""


def states_of(scene: Scene) -> State:
    """The same N states each time, from around the start to the smallest `goal_error`."""
    from skillframe.world import State

    rng, moved = np.random.default_rng(11), np.random.default_rng(12)
    base = matrix_from_quaternion(scene.start_quaternion if scene.task.aligned is None else scene.task.aligned)
    middle, spread = np.append(np.array(scene.start_tip, dtype=float), np.zeros(3)), np.repeat(SPREAD, 3)
    away = scene.goal_error(State(Pose(middle[None, :3], base[None]), np.zeros((1, 6))))[0]
    spread[:3] = np.clip(np.max(away), SPREAD[0], 2.0)  # m
    parts: list[State] = []
    for _ in range(14):
        drawn = middle + spread * rng.normal(size=(TRIED, 6))
        wrench = rng.normal(size=(TRIED, 6)) * np.repeat([20.0, 1.0], 3) * rng.integers(0, 2, (TRIED, 1))
        parts.append(State(Pose(drawn[:, :3], rotation_matrix(drawn[:, 3:]) @ base), wrench, _travels(scene, moved)))
        distance, angle = scene.goal_error(parts[-1])
        best = drawn[np.argsort(distance + 0.1 * angle, kind="stable")[:12]]  # a lever of 0.1 m
        middle, spread = best.mean(0), np.maximum(best.std(0), np.maximum(0.4 * spread, 1e-5))
    position, rotation = (np.concatenate([getattr(p.tip, name) for p in parts]) for name in Pose._fields)
    second = {name: np.concatenate([p.second[name] for p in parts]) for name in parts[0].second}
    return State(Pose(position, rotation), np.concatenate([p.wrench for p in parts]), second)


def _travels(scene: Scene, rng: np.random.Generator) -> dict[str, Float]:
    """Travel of second parts (`TRIED`,) by name, within their range and mostly near its ends."""
    from skillframe.world import Mover

    found = {}
    for part in (each for each in scene.sprung if isinstance(each, Mover)):
        for name in part.quantities:
            low, high = part.range or (0.0 if part.joint == "free" else -SPREAD[1], SPREAD[1])
            near = (high - low) * rng.uniform(size=TRIED) ** 3
            found[name] = np.where(rng.integers(0, 2, TRIED) == 0, low + near, high - near)
    return found


def some(state: State, rows: Rows) -> State:
    """Rows of a state."""
    from skillframe.world import State

    second = {name: values[rows] for name, values in state.second.items()}
    return State(Pose(state.tip.position[rows], state.tip.rotation[rows]), state.wrench[rows], second)


def rows_alone(scene: Scene) -> Iterator[str]:
    """Check that goals and errors are the same in a batch as alone."""
    state = states_of(scene)
    reached = np.flatnonzero([bool(np.all(scene.goal(some(state, slice(i, i + 1))))) for i in range(len(state.wrench))])
    chosen = np.append(np.arange(0, len(state.wrench), len(state.wrench) // 24), reached[:12])
    together = some(state, chosen)
    judges: dict[str, Callable[[State], Float]] = {
        "goal": lambda state: np.asarray(scene.goal(state), dtype=float),
        "goal_error[0]": lambda state: np.asarray(scene.goal_error(state)[0]),
        "goal_error[1]": lambda state: np.asarray(scene.goal_error(state)[1]),
    }
    for name, judge in judges.items():
        whole = judge(together)
        alone = np.concatenate([judge(some(together, slice(i, i + 1))) for i in range(len(chosen))])
        if whole.shape != alone.shape or np.abs(whole - alone).max() > AGREEMENT:
            yield f"{name} of a trial depends on the others of its batch; judge each row of the state by itself"


def idle_parameters(world: WorldType, scene: Scene) -> Iterator[str]:
    """Check that every parameter changes the scene, its goal, or the task."""
    defaults = world.params()
    state = states_of(scene)
    before = _told(scene, state)
    for each in dataclasses.fields(world.params):
        tried = []
        for value in _others(getattr(defaults, each.name)):
            try:
                other = world.build(dataclasses.replace(defaults, **{each.name: value}))
            except SkillframeError:  # out of range
                continue
            tried.append(value)
            if _told(other, state) != before:
                break
        else:
            if tried:
                values = " or ".join(f"{v:.4g}" if isinstance(v, float) else repr(v) for v in tried[:2])
                yield f"parameter {each.name} has no effect: {values} gives the same scene and goal; use it or drop it"


def _others(value: Any) -> list[Any]:
    if isinstance(value, bool):
        return [not value]
    if isinstance(value, int):
        return [value + 1, value - 1, 2 * value, value + 4]
    if isinstance(value, float):
        near = [1.2 * value, 0.8 * value, 1.02 * value, 0.98 * value, 2.0 * value, 0.5 * value]
        return [v for v in near if v != value] + [value + 0.001, value + 0.05, value - 0.05, value + 1.0, value + 1e4]
    if isinstance(value, tuple) and all(isinstance(v, int | float) for v in value):
        return [value[1:] + value[:1], tuple(-v for v in value), tuple(v + 0.1 for v in value)]
    return []


def _told(scene: Scene, state: State) -> list[Any]:
    offset = 0.1 * np.linspace(-1.0, 1.0, 12).reshape(4, 3)
    functions = [scene.goal(state), *scene.goal_error(state), scene.start_lift(offset, offset[::-1])]
    functions += [stage.done(state) for stage in _stages(scene.task) if stage.done is not None]
    plain = {field.name: getattr(scene, field.name) for field in dataclasses.fields(scene) if field.name != "params"}
    return [_plain(plain), [np.asarray(value).tolist() for value in functions]]


def _stages(task: Task) -> list[Task]:
    return [task, *(inner for stage in task.then for inner in _stages(stage))]


def _plain(value: Any) -> Any:
    if dataclasses.is_dataclass(value):
        return [_plain(getattr(value, field.name)) for field in dataclasses.fields(value)]
    if isinstance(value, dict):
        return [[key, _plain(value[key])] for key in value]
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, list | tuple):
        return [_plain(each) for each in value]
    return None if callable(value) else value

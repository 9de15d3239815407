"""Simulated searches in MuJoCo: blind demonstrations, goals, and the time to find each.

A goal is found when the true tip is 2.5 mm below the true surface.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from skillframe_teaching.blind import CUT, BlindSettings, record_blind

from skillframe.demonstration import Demonstration
from skillframe.document import learned
from skillframe.execution import Result, load_robot_model, load_world, prepare, simulate
from skillframe.extend import Document, LearnOptions, registry
from skillframe.frames import Float
from skillframe.robot import RobotModel
from skillframe.world import Scene

FOUND_M = 0.0025
NOBODY_KNEW = (0.0, 0.0, 0.0)


class Task(NamedTuple):
    """World of a search, and the belief of the blind teacher.

    Attributes:
        world: its name.
        params: of the world, (name, value) pairs.
        believed: standard deviations of goal minus start along x and y and about the push [m, m, rad].
        centre: its mean.
    """

    world: str
    params: tuple[tuple[str, float], ...]
    believed: tuple[float, float, float]
    centre: tuple[float, float, float] = NOBODY_KNEW

    @property
    def scene(self) -> Scene:
        """World whose search ends 2.5 mm deep."""
        return load_world(self.world, {**dict(self.params), "done_depth": FOUND_M})


@cache
def demonstrations(task: Task, count: int = 5, seed: int = 1, time_s: float = 30.0) -> tuple[Demonstration, ...]:
    """Blind searches of a teacher who believes in N(centre, believed^2), for `time_s` at most [s]."""
    settings = BlindSettings(believed=task.believed, centre=task.centre, time_s=time_s)
    robot = load_robot_model("free_tool")
    return tuple(record_blind(robot, task.scene, settings, count=count, seed=seed).demonstrations)


def document(task: Task, given: Sequence[Demonstration], **settings: Any) -> Document:
    """A search learned at the tip."""
    return learned(registry().skill("search"), given, LearnOptions(at="tip", settings=settings))


def goals(count: int, task: Task, seed: int = 100) -> Float:
    """(count, 3) goals against the start [m, m, rad]: samples of the belief, without those found at once."""
    normal = np.random.default_rng(seed).standard_normal((20 * count, 3))
    where = np.array(task.centre) + normal[np.abs(normal).max(axis=1) < CUT] * np.array(task.believed)
    # a part set down this near falls in by itself [m, rad]
    trivial = (np.hypot(where[:, 0], where[:, 1]) < 0.0015) & (np.abs(where[:, 2]) < 0.06)
    result: Float = where[~trivial][:count]
    return result


def starts(where: Float) -> dict[str, Float]:
    """Quantities of the executor that put the start at minus the goal."""
    return {"start.offset_x": -where[:, 0], "start.offset_y": -where[:, 1], "start.tilt_z": -where[:, 2]}


def search(
    found: Document, scene: Scene, where: Float, *, duration_s: float, seed: int = 5, robot: RobotModel | None = None,
    draws: Mapping[str, Float] | None = None,
) -> tuple[Result, Float]:  # fmt: skip
    """Result of one batch, and seconds to the find per trial (inf where it was not found)."""
    skill, setup = prepare(robot or load_robot_model("free_tool"), scene, found)
    rngs = [np.random.default_rng([seed, i]) for i in range(len(where))]
    result = simulate(skill, setup, {**starts(where), **(draws or {})}, rngs, duration_s=duration_s)
    return result, np.where(result.success, result.duration_s, np.inf)


def share(seconds: Float, budget: float) -> float:
    """Share found within a budget of seconds."""
    return float((seconds <= budget).mean())

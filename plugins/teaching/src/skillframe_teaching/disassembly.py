"""A simulated teacher who takes the part out, which is easier than putting it in: a demonstration by disassembly.

The part starts in the assembled pose, and the hand pulls it against the task's direction, compliant across it and in
rotation, until its tip is where runs start. Turned round in time, the record gives place, way and orientation. It does
not show the forces of an insertion: friction changes its sign, and nothing shows what the part is pressed against.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skillframe.errors import InputError
from skillframe.extend import Recording
from skillframe.frames import Float
from skillframe.robot import RobotModel
from skillframe.world import Scene, State
from skillframe_teaching import sessions
from skillframe_teaching.teacher import TeacherSettings

NAME = "disassembly"


def taking_out(scene: Scene) -> TeacherSettings:
    """Default settings: a steady hand, which the part guides."""
    return TeacherSettings(kind=NAME, aim_noise=0.0, tremor_force=0.0, tremor_torque=0.0)


def record_removal(
    robot: RobotModel, scene: Scene, settings: TeacherSettings, *, count: int, seed: int, **more: Any
) -> Recording:
    """Take the part of a scene out `count` times. Further arguments and errors are those of `sessions.record`.

    Raises:
        InputError: the scene has no assembled pose, or the part does not come straight out.
    """
    return sessions.record(robot, removal(scene), settings, count=count, seed=seed, **more)


def removal(scene: Scene) -> Scene:
    """The scene whose task is to take the part out, from the assembled pose to the height where runs start.

    Raises:
        InputError: the scene has no assembled pose, or the part does not come straight out.
    """
    task, way = scene.task, scene.way
    straight = task.direction is not None and not task.then and task.aligned == scene.start_quaternion
    if way is None or way.word != "inserted" or not straight:
        what = f"needs a part that comes straight out of a hole, and {scene.name} has none"
        raise InputError(f"teacher {NAME}", what, "show how it is put in, with --teacher kinesthetic")
    assert task.direction is not None
    x, y, z = task.direction
    height = scene.start_tip[2]

    def out(state: State) -> NDArray[np.bool_]:
        return np.asarray(state.tip.position[..., 2] > height)

    def left(state: State) -> tuple[Float, Float]:
        return np.maximum(height - state.tip.position[..., 2], 0.0), scene.goal_error(state)[1]

    pull = replace(
        task, direction=(-x, -y, -z), hand="sliding", starts=({"start.offset_z": -way.of_m - height},), done=out,
        stop=None, held_s=0.0,
    )  # fmt: skip
    return replace(scene, task=pull, goal=out, goal_error=left)

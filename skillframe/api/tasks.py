"""Robots and worlds as the functions of the API take them: objects, names or files, turned into objects."""

from __future__ import annotations

import os
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from skillframe.api.inputs import File
from skillframe.api.settings import doubts
from skillframe.errors import SkillframeWarning
from skillframe.execution.prepare import load_robot_model, load_world, split_settings
from skillframe.robot.model import RobotModel
from skillframe.robot.spec import RobotSpec
from skillframe.world.scene import Scene

Robot = File | RobotSpec | RobotModel
"""A name, a robot.toml or its folder, or a robot that was loaded before."""
World = File | Scene
"""A registered name, a fixture file of two parts, or a scene of one's own."""
Settings = Mapping[str, Any]
"""What differs from the nominal, by the names of `skillframe settings`: SI numbers, or text with a unit, "5deg"."""


def robot_of(given: Robot) -> RobotModel:
    """A robot that is ready to be simulated.

    Raises:
        SkillframeError: as `skillframe.execution.prepare.load_robot_model`.
    """
    if isinstance(given, RobotModel):
        return given
    return load_robot_model(given if isinstance(given, str | RobotSpec) else Path(given))


def scene_of(world: World, settings: Settings | None, depth: int) -> tuple[Scene, dict[str, float]]:
    """The scene with its parameters set, and the quantities of the trial.

    Bare numbers that look like millimetres or degrees are warned of.

    Args:
        world: a name, a fixture file or a scene.
        settings: what differs from the nominal.
        depth: how many calls above this one the user's line stands, for warnings.

    Raises:
        UnknownName: no such world, or a setting that it does not have.
        InputError: a value that cannot be used, or a parameter of a scene that is built already.
    """
    given = dict(settings or {})
    if isinstance(world, Scene):
        _, draws = split_settings(None, given)
        return world, draws
    world = os.fspath(world)
    params, draws = split_settings(world, given)
    for text in doubts(world, given):
        warnings.warn(text, SkillframeWarning, stacklevel=depth + 1)
    return load_world(world, params), draws

"""What the functions of the API take: an object, a name or a file path, turned into the object."""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from skillframe.api.settings import doubts
from skillframe.demonstration.record import Demonstration
from skillframe.errors import InputError, SkillframeWarning
from skillframe.execution.prepare import load_robot_model, load_world, split_settings
from skillframe.extend.reading import read_demonstration
from skillframe.robot.model import RobotModel
from skillframe.robot.spec import RobotSpec
from skillframe.world.scene import Scene

File = str | os.PathLike[str]
Demonstrations = Demonstration | File | Iterable[Demonstration | File]
"""One demonstration or several, each as an object or as a file of any registered format."""
Robot = File | RobotSpec | RobotModel
"""A name, a robot.toml or its folder, or a robot that was loaded before."""
World = str | Scene
"""A registered name, or a scene of one's own."""
Settings = Mapping[str, Any]
"""What differs from the nominal, by the names of `skillframe settings`: SI numbers, or text with a unit, "5deg"."""


def demonstrations_of(given: Demonstrations) -> list[Demonstration]:
    """A list of demonstrations.

    Raises:
        InputError: none is given, a file cannot be read, or something is no demonstration.
    """
    several = [given] if isinstance(given, Demonstration | str | os.PathLike) else given
    if not isinstance(several, Iterable):
        raise InputError(f"{given!r:.60}", "is no demonstration", "give demonstrations or their files")
    found = [_demonstration(each) for each in several]
    if not found:
        raise InputError("demonstrations", "there are none", "give at least one")
    return found


def _demonstration(given: object) -> Demonstration:
    if isinstance(given, Demonstration):
        return given
    if isinstance(given, str | os.PathLike):
        return read_demonstration(Path(given))
    raise InputError(f"{given!r:.60}", "is no demonstration", "give a Demonstration or a file")


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
        world: a name or a scene.
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
    params, draws = split_settings(world, given)
    for text in doubts(world, given):
        warnings.warn(text, SkillframeWarning, stacklevel=depth + 1)
    return load_world(world, params), draws

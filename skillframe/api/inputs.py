"""Demonstrations, robots and worlds as arguments of the API: objects, names or files, turned into objects."""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from skillframe.api.settings import doubts
from skillframe.demonstration.record import Demonstration
from skillframe.errors import InputError, SkillframeWarning
from skillframe.extend.reading import read_demonstration
from skillframe.robot.spec import RobotSpec
from skillframe.world.scene import Scene

if TYPE_CHECKING:
    from skillframe.robot.model import RobotModel

File = str | os.PathLike[str]
Demonstrations = Demonstration | File | Iterable[Demonstration | File]
"""One demonstration or several, as objects or files of any registered format."""


def demonstrations_of(given: Demonstrations, layout: File | None = None) -> list[Demonstration]:
    """A list of demonstrations.

    Args:
        given: one or several, as objects or files.
        layout: a layout file with reading settings for the files.

    Raises:
        InputError: none is given, a file cannot be read, or an object is no demonstration.
    """
    several = [given] if isinstance(given, Demonstration | str | os.PathLike) else given
    if not isinstance(several, Iterable):
        raise InputError(f"{given!r:.60}", "is no demonstration", "give demonstrations or their files")
    found = [_demonstration(each, layout) for each in several]
    if not found:
        raise InputError("demonstrations", "there are none", "give at least one")
    return found


def _demonstration(given: object, layout: File | None) -> Demonstration:
    if isinstance(given, Demonstration):
        return given
    if isinstance(given, str | os.PathLike):
        return read_demonstration(Path(given), None if layout is None else Path(layout))
    raise InputError(f"{given!r:.60}", "is no demonstration", "give a Demonstration or a file")


Robot: TypeAlias = "File | RobotSpec | RobotModel"
"""A name, a robot.toml or its folder, or a loaded robot."""
World = File | Scene
"""A registered name, a fixture file of two parts, or a scene of one's own."""
Settings = Mapping[str, Any]
"""Deviations from the nominal, by the names of `worlds --settings`: SI numbers, or text with a unit, "5deg"."""


def robot_of(given: Robot) -> RobotModel:
    """Load a robot for simulation.

    Raises:
        SkillframeError: as `skillframe.execution.prepare.load_robot_model`.
    """
    from skillframe.execution.prepare import load_robot_model
    from skillframe.robot.model import RobotModel

    if isinstance(given, RobotModel):
        return given
    return load_robot_model(given if isinstance(given, str | RobotSpec) else Path(given))


def scene_of(world: World, settings: Settings | None, depth: int) -> tuple[Scene, dict[str, float]]:
    """The scene with its parameters set, and the quantities of the trial.

    Bare numbers that look like millimetres or degrees cause a warning.

    Args:
        world: a name, a fixture file or a scene.
        settings: deviations from the nominal.
        depth: how many calls above this one the user's line stands, for warnings.

    Raises:
        UnknownName: no such world, or a setting that it does not have.
        InputError: a value that cannot be used, or a parameter of a finished scene.
    """
    from skillframe.execution.prepare import load_world, split_settings

    given = dict(settings or {})
    if isinstance(world, Scene):
        _, draws = split_settings(None, given)
        return world, draws
    world = os.fspath(world)
    params, draws = split_settings(world, given)
    for text in doubts(world, given):
        warnings.warn(text, SkillframeWarning, stacklevel=depth + 1)
    return load_world(world, params), draws

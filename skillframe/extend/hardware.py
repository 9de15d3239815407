"""Records of what a skill runs on: robots, and drives between its commands and the plant."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pathlib import Path


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotType:
    """A robot: a folder with a robot.toml and all that it names.

    Attributes:
        name: of the robot, and of the folder.
        summary: one line for listings.
        contract: see `records.SkillType`.
        folder: where robot.toml lies. A campaign copies what robot.toml names, so that has to lie within.
    """

    name: str
    summary: str
    contract: str = ""
    folder: Path


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveType:
    """What stands between a skill's command and the plant: ideal torques, a position controller, actuators.

    Attributes:
        name: of the drive.
        summary: one line for listings.
        contract: see `records.SkillType`.
        make: `make(setup, draws, rngs)` gives the `skillframe.execution.drive.Drive` of len(rngs) trials at their
            starts: the run's set-up, its quantities per trial, each (N,), and a generator per trial for the sensors.
    """

    name: str
    summary: str
    contract: str = ""
    make: Callable[..., Any]

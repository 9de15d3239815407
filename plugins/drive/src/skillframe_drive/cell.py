"""`Cell`: a real robot and its surroundings, read from cell.toml."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from skillframe.config import build, read_toml

Witness = Literal["person", "pose"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Cell:
    """cell.toml.

    Attributes:
        robot: name of the robot, or its folder: the robot.toml that the skill was certified with.
        link: how the robot is commanded: a name of `skillframe plugins`.
        host: the robot's address.
        world: the task's world or fixture file, for its tool, the picture, and the way to the goal.
        believed: where the fixture is believed to be, as deviations from robot.toml: {"fixture.offset_x" = "8 mm"}.
        force_n: largest force of a run, if it is below robot.toml's [N, 1 to 1000].
        witness: who says that the task is done: "person", who is asked, or "pose", if the tool's measured pose reaches
            the goal of the believed fixture.
    """

    robot: str
    link: str
    host: str
    world: str
    believed: dict[str, float | str] = field(default_factory=dict)
    force_n: float = 60.0
    witness: Witness = "person"


def load_cell(path: Path) -> Cell:
    """Read cell.toml.

    Raises:
        InputError: missing, not TOML, or a key that cannot be used.
    """
    return build(Cell, read_toml(path), str(path))

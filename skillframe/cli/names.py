"""Names for the shell to complete, and the robot that every command takes where none is named.

The shell asks while somebody types, so a name is looked up by what is light: folders for robots, the registry for the
rest. What cannot be read completes to nothing; the command itself says what is wrong.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, TypeVar

import click

from skillframe.errors import SkillframeError

ROBOT = "panda"
"""The default robot: the one that every page uses."""
F = TypeVar("F", bound=Callable[..., Any])
Complete = Callable[[click.Context, click.Parameter, str], list[str]]


def _completed(names: Callable[[], Iterable[str]]) -> Complete:
    """A function for `shell_complete` of click: the names that begin with what is typed."""

    def complete(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[str]:
        try:
            return sorted(name for name in names() if name.startswith(incomplete))
        except (SkillframeError, OSError):
            return []

    return complete


def _robot_names() -> Iterable[str]:
    from skillframe.robot.spec import robot_names

    return robot_names()


def _arm_classes() -> Iterable[str]:
    from skillframe.robot.guesses import CLASSES

    return CLASSES


def _registered(*kinds: str) -> Callable[[], Iterable[str]]:
    def names() -> Iterable[str]:
        from skillframe.extend.registry import registry

        return [name for kind in kinds for name in registry().names(kind)]

    return names


robots = _completed(_robot_names)
arm_classes = _completed(_arm_classes)
worlds = _completed(_registered("world"))
skills = _completed(_registered("skill", "coordinator"))
segmenters = _completed(_registered("segmenter"))
formats = _completed(_registered("exporter"))
scores = _completed(_registered("score"))


def robot_option(function: F) -> F:
    """`--robot`, with the same default in every command."""
    option = click.option(
        "--robot", default=ROBOT, show_default=True, shell_complete=robots,
        help="Robot name, or its robot.toml or folder (skillframe robots list names them).",
    )  # fmt: skip
    return option(function)


def world_option(text: str) -> Callable[[F], F]:
    """`--world`, which has to be given."""
    return click.option(
        "--world", required=True, shell_complete=worlds, help=f"{text} (skillframe worlds list names them)."
    )

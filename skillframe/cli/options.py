"""Options that commands share, their types, and the completion of names.

Types refuse invalid numbers and file names of another kind as wrong usage. Every numeric option takes its type from
here: click's own accept NaN, infinity and integers of any length.

Completion must be fast: robots are looked up in folders, other names in the registry. On errors it is empty, and the
command itself reports them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, TypeVar

import click

from skillframe.config import LARGEST
from skillframe.config.units import UNITS, Range, parse, require_within, si
from skillframe.errors import InputError, SkillframeError
from skillframe.files.documents import LARGEST_WHOLE


class _Finite(click.FloatRange):
    """A range of finite numbers, since click's own range accepts NaN."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        number: float = super().convert(value, param, ctx)
        if not math.isfinite(number) or abs(number) > LARGEST:
            self.fail(f"{str(value)[:40]} is not a finite number of usual size.", param, ctx)
        return number


class WithUnit(click.ParamType):  # type: ignore[type-arg]  # generic from click 8.2 on
    """A number with a range, bare or with a unit: 20, 20ms. The value is in `word`.

    Args:
        word: unit of a bare number, such as "s" or "deg"; "" for a plain number.
        limits: in SI; None for any number.
        above: whether the lower end is excluded.
    """

    name = "quantity"

    def __init__(self, word: str, limits: Range | None, above: bool = False) -> None:
        self.unit, self.factor = UNITS[word] if word else ("", 1.0)
        self.limits, self.above = limits, above

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """The number in the option's unit."""
        try:
            number = self._bare(value)
            typed = value if isinstance(value, str) and parse(value) else number
            require_within(typed, number * self.factor, self.unit, self.limits, "")
        except InputError as error:
            self.fail(f"{error.problem}; {error.fix}.", param, ctx)
        if self.above and self.limits is not None and number * self.factor <= self.limits.least:
            self.fail(f"{number:g} is not above {self.limits.least:g}.", param, ctx)
        return number

    def _bare(self, value: Any) -> float:
        given = si(value, self.unit, "")
        if given is not value:
            return float(given) / self.factor
        try:
            return float(value)
        except ValueError:
            words = ", ".join(word for word, (unit, _) in UNITS.items() if unit == self.unit)
            also = f", bare or with one of {words}" if words else ""
            raise InputError("", f"{str(value)[:40]!r} is no number", f"give one{also}") from None


class _Whole(click.IntRange):
    """A range of integers within 64 bits."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> int:
        number: int = super().convert(value, param, ctx)
        if abs(number) > LARGEST_WHOLE:
            self.fail(f"{str(value)[:40]} is too large a whole number (beyond 64 bits).", param, ctx)
        return number


NUMBER = _Finite()
"""Any finite number."""
POSITIVE = _Finite(min=0.0, min_open=True)
"""A finite number above zero."""
NOT_NEGATIVE = _Finite(min=0.0)
"""A finite number of zero or more."""
WHOLE = _Whole()
"""An integer."""
NATURAL = _Whole(min=0)
"""An integer of zero or more."""
COUNT = _Whole(min=1, max=1_000_000)
"""A count of 1 to a million; more would be a typing mistake."""
SEED = NATURAL
"""A seed of everything random."""


KINDS = frozenset(
    (".csv", ".htm", ".html", ".json", ".mp4", ".npz", ".pdf", ".png", ".py", ".toml", ".txt", ".urdf", ".yaml", ".yml")
)
"""Known endings; others are part of a name."""


class OutputFile(click.Path):
    """A file to write with one of some endings, or with an unknown one."""

    def __init__(self, *endings: str) -> None:
        super().__init__(path_type=Path, dir_okay=False)
        self.endings = endings

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Path:
        """Check and return the path.

        Raises:
            InputError: its ending is that of another kind of file.
        """
        path = Path(str(super().convert(value, param, ctx)))
        if path.suffix.lower() in KINDS.difference(self.endings):
            raise InputError(path, "is the name of another kind of file", f"let it end in {self.endings[0]}")
        return path


TRACE = OutputFile(".npz")
"""An argument that names a trace to write."""
SKILL = OutputFile(".json")
"""An argument that names a skill file to write."""
PAGE = OutputFile(".html", ".htm")
"""An argument that names a page to write."""


ROBOT = "panda"
_F = TypeVar("_F", bound=Callable[..., Any])
Complete = Callable[[click.Context, click.Parameter, str], list[str]]


def _completed(names: Callable[[], Iterable[str]]) -> Complete:
    def complete(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[str]:
        try:
            return sorted(name for name in names() if name.startswith(incomplete))
        except (SkillframeError, OSError):
            return []

    return complete


def or_command(complete: Complete | None = None) -> Complete:
    """Completion of an argument whose place a command's name may take."""

    def completed(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[str]:
        below = ctx.command.list_commands(ctx) if isinstance(ctx.command, click.Group) else []
        own = complete(ctx, param, incomplete) if complete is not None else []
        return [*own, *(name for name in below if name.startswith(incomplete))]

    return completed


def _robot_names() -> Iterable[str]:
    from skillframe.robot.spec import robot_names

    return robot_names()


def _arm_classes() -> Iterable[str]:
    from skillframe.robot.link_checks import CLASSES

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
teachers = _completed(_registered("teacher"))
scores = _completed(_registered("score"))


def robot_option(function: _F) -> _F:
    """`--robot`, with the same default in every command."""
    option = click.option(
        "--robot", default=ROBOT, show_default=True, shell_complete=robots,
        help="Robot name, or its robot.toml or folder (skillframe robots lists them).",
    )  # fmt: skip
    return option(function)


def world_option(text: str) -> Callable[[_F], _F]:
    """`--world`, which is required."""
    return click.option("--world", required=True, shell_complete=worlds, help=f"{text} (skillframe worlds lists them).")


def layout_option(function: _F) -> _F:
    """`--layout` of a command that reads recordings and has no other reading option."""
    option = click.option(
        "--layout", type=click.Path(path_type=Path),
        help="Layout file with reading settings, from check --layout auto --write-layout, for files that need them.",
    )  # fmt: skip
    return option(function)

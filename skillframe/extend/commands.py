"""Commands that plug-ins add to `skillframe`: found by their metadata, imported when they are used.

An entry point in the group `skillframe.commands` names a click command, or a `LazyCommand`, which names its module::

    [project.entry-points."skillframe.commands"]
    my_command = "skillframe_my_plugin:my_command"

    my_command = LazyCommand("Does what I need.", "skillframe_my_plugin.command:command")

`skillframe --help` imports what the entry point names for its line of summary, so that module imports nothing heavy.
`SKILLFRAME_PLUGINS` leaves out a command together with the plug-ins of its distribution.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import redirect_stdout
from importlib import import_module
from typing import TYPE_CHECKING, Any

from skillframe.errors import SkillframeError
from skillframe.extend.contract import GROUP as PLUGINS
from skillframe.extend.metadata import EntryPoint, declaring

if TYPE_CHECKING:
    import click

GROUP = "skillframe.commands"
SUMMARY_WIDTH = 80


class BadCommand(SkillframeError):
    """A command of a plug-in that cannot be used. Says whose and why."""


class LazyCommand:
    """A command that is imported when it is used, and not for its line of summary.

    Attributes:
        summary: one line for listings.
        place: of the click command, "package.module:name".
    """

    __slots__ = ("place", "summary")

    def __init__(self, summary: str, place: str) -> None:
        self.summary, self.place = summary, place


class PluginCommand:
    """A command as its distribution's metadata declares it.

    Attributes:
        name: what is typed after `skillframe`.
        distributions: names of those that bring it; one, unless several bring the same name.
        version: of the first.
        selected: False where `SKILLFRAME_PLUGINS` leaves out every plug-in of the distribution.
        place: where the command is, "package.module:name"; "" if several distributions bring the name.
    """

    def __init__(self, name: str, distributions: tuple[str, ...], version: str, selected: bool, place: str) -> None:
        self.name, self.distributions, self.version = name, distributions, version
        self.selected, self.place = selected, place

    def summary(self) -> str:
        """Its line in a listing, or what is wrong with it."""
        try:
            found = self._named(self.place)
            return found.summary if isinstance(found, LazyCommand) else self.load().get_short_help_str(SUMMARY_WIDTH)
        except BadCommand as error:
            return str(error)

    def load(self) -> click.Command:
        """The command, its module imported now. What the module prints goes to stderr.

        Raises:
            BadCommand: several distributions bring it, it cannot be imported, or is no click command.
        """
        import click

        place, found = self.place, self._named(self.place)
        if isinstance(found, LazyCommand):
            place, found = found.place, self._named(found.place)
        if not isinstance(found, click.Command):
            raise self._bad(f"is {found!r} at {place}, which is no click command")
        return found

    def _named(self, place: str) -> Any:
        """What stands at "package.module:name"."""
        if len(self.distributions) > 1:
            rivals = " and ".join(self.distributions)
            raise BadCommand(f"the command {self.name} is in {rivals}; uninstall all but one")
        module, _, attribute = place.partition("[")[0].partition(":")
        try:
            with redirect_stdout(sys.stderr):
                found: Any = import_module(module.strip())
                for part in filter(None, attribute.strip().split(".")):
                    found = getattr(found, part)
        except (Exception, SystemExit) as error:  # one plug-in must not take the rest down
            if os.environ.get("SKILLFRAME_STRICT_PLUGINS") == "1":
                raise
            raise self._bad(f"cannot be loaded ({type(error).__name__}: {error})") from error
        return found

    def _bad(self, problem: str) -> BadCommand:
        return BadCommand(
            f"the command {self.name} of {self.distributions[0]} {self.version} {problem}; install it again"
        )


def plugin_commands() -> dict[str, PluginCommand]:
    """Every command of an installed distribution by name, in alphabetical order. Nothing is imported."""
    found: dict[str, PluginCommand] = {}
    for command in _declared():
        other = found.get(command.name)
        if other is not None and other.selected == command.selected:
            rivals = (*other.distributions, *command.distributions)
            found[command.name] = PluginCommand(other.name, rivals, other.version, other.selected, "")
        elif other is None or command.selected:
            found[command.name] = command
    return {name: found[name] for name in sorted(found)}


def _declared() -> Iterator[PluginCommand]:
    for distribution, version, points in declaring(GROUP):
        selected = _is_selected(points)
        for group, name, place in points:
            if group == GROUP:
                yield PluginCommand(name, (distribution,), version, selected, place)


def _is_selected(points: Sequence[EntryPoint]) -> bool:
    setting = os.environ.get("SKILLFRAME_PLUGINS")
    return setting is None or any(
        group == PLUGINS and name in {each.strip() for each in setting.split(",")} for group, name, _ in points
    )

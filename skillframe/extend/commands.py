"""Commands that plug-ins add to `skillframe`: found by their metadata, imported on use.

An entry point in the group `skillframe.commands` names a click command, or a `LazyCommand`, which names its module::

    [project.entry-points."skillframe.commands"]
    my_command = "skillframe_my_plugin:my_command"

    my_command = LazyCommand("Does what I need.", "skillframe_my_plugin.command:command")

`skillframe --help` imports the entry point's module for the summary, so that module should import nothing heavy.
`SKILLFRAME_PLUGINS` selects a command together with the plug-ins of its distribution.
"""

from __future__ import annotations

import os
import sys
from contextlib import redirect_stdout
from importlib import import_module
from typing import TYPE_CHECKING, Any

from skillframe.errors import SkillframeError
from skillframe.extend.contract import GROUP as PLUGINS
from skillframe.extend.isolated import isolated
from skillframe.extend.metadata import declaring

if TYPE_CHECKING:
    import click

GROUP = "skillframe.commands"


class BadCommand(SkillframeError):
    """A command of a plug-in cannot be used."""


class LazyCommand:
    """A command that is imported on use, but not for its summary.

    Attributes:
        summary: one line for listings.
        place: of the click command, "package.module:name".
    """

    __slots__ = ("place", "summary")

    def __init__(self, summary: str, place: str) -> None:
        self.summary, self.place = summary, place


class Left(SkillframeError):
    """A command's module raised `SystemExit`, `KeyboardInterrupt` or the like on import."""


class PluginCommand:
    """A command as declared in its distribution's metadata.

    Attributes:
        name: as typed after `skillframe`.
        distributions: names of those that bring it; one, unless several bring the same name.
        version: of the first.
        selected: False if `SKILLFRAME_PLUGINS` leaves out every plug-in of the distribution.
        place: of the command, "package.module:name"; "" if several distributions bring the name.
    """

    def __init__(self, name: str, distributions: tuple[str, ...], version: str, selected: bool, place: str) -> None:
        self.name, self.distributions, self.version = name, distributions, version
        self.selected, self.place = selected, place

    def summary(self) -> str:
        """Its line in a listing, or its error."""
        try:
            found = self._named(self.place)
            return found.summary if isinstance(found, LazyCommand) else self.load().get_short_help_str(80)
        except BadCommand as error:
            return str(error)

    def load(self) -> click.Command:
        """Import the command. What its module prints goes to stderr.

        Raises:
            BadCommand: several distributions bring it, it cannot be imported, or it is no click command.
        """
        import click

        place, found = self.place, self._named(self.place)
        if isinstance(found, LazyCommand):
            place, found = found.place, self._named(found.place)
        if not isinstance(found, click.Command):
            raise self._bad(f"is {found!r} at {place}, which is no click command")
        return found

    def _named(self, place: str) -> Any:
        if len(self.distributions) > 1:
            rivals = " and ".join(self.distributions)
            raise BadCommand(f"the command {self.name} is in {rivals}; uninstall all but one")
        module, _, attribute = place.partition("[")[0].partition(":")
        try:
            with redirect_stdout(sys.stderr), isolated(Left):
                found: Any = import_module(module.strip())
                for part in filter(None, attribute.strip().split(".")):
                    found = getattr(found, part)
        except Exception as error:  # a plug-in's error must not stop the others
            if os.environ.get("SKILLFRAME_STRICT_PLUGINS") == "1":
                raise
            said = str(error) if isinstance(error, Left) else f"{type(error).__name__}: {error}"
            raise self._bad(f"cannot be loaded ({said})") from error
        return found

    def _bad(self, problem: str) -> BadCommand:
        return BadCommand(
            f"the command {self.name} of {self.distributions[0]} {self.version} {problem}; install it again"
        )


def plugin_commands() -> dict[str, PluginCommand]:
    """Commands of all installed distributions, by name in alphabetical order, without importing them."""
    found: dict[str, PluginCommand] = {}
    setting = os.environ.get("SKILLFRAME_PLUGINS")
    for distribution, version, points in declaring(GROUP):
        selected = setting is None or any(
            group == PLUGINS and name in {each.strip() for each in setting.split(",")} for group, name, _ in points
        )
        for name, place in ((name, place) for group, name, place in points if group == GROUP):
            other = found.get(name)
            if other is not None and other.selected == selected:
                found[name] = PluginCommand(name, (*other.distributions, distribution), other.version, selected, "")
            elif other is None or selected:
                found[name] = PluginCommand(name, (distribution,), version, selected, place)
    return {name: found[name] for name in sorted(found)}

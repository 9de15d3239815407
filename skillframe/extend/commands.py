"""Commands that plug-ins add to `skillframe`: found by their metadata, imported when they are used.

An entry point in the group `skillframe.commands` names a click command::

    [project.entry-points."skillframe.commands"]
    my_command = "skillframe_my_plugin.command:command"

`skillframe --help` imports it for its line of summary, so its module imports nothing heavy. `SKILLFRAME_PLUGINS` leaves
out a command together with the plug-ins of its distribution.
"""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Iterator
from contextlib import redirect_stdout
from dataclasses import dataclass, replace
from importlib.metadata import EntryPoint, distributions
from typing import TYPE_CHECKING

from skillframe.errors import SkillframeError
from skillframe.extend.hookspecs import GROUP as PLUGINS

if TYPE_CHECKING:
    import click

GROUP = "skillframe.commands"


class BadCommand(SkillframeError):
    """A command of a plug-in that cannot be used. Says whose and why."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PluginCommand:
    """A command as its distribution's metadata declares it.

    Attributes:
        name: what is typed after `skillframe`.
        distributions: names of those that bring it; one, unless several bring the same name.
        version: of the first.
        selected: False where `SKILLFRAME_PLUGINS` leaves out every plug-in of the distribution.
        point: where the command is; None if several distributions bring the name.
    """

    name: str
    distributions: tuple[str, ...]
    version: str
    selected: bool
    point: EntryPoint | None

    def load(self) -> click.Command:
        """The command, its module imported now. What the module prints goes to stderr.

        Raises:
            BadCommand: several distributions bring it, it cannot be imported, or is no click command.
        """
        import click

        if self.point is None:
            rivals = " and ".join(self.distributions)
            raise BadCommand(f"the command {self.name} is in {rivals}; uninstall all but one")
        try:
            with redirect_stdout(sys.stderr):
                found = self.point.load()
        except (Exception, SystemExit) as error:  # one plug-in must not take the rest down
            if os.environ.get("SKILLFRAME_STRICT_PLUGINS") == "1":
                raise
            raise self._bad(f"cannot be loaded ({type(error).__name__}: {error})") from error
        if not isinstance(found, click.Command):
            raise self._bad(f"is {found!r} at {self.point.value}, which is no click command")
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
            found[command.name] = replace(other, distributions=rivals, point=None)
        elif other is None or command.selected:
            found[command.name] = command
    return {name: found[name] for name in sorted(found)}


def _declared() -> Iterator[PluginCommand]:
    """Commands, a distribution after the other. The first of one name on the path is the one that imports."""
    seen: set[str] = set()
    for distribution in distributions():
        if not re.search(rf"^\[{re.escape(GROUP)}\]", distribution.read_text("entry_points.txt") or "", re.MULTILINE):
            continue
        try:
            name, version = str(distribution.metadata["Name"]), str(distribution.metadata["Version"])
            points = list(distribution.entry_points)
        except Exception:  # metadata is foreign text; whatever it raises, `plugins list` names its plug-ins with it
            continue
        if name.lower() in seen:
            continue
        seen.add(name.lower())
        selected = _is_selected(points)
        for point in points:
            if point.group == GROUP:
                yield PluginCommand(
                    name=point.name, distributions=(name,), version=version, selected=selected, point=point
                )


def _is_selected(points: list[EntryPoint]) -> bool:
    setting = os.environ.get("SKILLFRAME_PLUGINS")
    return setting is None or any(
        point.group == PLUGINS and point.name in {name.strip() for name in setting.split(",")} for point in points
    )

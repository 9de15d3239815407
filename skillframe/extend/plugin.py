"""A plug-in, its kinds of record, and checks of what it yields.

Finds installed plug-ins: distributions with an entry point in the group, including damaged ones.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from importlib.metadata import Distribution, distributions
from typing import Any

from skillframe.errors import SkillframeError, UnknownName
from skillframe.extend import hardware, outputs, records
from skillframe.extend.contract import GROUP

RECORDS: Mapping[str, type[Any]] = {
    "skill": records.SkillType,
    "segmenter": records.SegmenterType,
    "coordinator": records.CoordinatorType,
    "world": records.WorldType,
    "world_file": records.WorldFileType,
    "teacher": records.TeacherType,
    "reader": records.ReaderType,
    "audit": records.AuditType,
    "row": outputs.RowType,
    "exporter": outputs.ExporterType,
    "score": outputs.ScoreType,
    "robot": hardware.RobotType,
    "drive": hardware.DriveType,
    "link": hardware.LinkType,
    "section": outputs.SectionType,
    "folder": outputs.FolderType,
    "output": outputs.OutputType,
    "requirement": outputs.RequirementType,
}
"""Type of the records of each kind."""
KINDS: Mapping[str, str] = {kind: f"skillframe_{kind}s" for kind in RECORDS}
"""Hook by kind of record."""


@dataclass(slots=True, kw_only=True)
class Plugin:
    """An installed plug-in: its origin, its records, and its error.

    Attributes:
        name: of the entry point.
        distribution, version: it was installed as.
        requires: requirements of the distribution.
        provides: "skill:slide" and so on.
        error: what went wrong, in words, or None.
    """

    name: str
    distribution: str
    version: str
    requires: tuple[str, ...] = ()
    provides: list[str] = field(default_factory=list)
    error: str | None = None

    def fail(self, error: BaseException) -> None:
        """Add an error. With `SKILLFRAME_STRICT_PLUGINS=1` raise it instead."""
        if os.environ.get("SKILLFRAME_STRICT_PLUGINS") == "1":
            raise error
        text = str(error) if isinstance(error, SkillframeError) else f"{type(error).__name__}: {error}"
        self.error = f"{self.error}; {text}" if self.error else text


class BadPlugin(SkillframeError):
    """A plug-in's entry module breaks the rules of the hooks."""


class OtherContract(SkillframeError):
    """A plug-in, or one of its records, was written for another skillframe."""


class PluginConflict(SkillframeError):
    """Two plug-ins provide one name."""

    def __init__(self, kind: str, name: str, first: Plugin, second: Plugin) -> None:
        super().__init__(
            f"{kind} {name!r} is provided by both {first.distribution} {first.version} and {second.distribution} "
            f"{second.version}; uninstall one, or select plug-ins with SKILLFRAME_PLUGINS"
        )


def hook_problems(module: object) -> Iterator[BadPlugin]:
    """Hooks that would never be called: misspelt names, and hooks without the marker."""
    for name in dir(module):
        function = getattr(module, name, None)
        marker = getattr(function, f"{GROUP}_impl", None)
        marked = isinstance(marker, dict)
        optional = isinstance(marker, dict) and marker["optionalhook"]  # a hook of a newer core, declared as such
        if name not in KINDS.values() and callable(function) and (marked or name.startswith("skillframe_")):
            if not optional:
                yield BadPlugin(str(UnknownName("hook", name, KINDS.values())))
        elif name in KINDS.values() and not marked:
            yield BadPlugin(
                f"{name} lacks @hookimpl and would never be called; add it (from skillframe import hookimpl)"
            )


def checked(kind: str, answer: object) -> list[Any]:
    """The records that a hook yielded. Raises `BadPlugin` if one is invalid."""
    hook, expected = KINDS[kind], RECORDS[kind]
    if not hasattr(answer, "__iter__"):
        raise BadPlugin(f"{hook} gave {answer!r} instead of yielding {expected.__name__} records")
    yielded: list[Any] = list(answer)
    for record in yielded:
        if not isinstance(record, expected):
            raise BadPlugin(f"{hook} yielded {record!r}, not a {expected.__name__}")
        if not (isinstance(record.name, str) and record.name):
            raise BadPlugin(f"{hook} yielded a {expected.__name__} with the name {record.name!r}; give it a word")
    names = [record.name for record in yielded]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise BadPlugin(f"{hook} yielded the name {', '.join(twice)} more than once")
    return yielded


def installed() -> list[tuple[Plugin, Callable[[], object]]]:
    """Installed plug-ins, each with its loader, by name. The loader of a damaged distribution raises its error.

    Only distributions whose entry points mention the group are parsed.
    """
    found: dict[tuple[str, str], tuple[Plugin, Callable[[], object]]] = {}
    seen: set[str] = set()
    for distribution in distributions():
        text = distribution.read_text("entry_points.txt") or ""
        if not re.search(rf"^\[{GROUP}\]", text, re.MULTILINE):
            continue
        name, version = _identity(distribution)
        if name.lower() in seen:  # the first on the path is the one that imports
            continue
        seen.add(name.lower())
        try:
            requires = tuple(distribution.requires or ())
        except Exception:  # damaged, which `_entries` reports
            requires = ()
        for entry, load in _entries(distribution, name):
            found[entry, name] = Plugin(name=entry, distribution=name, version=version, requires=requires), load
    return [found[key] for key in sorted(found)]


def _identity(distribution: Distribution) -> tuple[str, str]:
    """Name and version, from the folder's name if the metadata is damaged."""
    try:
        name, version = distribution.metadata["Name"], distribution.metadata["Version"]
    except Exception:  # damaged metadata may raise anything; the folder's name remains
        name, version = None, None
    folder = getattr(getattr(distribution, "_path", None), "stem", "unknown")
    stem, _, rest = folder.partition("-")
    return str(name or stem), str(version or rest or "?")


def _entries(distribution: Distribution, name: str) -> list[tuple[str, Callable[[], object]]]:
    try:
        points = [point for point in distribution.entry_points if point.group == GROUP]
    except Exception as error:  # a damaged entry_points.txt
        damage = BadPlugin(f"entry_points.txt of {name} cannot be read ({error}); install it again")

        def load() -> object:
            raise damage

        return [(name, load)]
    return [(point.name, point.load) for point in points]

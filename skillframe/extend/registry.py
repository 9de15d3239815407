"""What exists: discovers plug-ins, isolates the ones that fail, and answers to names.

pluggy is used for discovery only. Each entry point is loaded on its own, and each hook implementation is called on its
own, so that a plug-in that fails to import or raises loses its own records and nothing else; it is named in
`Registry.plugins` with its distribution, version and error. The environment variable `SKILLFRAME_PLUGINS` (comma list
of entry-point names, empty for none) selects a subset; `SKILLFRAME_STRICT_PLUGINS=1` raises instead of isolating.
"""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import redirect_stdout
from dataclasses import dataclass, field
from functools import lru_cache
from importlib.metadata import Distribution, EntryPoint, distributions
from typing import Any

import pluggy

from skillframe.errors import SkillframeError, UnknownName
from skillframe.extend import hookspecs
from skillframe.extend.homes import where_to_get
from skillframe.extend.records import CoordinatorType, ReaderType, RowType, SegmenterType, SkillType, WorldType

KINDS: Mapping[str, str] = {
    "skill": "skillframe_skills",
    "segmenter": "skillframe_segmenters",
    "coordinator": "skillframe_coordinators",
    "world": "skillframe_worlds",
    "reader": "skillframe_readers",
    "row": "skillframe_rows",
}
RECORDS: Mapping[str, type[Any]] = {
    "skill": SkillType,
    "segmenter": SegmenterType,
    "coordinator": CoordinatorType,
    "world": WorldType,
    "reader": ReaderType,
    "row": RowType,
}


@dataclass(slots=True, kw_only=True)
class Plugin:
    """One plug-in as found: where it comes from, what it provides, and its error if it has one."""

    name: str
    distribution: str
    version: str
    provides: list[str] = field(default_factory=list)
    error: str | None = None

    def fail(self, error: BaseException) -> None:
        """Keep an error beside those it already has; with `SKILLFRAME_STRICT_PLUGINS=1` raise it instead."""
        if os.environ.get("SKILLFRAME_STRICT_PLUGINS") == "1":
            raise error
        text = f"{type(error).__name__}: {error}"
        self.error = f"{self.error}; {text}" if self.error else text


class BadPlugin(SkillframeError):
    """A plug-in's entry module breaks the rules of the hooks; says which and how."""


class PluginConflict(SkillframeError):
    """Two plug-ins provide one name; both are named."""

    def __init__(self, kind: str, name: str, first: Plugin, second: Plugin) -> None:
        super().__init__(
            f"{kind} {name!r} is provided by both {first.distribution} {first.version} and {second.distribution} "
            f"{second.version}; uninstall one, or select plug-ins with SKILLFRAME_PLUGINS"
        )


class Registry:
    """Records by kind and name, and the plug-ins they came from.

    Attributes:
        plugins: every plug-in that was found and selected, in the order of loading.
        unselected: names of installed plug-ins that `SKILLFRAME_PLUGINS` leaves out.
        not_installed: names that `SKILLFRAME_PLUGINS` asks for and that nothing installed has.
    """

    def __init__(self) -> None:
        self._manager = pluggy.PluginManager(hookspecs.GROUP)
        self._manager.add_hookspecs(hookspecs)
        self._records: dict[str, dict[str, tuple[Any, Plugin]]] = {kind: {} for kind in KINDS}
        self._conflicts: dict[tuple[str, str], PluginConflict] = {}
        self.plugins: list[Plugin] = []
        self.unselected: list[str] = []
        self.not_installed: list[str] = []

    def add(self, plugin: Plugin, load: Callable[[], object]) -> Plugin:
        """Load one plug-in and collect its records; what fails is kept in `Plugin.error`.

        A hook that fails loses its own records. A name that another plug-in already has is an error of this one, and
        asking for it raises `PluginConflict`. What a plug-in prints while it loads goes to stderr.
        """
        self.plugins.append(plugin)
        try:
            with redirect_stdout(sys.stderr):
                module = load()
            self._manager.register(module, name=f"{plugin.name} [{plugin.distribution}]")
            problems = list(_hook_problems(module))
        except (Exception, SystemExit) as error:  # one plug-in must not take the rest down
            plugin.fail(error)
            return plugin
        for problem in problems:
            plugin.fail(problem)
        for kind in KINDS:
            self._collect(kind, module, plugin)
        return plugin

    def _collect(self, kind: str, module: object, plugin: Plugin) -> None:
        caller = getattr(self._manager.hook, KINDS[kind])
        for implementation in caller.get_hookimpls():
            if implementation.plugin is not module:
                continue
            try:
                with redirect_stdout(sys.stderr):
                    records = _checked(kind, implementation.function())
            except (Exception, SystemExit) as error:  # see `add`
                plugin.fail(error)
                continue
            for record in records:
                self._keep(kind, record, plugin)

    def _keep(self, kind: str, record: Any, plugin: Plugin) -> None:
        _, first = self._records[kind].setdefault(record.name, (record, plugin))
        plugin.provides.append(f"{kind}:{record.name}")
        if first is not plugin:
            conflict = PluginConflict(kind, record.name, first, plugin)
            self._conflicts[kind, record.name] = conflict
            plugin.fail(conflict)

    def names(self, kind: str) -> list[str]:
        """Sorted names of a kind ("skill", "segmenter", "coordinator", "world", "reader", "row")."""
        return sorted(name for name in self._records[kind] if (kind, name) not in self._conflicts)

    def records(self, kind: str) -> Iterator[Any]:
        """The records of a kind, by name."""
        return (self._records[kind][name][0] for name in self.names(kind))

    def provider(self, kind: str, name: str) -> Plugin:
        """The plug-in that provides a name; raises as `skill` does."""
        self._get(kind, name)
        return self._records[kind][name][1]

    def _get(self, kind: str, name: str) -> Any:
        if (kind, name) in self._conflicts:
            raise self._conflicts[kind, name]
        if name not in self._records[kind]:
            raise UnknownName(kind, name, self.names(kind), self._absences(kind, name))
        return self._records[kind][name][0]

    def _absences(self, kind: str, name: str) -> str:
        """Why a plug-in that a person has in mind may not be here."""
        here = [*(plugin.name for plugin in self.plugins), *self.unselected]
        failed = [f"{p.distribution} {p.version} ({p.error})" for p in self.plugins if p.error]
        notes = [f"these plug-ins failed to load: {', '.join(failed)}"] if failed else []
        if self.unselected:
            notes.append(f"SKILLFRAME_PLUGINS leaves out {', '.join(self.unselected)}")
        if self.not_installed:
            notes.append(f"SKILLFRAME_PLUGINS asks for {', '.join(self.not_installed)}, which is not installed")
        missing = where_to_get(kind, name, self._records[kind], here)
        return "; ".join([missing, *notes] if missing else notes)

    def skill(self, name: str) -> SkillType:
        """The skill type of that name; raises `UnknownName`, or `PluginConflict` if two plug-ins have it."""
        record: SkillType = self._get("skill", name)
        return record

    def segmenter(self, name: str) -> SegmenterType:
        """The segmenter of that name; raises as `skill` does."""
        record: SegmenterType = self._get("segmenter", name)
        return record

    def coordinator(self, name: str) -> CoordinatorType:
        """The coordinator of that name; raises as `skill` does."""
        record: CoordinatorType = self._get("coordinator", name)
        return record

    def behaviour(self, name: str) -> SkillType:
        """The coordinator or else the skill type of that name: whatever a skill file can hold; raises as `skill`."""
        return self.coordinator(name) if name in self._records["coordinator"] else self.skill(name)

    def world(self, name: str) -> WorldType:
        """The world of that name; raises as `skill` does."""
        record: WorldType = self._get("world", name)
        return record

    def reader(self, name: str) -> ReaderType:
        """The file format of that name; raises as `skill` does."""
        record: ReaderType = self._get("reader", name)
        return record

    def row(self, name: str) -> RowType:
        """The published result of that number; raises as `skill` does."""
        record: RowType = self._get("row", name)
        return record


def _hook_problems(module: object) -> Iterator[BadPlugin]:
    """Hooks that would silently never be called: misspelt names, and hooks without the marker."""
    for name in dir(module):
        function = getattr(module, name, None)
        marker = getattr(function, f"{hookspecs.GROUP}_impl", None)
        marked = isinstance(marker, dict)
        optional = isinstance(marker, dict) and marker["optionalhook"]  # a hook of a newer core, declared as such
        if name not in KINDS.values() and callable(function) and (marked or name.startswith("skillframe_")):
            if not optional:
                yield BadPlugin(str(UnknownName("hook", name, KINDS.values())))
        elif name in KINDS.values() and not marked:
            yield BadPlugin(
                f"{name} lacks @hookimpl and would never be called; add it (from skillframe import hookimpl)"
            )


def _checked(kind: str, answer: object) -> list[Any]:
    """The records that a hook gave, or `BadPlugin` that says what is wrong with them."""
    hook, expected = KINDS[kind], RECORDS[kind]
    if not hasattr(answer, "__iter__"):
        raise BadPlugin(f"{hook} gave {answer!r} instead of yielding {expected.__name__} records")
    records: list[Any] = list(answer)
    for record in records:
        if not isinstance(record, expected):
            raise BadPlugin(f"{hook} yielded {record!r}, not a {expected.__name__}")
        if not (isinstance(record.name, str) and record.name):
            raise BadPlugin(f"{hook} yielded a {expected.__name__} with the name {record.name!r}; give it a word")
    names = [record.name for record in records]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise BadPlugin(f"{hook} yielded the name {', '.join(twice)} more than once")
    return records


def _installed() -> list[tuple[Plugin, Callable[[], object]]]:
    """Installed plug-ins with what loads them, by name; a damaged distribution is kept with what it raises.

    Only distributions whose entry points mention the group are parsed, so that an unrelated damaged one does no harm.
    """
    found: dict[tuple[str, str], tuple[Plugin, Callable[[], object]]] = {}
    seen: set[str] = set()
    for distribution in distributions():
        text = distribution.read_text("entry_points.txt") or ""
        if not re.search(rf"^\[{hookspecs.GROUP}\]", text, re.MULTILINE):
            continue
        name, version = _identity(distribution)
        if name.lower() in seen:  # the first on the path is the one that imports
            continue
        seen.add(name.lower())
        for entry, load in _entries(distribution, name):
            found[entry, name] = (Plugin(name=entry, distribution=name, version=version), load)
    return [found[key] for key in sorted(found)]


def _identity(distribution: Distribution) -> tuple[str, str]:
    """Name and version; from the folder's name where the metadata is damaged."""
    try:
        name, version = distribution.metadata["Name"], distribution.metadata["Version"]
    except Exception:  # metadata is foreign text; whatever it raises, the folder's name remains
        name, version = None, None
    folder = getattr(getattr(distribution, "_path", None), "stem", "unknown")
    stem, _, rest = folder.partition("-")
    return str(name or stem), str(version or rest or "?")


def _entries(distribution: Distribution, name: str) -> list[tuple[str, Callable[[], object]]]:
    try:
        points = [point for point in distribution.entry_points if point.group == hookspecs.GROUP]
    except Exception as error:  # a damaged entry_points.txt
        return [(name, _raiser(BadPlugin(f"entry_points.txt of {name} cannot be read ({error}); install it again")))]
    return [(point.name, _loader(point)) for point in points]


def _loader(point: EntryPoint) -> Callable[[], object]:
    return lambda: point.load()


def _raiser(error: Exception) -> Callable[[], object]:
    def load() -> object:
        raise error

    return load


def load_registry() -> Registry:
    """A fresh registry: what ships with the core, then every selected plug-in that is installed."""
    from skillframe import __version__
    from skillframe.extend import builtin

    registry = Registry()
    registry.add(Plugin(name="core", distribution="skillframe", version=__version__), lambda: builtin)
    setting = os.environ.get("SKILLFRAME_PLUGINS")
    wanted = None if setting is None else {name.strip() for name in setting.split(",") if name.strip()}
    installed = _installed()
    for plugin, load in installed:
        if wanted is None or plugin.name in wanted:
            registry.add(plugin, load)
        else:
            registry.unselected.append(plugin.name)
    registry.not_installed = sorted((wanted or set()) - {plugin.name for plugin, _ in installed})
    return registry


@lru_cache(maxsize=1)
def registry() -> Registry:
    """The process's registry, loaded on first use; worker processes load their own."""
    return load_registry()

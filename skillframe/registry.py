"""What exists: discovers plug-ins, isolates the ones that fail, and answers to names.

pluggy is used for discovery only. Each entry point is loaded on its own, and each hook implementation is called on its
own, so that a plug-in that fails to import or raises loses its own records and nothing else; it is named in
`Registry.plugins` with its distribution, version and error. The environment variable `SKILLFRAME_PLUGINS` (comma list
of entry-point names, empty for none) selects a subset; `SKILLFRAME_STRICT_PLUGINS=1` raises instead of isolating.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from importlib.metadata import EntryPoint, entry_points
from typing import Any, TypeVar

import pluggy

from skillframe import hookspecs
from skillframe.errors import SkillframeError, UnknownName
from skillframe.records import CoordinatorType, ReaderType, SegmenterType, SkillType, WorldType

Record = TypeVar("Record", SkillType, SegmenterType, CoordinatorType, WorldType, ReaderType)
KINDS: Mapping[str, str] = {
    "skill": "skillframe_skills",
    "segmenter": "skillframe_segmenters",
    "coordinator": "skillframe_coordinators",
    "world": "skillframe_worlds",
    "reader": "skillframe_readers",
}


@dataclass(slots=True, kw_only=True)
class Plugin:
    """One plug-in as found: where it comes from, what it provides, and its error if it has one."""

    name: str
    distribution: str
    version: str
    provides: list[str] = field(default_factory=list)
    error: str | None = None


class PluginConflict(SkillframeError):
    """Two plug-ins provide one name; both are named."""

    def __init__(self, kind: str, name: str, first: Plugin, second: Plugin) -> None:
        super().__init__(
            f"{kind} {name!r} is provided by both {first.distribution} {first.version} and {second.distribution} "
            f"{second.version}; uninstall one, or select plug-ins with SKILLFRAME_PLUGINS"
        )


class Registry:
    """Records by kind and name, and the plug-ins they came from."""

    def __init__(self) -> None:
        self._manager = pluggy.PluginManager(hookspecs.GROUP)
        self._manager.add_hookspecs(hookspecs)
        self._records: dict[str, dict[str, tuple[Any, Plugin]]] = {kind: {} for kind in KINDS}
        self.plugins: list[Plugin] = []

    def add(self, plugin: Plugin, load: Callable[[], object]) -> Plugin:
        """Load one plug-in and collect its records; its failure is kept in `Plugin.error`.

        Raises:
            PluginConflict: it provides a name that another plug-in already has.
        """
        self.plugins.append(plugin)
        try:
            module = load()
            self._manager.register(module, name=f"{plugin.name} [{plugin.distribution}]")
            self._refuse_unknown_hooks(module)
        except Exception as error:  # one plug-in must not take the rest down
            _isolate(plugin, error)
            return plugin
        for kind in KINDS:
            self._collect(kind, module, plugin)
        return plugin

    def _refuse_unknown_hooks(self, module: object) -> None:
        names = [n for n in dir(module) if n.startswith("skillframe_") and callable(getattr(module, n))]
        for name in names:
            if name not in KINDS.values():
                raise UnknownName("hook", name, KINDS.values())

    def _collect(self, kind: str, module: object, plugin: Plugin) -> None:
        caller = getattr(self._manager.hook, KINDS[kind])
        for implementation in caller.get_hookimpls():
            if implementation.plugin is not module:
                continue
            try:
                records = list(implementation.function())
                names = [record.name for record in records]
            except Exception as error:  # see `add`
                _isolate(plugin, error)
                continue
            for name, record in zip(names, records, strict=True):
                if name in self._records[kind]:
                    raise PluginConflict(kind, name, self._records[kind][name][1], plugin)
                self._records[kind][name] = (record, plugin)
                plugin.provides.append(f"{kind}:{name}")

    def names(self, kind: str) -> list[str]:
        """Sorted names of a kind ("skill", "segmenter", "coordinator", "world", "reader")."""
        return sorted(self._records[kind])

    def records(self, kind: str) -> Iterator[Any]:
        """The records of a kind, by name."""
        return (self._records[kind][name][0] for name in self.names(kind))

    def provider(self, kind: str, name: str) -> Plugin:
        """The plug-in that provides a name."""
        self._get(kind, name)
        return self._records[kind][name][1]

    def _get(self, kind: str, name: str) -> Any:
        if name not in self._records[kind]:
            failed = [f"{p.distribution} {p.version} ({p.error})" for p in self.plugins if p.error]
            note = f"these plug-ins failed to load: {', '.join(failed)}" if failed else ""
            raise UnknownName(kind, name, self._records[kind], note)
        return self._records[kind][name][0]

    def skill(self, name: str) -> SkillType:
        """The skill type of that name; raises `UnknownName`."""
        record: SkillType = self._get("skill", name)
        return record

    def segmenter(self, name: str) -> SegmenterType:
        """The segmenter of that name; raises `UnknownName`."""
        record: SegmenterType = self._get("segmenter", name)
        return record

    def coordinator(self, name: str) -> CoordinatorType:
        """The coordinator of that name; raises `UnknownName`."""
        record: CoordinatorType = self._get("coordinator", name)
        return record

    def world(self, name: str) -> WorldType:
        """The world of that name; raises `UnknownName`."""
        record: WorldType = self._get("world", name)
        return record

    def reader(self, name: str) -> ReaderType:
        """The file format of that name; raises `UnknownName`."""
        record: ReaderType = self._get("reader", name)
        return record


def _isolate(plugin: Plugin, error: Exception) -> None:
    if os.environ.get("SKILLFRAME_STRICT_PLUGINS") == "1":
        raise error
    plugin.error = f"{type(error).__name__}: {error}"


def _selected(points: list[EntryPoint]) -> list[EntryPoint]:
    wanted = os.environ.get("SKILLFRAME_PLUGINS")
    if wanted is None:
        return points
    names = {name.strip() for name in wanted.split(",") if name.strip()}
    return [point for point in points if point.name in names]


def load_registry() -> Registry:
    """A fresh registry: what ships with the core, then every selected plug-in that is installed."""
    from skillframe import __version__, builtin

    registry = Registry()
    registry.add(Plugin(name="core", distribution="skillframe", version=__version__), lambda: builtin)
    points = sorted(entry_points(group=hookspecs.GROUP), key=lambda point: point.name)
    for point in _selected(list(points)):
        name = point.dist.name if point.dist else "unknown"
        version = point.dist.version if point.dist else "?"
        registry.add(Plugin(name=point.name, distribution=name, version=version), point.load)
    return registry


@lru_cache(maxsize=1)
def registry() -> Registry:
    """The process's registry, loaded on first use; worker processes load their own."""
    return load_registry()

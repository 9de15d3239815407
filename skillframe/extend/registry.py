"""What exists: discovers plug-ins, isolates the ones that fail, and answers to names.

pluggy is used for discovery only. Each entry point is loaded on its own, and each hook implementation is called on its
own, so that a plug-in that fails to import or raises loses its own records and nothing else; it is named in
`Registry.plugins` with its distribution, version and error. The environment variable `SKILLFRAME_PLUGINS` (comma list
of entry-point names, empty for none) selects a subset; `SKILLFRAME_STRICT_PLUGINS=1` raises instead of isolating.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import redirect_stdout
from functools import lru_cache
from typing import Any

import pluggy

from skillframe.errors import UnknownName
from skillframe.extend import hookspecs
from skillframe.extend.contract import ATTRIBUTE, GROUP, contract_problem, requirement_problem
from skillframe.extend.discovery import installed
from skillframe.extend.homes import where_to_get
from skillframe.extend.part_worlds import FILE_ENDING, refuse_part, world_of_file
from skillframe.extend.plugin import KINDS as KINDS
from skillframe.extend.plugin import RECORDS as RECORDS
from skillframe.extend.plugin import BadPlugin as BadPlugin
from skillframe.extend.plugin import OtherContract as OtherContract
from skillframe.extend.plugin import Plugin as Plugin
from skillframe.extend.plugin import PluginConflict as PluginConflict
from skillframe.extend.plugin import checked, hook_problems
from skillframe.extend.records import (
    CoordinatorType,
    DriveType,
    ExporterType,
    ReaderType,
    RobotType,
    RowType,
    ScoreType,
    SectionType,
    SegmenterType,
    SkillType,
    WorldType,
)  # fmt: skip


class Registry:
    """Records by kind and name, and the plug-ins they came from.

    Attributes:
        plugins: every plug-in that was found and selected, in the order of loading.
        unselected: names of installed plug-ins that `SKILLFRAME_PLUGINS` leaves out.
        not_installed: names that `SKILLFRAME_PLUGINS` asks for and that nothing installed has.
    """

    def __init__(self) -> None:
        self._manager = pluggy.PluginManager(GROUP)
        self._manager.add_hookspecs(hookspecs)
        self._records: dict[str, dict[str, tuple[Any, Plugin]]] = {kind: {} for kind in KINDS}
        self._conflicts: dict[tuple[str, str], PluginConflict] = {}
        self.plugins: list[Plugin] = []
        self.unselected: list[str] = []
        self.not_installed: list[str] = []

    def add(self, plugin: Plugin, load: Callable[[], object]) -> Plugin:
        """Load one plug-in and collect its records. What fails is kept in `Plugin.error`.

        A hook that fails loses its own records. A name that another plug-in already has is an error of this one, and
        asking for it raises `PluginConflict`. A plug-in that was written for another contract, or asks for another
        skillframe, is not loaded. What a plug-in prints while it loads goes to stderr.
        """
        from skillframe import __version__

        self.plugins.append(plugin)
        try:
            _refuse(requirement_problem(plugin.requires, __version__))
            with redirect_stdout(sys.stderr):
                module = load()
            _refuse(contract_problem("the plug-in", getattr(module, ATTRIBUTE, "")))
            self._manager.register(module, name=f"{plugin.name} [{plugin.distribution}]")
            problems = list(hook_problems(module))
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
                    records = checked(kind, implementation.function())
            except (Exception, SystemExit) as error:  # see `add`
                plugin.fail(error)
                continue
            for record in records:
                if problem := contract_problem(f"{kind} {record.name!r}", record.contract):
                    plugin.fail(OtherContract(problem))
                else:
                    self._keep(kind, record, plugin)

    def _keep(self, kind: str, record: Any, plugin: Plugin) -> None:
        _, first = self._records[kind].setdefault(record.name, (record, plugin))
        plugin.provides.append(f"{kind}:{record.name}")
        if first is not plugin:
            conflict = PluginConflict(kind, record.name, first, plugin)
            self._conflicts[kind, record.name] = conflict
            plugin.fail(conflict)

    def names(self, kind: str) -> list[str]:
        """Sorted names of a kind, a key of `KINDS`: "skill", "world", "exporter" ..."""
        return sorted(name for name in self._records[kind] if (kind, name) not in self._conflicts)

    def records(self, kind: str) -> Iterator[Any]:
        """The records of a kind, by name."""
        return (self._records[kind][name][0] for name in self.names(kind))

    def provider(self, kind: str, name: str) -> Plugin:
        """The plug-in that provides a name. Raises as `skill` does."""
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
        """The skill type of that name. Raises `UnknownName`, or `PluginConflict` if two plug-ins have it."""
        record: SkillType = self._get("skill", name)
        return record

    def segmenter(self, name: str) -> SegmenterType:
        """The segmenter of that name. Raises as `skill` does."""
        record: SegmenterType = self._get("segmenter", name)
        return record

    def coordinator(self, name: str) -> CoordinatorType:
        """The coordinator of that name. Raises as `skill` does."""
        record: CoordinatorType = self._get("coordinator", name)
        return record

    def behaviour(self, name: str) -> SkillType:
        """The coordinator or else the skill type of that name: whatever a skill file can hold. Raises as `skill`."""
        return self.coordinator(name) if name in self._records["coordinator"] else self.skill(name)

    def world(self, name: str) -> WorldType:
        """The world of that name, or of that fixture file, "path/fixture.toml". Raises as `skill` does.

        A fixture file that cannot be used raises `InputError`.
        """
        if name.endswith(FILE_ENDING):
            return world_of_file(name)
        refuse_part(name)
        record: WorldType = self._get("world", name)
        return record

    def reader(self, name: str) -> ReaderType:
        """The file format of that name. Raises as `skill` does."""
        record: ReaderType = self._get("reader", name)
        return record

    def row(self, name: str) -> RowType:
        """The published result of that number. Raises as `skill` does."""
        record: RowType = self._get("row", name)
        return record

    def exporter(self, name: str) -> ExporterType:
        """The exporter of that name. Raises as `skill` does."""
        record: ExporterType = self._get("exporter", name)
        return record

    def score(self, name: str) -> ScoreType:
        """The score of that name. Raises as `skill` does."""
        record: ScoreType = self._get("score", name)
        return record

    def robot(self, name: str) -> RobotType:
        """The robot of that name that ships with skillframe or a plug-in. Raises as `skill` does."""
        record: RobotType = self._get("robot", name)
        return record

    def drive(self, name: str) -> DriveType:
        """The drive of that name. Raises as `skill` does."""
        record: DriveType = self._get("drive", name)
        return record

    def section(self, name: str) -> SectionType:
        """The section of reports of that name. Raises as `skill` does."""
        record: SectionType = self._get("section", name)
        return record


def _refuse(problem: str) -> None:
    if problem:
        raise OtherContract(problem)


def load_registry() -> Registry:
    """A fresh registry: what ships with the core, then every selected plug-in that is installed."""
    from skillframe import __version__
    from skillframe.extend import builtin

    registry = Registry()
    registry.add(Plugin(name="core", distribution="skillframe", version=__version__), lambda: builtin)
    setting = os.environ.get("SKILLFRAME_PLUGINS")
    wanted = None if setting is None else {name.strip() for name in setting.split(",") if name.strip()}
    found = installed()
    for plugin, load in found:
        if wanted is None or plugin.name in wanted:
            registry.add(plugin, load)
        else:
            registry.unselected.append(plugin.name)
    registry.not_installed = sorted((wanted or set()) - {plugin.name for plugin, _ in found})
    return registry


@lru_cache(maxsize=1)
def registry() -> Registry:
    """The process's registry, loaded on first use. Worker processes load their own."""
    return load_registry()

"""The registry: discovers plug-ins, isolates those that fail, and looks up names.

pluggy is used for discovery only. Each entry point and each hook implementation runs on its own, so that a plug-in that
fails loses only its own records; `Registry.plugins` has its distribution, version and error. The environment variable
`SKILLFRAME_PLUGINS` (comma list of entry-point names, empty for none) selects plug-ins; `SKILLFRAME_STRICT_PLUGINS=1`
raises errors instead of isolating them.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import redirect_stdout
from functools import lru_cache
from pathlib import Path
from typing import Any

import pluggy

from skillframe.errors import SkillframeError, UnknownName
from skillframe.extend import hookspecs
from skillframe.extend.contract import ATTRIBUTE, GROUP, contract_problem, requirement_problem
from skillframe.extend.hardware import DriveType, RobotType
from skillframe.extend.homes import homes, install_line, where_to_get
from skillframe.extend.isolated import isolated
from skillframe.extend.outputs import ExporterType, OutputType, RowType, ScoreType
from skillframe.extend.plugin import KINDS as KINDS
from skillframe.extend.plugin import RECORDS as RECORDS
from skillframe.extend.plugin import BadPlugin as BadPlugin
from skillframe.extend.plugin import OtherContract as OtherContract
from skillframe.extend.plugin import Plugin as Plugin
from skillframe.extend.plugin import PluginConflict as PluginConflict
from skillframe.extend.plugin import checked, hook_problems, installed
from skillframe.extend.records import (
    CoordinatorType,
    ReaderType,
    SegmenterType,
    SkillType,
    TeacherType,
    WorldFileType,
    WorldType,
)

WORLD_FILE = ".toml"
"""Ending of a file that describes a world."""


class Registry:
    """Records by kind and name, and their plug-ins.

    Attributes:
        plugins: all selected plug-ins, in the order of loading.
        unselected: names of installed plug-ins that `SKILLFRAME_PLUGINS` leaves out.
        not_installed: names in `SKILLFRAME_PLUGINS` that are not installed.
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
        """Load one plug-in and collect its records. Errors are stored in `Plugin.error`.

        A hook that fails loses its own records. A name that another plug-in already has is an error of this one, and
        looking it up raises `PluginConflict`. A plug-in that was written for another contract, or requires another
        skillframe, is not loaded. What a plug-in prints while it loads goes to stderr.
        """
        from skillframe import __version__

        self.plugins.append(plugin)
        try:
            _refuse(requirement_problem(plugin.requires, __version__))
            with redirect_stdout(sys.stderr), isolated(BadPlugin):
                module = load()
            _refuse(contract_problem("the plug-in", getattr(module, ATTRIBUTE, "")))
            self._manager.register(module, name=f"{plugin.name} [{plugin.distribution}]")
            problems = list(hook_problems(module))
        except Exception as error:  # a plug-in's error must not stop the others
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
                with redirect_stdout(sys.stderr), isolated(BadPlugin):
                    records = checked(kind, implementation.function())
            except Exception as error:  # see `add`
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
        """The plug-in that provides a name. Raises as `skill`."""
        self.record(kind, name)
        return self._records[kind][name][1]

    def record(self, kind: str, name: str) -> Any:
        """The record of a kind ("skill", "world" ...) and name.

        Raises:
            UnknownName: there is none.
            PluginConflict: two plug-ins have it.
        """
        if (kind, name) in self._conflicts:
            raise self._conflicts[kind, name]
        if name not in self._records[kind]:
            raise UnknownName(kind, name, self.names(kind), self._absences(kind, name))
        return self._records[kind][name][0]

    def absence(self, kind: str, name: str) -> str:
        """Which first-party plug-in provides an absent name, why it is absent, and the command that installs it.

        "" if it is present, or no first-party plug-in provides the name.
        """
        home = homes().get(f"{kind}:{name}")
        if home in self.unselected:
            return f"skillframe-{home} does, and SKILLFRAME_PLUGINS leaves it out"
        for plugin in self.plugins:
            if plugin.name == home:
                failed = f"{plugin.distribution} {plugin.version} does, and failed to load ({plugin.error})"
                return failed if plugin.error else ""
        return f"skillframe-{home} does, and is not installed; type: {install_line(home)}" if home else ""

    def failures(self) -> str:
        """Plug-ins with an error, and their errors, or ""."""
        failed = [f"{p.distribution} {p.version} ({p.error})" for p in self.plugins if p.error]
        return f"these plug-ins failed to load: {', '.join(failed)}" if failed else ""

    def _absences(self, kind: str, name: str) -> str:
        """Why the plug-in of a missing name may be absent."""
        here = [*(plugin.name for plugin in self.plugins), *self.unselected]
        notes = [failed] if (failed := self.failures()) else []
        if self.unselected:
            notes.append(f"SKILLFRAME_PLUGINS leaves out {', '.join(self.unselected)}")
        if self.not_installed:
            notes.append(f"SKILLFRAME_PLUGINS names {', '.join(self.not_installed)}, which is not installed")
        missing = where_to_get(kind, name, self._records[kind], here)
        return "; ".join([missing, *notes] if missing else notes)

    def skill(self, name: str) -> SkillType:
        """The skill type of that name. Raises `UnknownName`, or `PluginConflict` if two plug-ins have it."""
        record: SkillType = self.record("skill", name)
        return record

    def segmenter(self, name: str) -> SegmenterType:
        """The segmenter of that name. Raises as `skill`."""
        record: SegmenterType = self.record("segmenter", name)
        return record

    def coordinator(self, name: str) -> CoordinatorType:
        """The coordinator of that name. Raises as `skill`."""
        record: CoordinatorType = self.record("coordinator", name)
        return record

    def behaviour(self, name: str) -> SkillType:
        """The coordinator or skill type of that name, as a skill file may hold. Raises as `skill`."""
        return self.coordinator(name) if name in self._records["coordinator"] else self.skill(name)

    def world(self, name: str) -> WorldType:
        """The world of that name, or of that fixture file, "path/fixture.toml". Raises as `skill`.

        A fixture file that cannot be used raises `InputError`.
        """
        if name.endswith(WORLD_FILE):
            return self.world_file().world(Path(name))
        for kind in self.records("world_file"):
            if kind.refuse is not None:
                kind.refuse(name)
        record: WorldType = self.record("world", name)
        return record

    def world_file(self) -> WorldFileType:
        """The kind of file that describes a world. Raises `SkillframeError` if no plug-in reads one."""
        found: WorldFileType | None = next(self.records("world_file"), None)
        if found is None:
            raise SkillframeError(
                self._absences("world_file", "parts") or "no plug-in reads files that describe a world"
            )
        return found

    def teacher(self, name: str) -> TeacherType:
        """The simulated teacher of that name. Raises as `skill`."""
        record: TeacherType = self.record("teacher", name)
        return record

    def reader(self, name: str) -> ReaderType:
        """The file format of that name. Raises as `skill`."""
        record: ReaderType = self.record("reader", name)
        return record

    def row(self, name: str) -> RowType:
        """The published result of that number. Raises as `skill`."""
        record: RowType = self.record("row", name)
        return record

    def exporter(self, name: str) -> ExporterType:
        """The exporter of that name. Raises as `skill`."""
        record: ExporterType = self.record("exporter", name)
        return record

    def score(self, name: str) -> ScoreType:
        """The score of that name. Raises as `skill`."""
        record: ScoreType = self.record("score", name)
        return record

    def robot(self, name: str) -> RobotType:
        """The robot of that name of skillframe or a plug-in. Raises as `skill`."""
        record: RobotType = self.record("robot", name)
        return record

    def drive(self, name: str) -> DriveType:
        """The drive of that name. Raises as `skill`."""
        record: DriveType = self.record("drive", name)
        return record

    def output(self, name: str) -> OutputType:
        """The kind of file of that name. Raises as `skill`."""
        record: OutputType = self.record("output", name)
        return record


def _refuse(problem: str) -> None:
    if problem:
        raise OtherContract(problem)


def robot_folders(name: str | None = None) -> dict[str, Path]:
    """Folder by name of every registered robot, or of one.

    Raises:
        UnknownName: there is none of that name; `PluginConflict` if two plug-ins have it.
    """
    records = registry().records("robot") if name is None else [registry().robot(name)]
    return {record.name: Path(record.folder) for record in records}


def load_registry() -> Registry:
    """A new registry with the core and all selected plug-ins."""
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

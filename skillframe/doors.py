"""Import paths of version 0.1 that have moved: they open for one more minor version and name the new path.

An old path gives the very module of the new one, so that classes are the same whichever way they came. The list holds
what plug-ins, how-tos and the template of 0.1 imported. Version 0.3 drops it.
"""

from __future__ import annotations

import importlib
import sys
import warnings
from collections.abc import Sequence
from importlib.machinery import ModuleSpec
from types import ModuleType

MOVED = {
    "skillframe.actuation.actuator": "skillframe.fmu.actuator",
    "skillframe.actuation.opening": "skillframe.fmu.opening",
    "skillframe.arms": "skillframe.execution.arms",
    "skillframe.blind_teacher": "skillframe.teaching.blind",
    "skillframe.demonstrate": "skillframe.teaching.sessions",
    "skillframe.demonstrate_blind": "skillframe.teaching.blind_sessions",
    "skillframe.demonstration.files": "skillframe.extend.reading",
    "skillframe.documents": "skillframe.files.documents",
    "skillframe.executor": "skillframe.execution.executor",
    "skillframe.hookspecs": "skillframe.extend.hookspecs",
    "skillframe.prepare": "skillframe.execution.prepare",
    "skillframe.records": "skillframe.extend.records",
    "skillframe.registry": "skillframe.extend.registry",
    "skillframe.reproduce.bars": "skillframe_papers.bars",
    "skillframe.reproduce.drawing": "skillframe.reports.drawing",
    "skillframe.robot.feasibility": "skillframe.machine.checks.feasibility",
    "skillframe.robot.loops": "skillframe.robot.chain",
    "skillframe.skillfile": "skillframe.document.file",
    "skillframe.skillsource": "skillframe.document.source",
    "skillframe.teacher": "skillframe.teaching.teacher",
    "skillframe.trace": "skillframe.execution.trace",
}
FOLDERS = frozenset({"skillframe.actuation", "skillframe.reproduce"})
"""Packages that are no more and still hold doors."""


class Doors:
    """Finds and loads modules under the names of 0.1. The base classes of importlib take long to import."""

    def find_spec(self, name: str, path: Sequence[str] | None, target: ModuleType | None = None) -> ModuleSpec | None:
        """The door of a name, or None."""
        if name in FOLDERS:
            return ModuleSpec(name, self, is_package=True)  # type: ignore[arg-type]  # a loader by its verbs
        if name not in MOVED:
            return None
        warnings.warn(f"{name} is {MOVED[name]} now; the old path goes with 0.3", DeprecationWarning, stacklevel=2)
        return ModuleSpec(name, self)  # type: ignore[arg-type]

    def create_module(self, spec: ModuleSpec) -> None:
        """None: an ordinary module, until the one of the new path takes its place."""

    def exec_module(self, module: ModuleType) -> None:
        """Put the module of the new path in the place of the old one."""
        if module.__name__ in MOVED:
            sys.modules[module.__name__] = importlib.import_module(MOVED[module.__name__])


def install() -> None:
    """Open the doors, once per process."""
    if not any(isinstance(finder, Doors) for finder in sys.meta_path):
        sys.meta_path.append(Doors())

"""The conformance checks of everything that a plug-in provides."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from skillframe.conformance.drives import check_drive
from skillframe.conformance.exporters import check_exporter
from skillframe.conformance.problems import attempt
from skillframe.conformance.readers import check_reader
from skillframe.conformance.robots import check_robot
from skillframe.conformance.scores import check_score
from skillframe.conformance.sections import check_section
from skillframe.conformance.segmenters import check_segmenter
from skillframe.conformance.skills import check_skill, skill_warnings
from skillframe.conformance.watch import printed, watched
from skillframe.conformance.worlds import check_world
from skillframe.extend.registry import Plugin, Registry

CHECKS: Mapping[str, Callable[[Any], list[str]]] = {
    "skill": check_skill,
    "coordinator": check_skill,
    "segmenter": check_segmenter,
    "world": check_world,
    "reader": check_reader,
    "exporter": check_exporter,
    "score": check_score,
    "robot": check_robot,
    "drive": check_drive,
    "section": check_section,
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """What checking one thing of a plug-in gave.

    Attributes:
        subject: "skill:replay"; "plug-in" for its loading.
        problems: in words; empty if it conforms, None if there is no check for its kind.
        warnings: what is allowed and may surprise, in words.
    """

    subject: str
    problems: list[str] | None
    warnings: list[str] = field(default_factory=list)


def check_plugin(registry: Registry, plugin: Plugin) -> list[Finding]:
    """Findings for a plug-in's loading and for each record that it provides."""
    findings = [Finding(subject="plug-in", problems=[plugin.error] if plugin.error else [])]
    for subject in plugin.provides:
        kind, _, name = subject.partition(":")
        if name in registry.names(kind):
            problems = _check(registry, kind, name)
            warnings = [] if problems else _warnings(registry, kind, name)
            findings.append(Finding(subject=subject, problems=problems, warnings=warnings))
    return findings


def _warnings(registry: Registry, kind: str, name: str) -> list[str]:
    return skill_warnings(getattr(registry, kind)(name)) if kind in ("skill", "coordinator") else []


def _check(registry: Registry, kind: str, name: str) -> list[str] | None:
    check = CHECKS.get(kind)
    if check is None:
        return None
    record: Any = getattr(registry, kind)(name)
    general = [] if record.summary else ["has no summary; write one line for listings"]
    with watched() as seen:  # what is printed stays out of what the command prints
        problems = attempt("checks", lambda: check(record))
    return general + [p.removeprefix("checks: ") for p in problems] + list(printed(seen))

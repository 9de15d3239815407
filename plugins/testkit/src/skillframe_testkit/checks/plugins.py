"""Checks of all records of a plug-in."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from skillframe.extend import Plugin, Registry
from skillframe_testkit.checks.drives import check_drive
from skillframe_testkit.checks.exporters import check_exporter
from skillframe_testkit.checks.problems import attempt
from skillframe_testkit.checks.readers import check_reader
from skillframe_testkit.checks.robots import check_robot
from skillframe_testkit.checks.scores import check_score
from skillframe_testkit.checks.sections import check_section
from skillframe_testkit.checks.segmenters import check_segmenter
from skillframe_testkit.checks.skills import check_skill, skill_warnings
from skillframe_testkit.checks.watch import printed, watched
from skillframe_testkit.checks.worlds import check_world

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
    """Result of checking one record of a plug-in.

    Attributes:
        subject: such as "skill:replay"; "plug-in" for its loading.
        problems: sentences; None without a check for the kind.
        warnings: sentences on allowed but surprising behaviour.
    """

    subject: str
    problems: list[str] | None
    warnings: list[str] = field(default_factory=list)


def check_plugin(registry: Registry, plugin: Plugin) -> list[Finding]:
    """Findings for a plug-in's loading and for each of its records."""
    findings = [Finding(subject="plug-in", problems=[plugin.error] if plugin.error else [])]
    for subject in plugin.provides:
        kind, _, name = subject.partition(":")
        if name not in registry.names(kind):
            continue
        check, record, problems = CHECKS.get(kind), registry.record(kind, name), None
        if check is not None:
            problems = [] if record.summary else ["has no summary; write one line for listings"]
            with watched() as seen:  # keeps prints out of the command's output
                found = attempt("checks", partial(check, record))
            problems += [p.removeprefix("checks: ") for p in found] + list(printed(seen))
        warnings = skill_warnings(record) if not problems and kind in ("skill", "coordinator") else []
        findings.append(Finding(subject=subject, problems=problems, warnings=warnings))
    return findings

"""Conformance checks of plug-ins: functions that return problems as sentences.

`skillframe plugins check` runs them on installed plug-ins; `skillframe_testkit.suites` wraps them as pytest classes.
"""

from skillframe_testkit.checks.drives import check_drive
from skillframe_testkit.checks.exporters import check_exporter
from skillframe_testkit.checks.plugins import Finding, check_plugin
from skillframe_testkit.checks.readers import check_reader
from skillframe_testkit.checks.robots import check_robot
from skillframe_testkit.checks.scores import check_score
from skillframe_testkit.checks.sections import check_section
from skillframe_testkit.checks.segmenters import check_segmenter
from skillframe_testkit.checks.skills import check_skill, skill_warnings
from skillframe_testkit.checks.worlds import check_world

__all__ = [
    "Finding", "check_drive", "check_exporter", "check_plugin", "check_reader", "check_robot", "check_score",
    "check_section", "check_segmenter", "check_skill", "check_world", "skill_warnings",
]  # fmt: skip

"""Checks that any plug-in must pass: functions that return problems in words, an empty list when all is well.

`skillframe plugins check` runs them on what is installed; `skillframe.testing` wraps them as pytest classes.
"""

from skillframe.conformance.drives import check_drive
from skillframe.conformance.exporters import check_exporter
from skillframe.conformance.plugins import Finding, check_plugin
from skillframe.conformance.readers import check_reader
from skillframe.conformance.robots import check_robot
from skillframe.conformance.scores import check_score
from skillframe.conformance.sections import check_section
from skillframe.conformance.segmenters import check_segmenter
from skillframe.conformance.skills import check_skill, skill_warnings
from skillframe.conformance.worlds import check_world

__all__ = [
    "Finding", "check_drive", "check_exporter", "check_plugin", "check_reader", "check_robot", "check_score",
    "check_section", "check_segmenter", "check_skill", "check_world", "skill_warnings",
]  # fmt: skip

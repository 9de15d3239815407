"""The hooks that a plug-in can implement. Each yields records and runs once per process, never in the loop.

A plug-in is a distribution with an entry point in the group `skillframe` that names a module::

    from skillframe import hookimpl
    from skillframe.extend.records import SkillType

    skillframe_contract = "0.2"

    @hookimpl
    def skillframe_skills():
        yield SkillType(name="my_skill", summary="...", build=build)
"""

from __future__ import annotations

from collections.abc import Iterable

import pluggy

from skillframe.extend.contract import GROUP
from skillframe.extend.hardware import DriveType, LinkType, RobotType
from skillframe.extend.outputs import (
    ExporterType,
    FolderType,
    OutputType,
    RequirementType,
    RowType,
    ScoreType,
    SectionType,
)
from skillframe.extend.records import (
    AuditType,
    CoordinatorType,
    ReaderType,
    SegmenterType,
    SkillType,
    TeacherType,
    WorldFileType,
    WorldType,
)

hookspec = pluggy.HookspecMarker(GROUP)
hookimpl = pluggy.HookimplMarker(GROUP)
"""Decorator of a plug-in's functions that implement the hooks below."""


@hookspec
def skillframe_skills() -> Iterable[SkillType]:  # type: ignore[empty-body]
    """Kinds of skill: how they are learned, built, described and explained."""


@hookspec
def skillframe_segmenters() -> Iterable[SegmenterType]:  # type: ignore[empty-body]
    """Methods that cut demonstrations into phases."""


@hookspec
def skillframe_coordinators() -> Iterable[CoordinatorType]:  # type: ignore[empty-body]
    """Skills for several arms."""


@hookspec
def skillframe_worlds() -> Iterable[WorldType]:  # type: ignore[empty-body]
    """Worlds to run in."""


@hookspec
def skillframe_world_files() -> Iterable[WorldFileType]:  # type: ignore[empty-body]
    """Kinds of file that describe a world."""


@hookspec
def skillframe_teachers() -> Iterable[TeacherType]:  # type: ignore[empty-body]
    """Simulated teachers, who demonstrate the task of a world."""


@hookspec
def skillframe_readers() -> Iterable[ReaderType]:  # type: ignore[empty-body]
    """Demonstration file formats."""


@hookspec
def skillframe_audits() -> Iterable[AuditType]:  # type: ignore[empty-body]
    """Checks of demonstrations for suspicious data."""


@hookspec
def skillframe_rows() -> Iterable[RowType]:  # type: ignore[empty-body]
    """Published results and their computation: rows of `skillframe reproduce`, a command of skillframe-papers."""


@hookspec
def skillframe_exporters() -> Iterable[ExporterType]:  # type: ignore[empty-body]
    """Settings formats of other controllers: what `skillframe export --to` writes."""


@hookspec
def skillframe_scores() -> Iterable[ScoreType]:  # type: ignore[empty-body]
    """Figures of a run, computed from its trace: for `skillframe run --score` and `scores` of campaign.toml."""


@hookspec
def skillframe_robots() -> Iterable[RobotType]:  # type: ignore[empty-body]
    """Robots: folders with a robot.toml."""


@hookspec
def skillframe_drives() -> Iterable[DriveType]:  # type: ignore[empty-body]
    """Drives between a skill's command and the plant."""


@hookspec
def skillframe_links() -> Iterable[LinkType]:  # type: ignore[empty-body]
    """Links to real robots, for `skillframe drive` of skillframe-drive."""


@hookspec
def skillframe_sections() -> Iterable[SectionType]:  # type: ignore[empty-body]
    """Sections of reports, made from a campaign's or a run's files alone."""


@hookspec
def skillframe_folders() -> Iterable[FolderType]:  # type: ignore[empty-body]
    """Kinds of results folder whose report has a first page of its own."""


@hookspec
def skillframe_outputs() -> Iterable[OutputType]:  # type: ignore[empty-body]
    """Kinds of file written of runs, skills, scenes and results, including options of `skillframe run`."""


@hookspec
def skillframe_requirements() -> Iterable[RequirementType]:  # type: ignore[empty-body]
    """What a plug-in needs outside Python: lines of `skillframe doctor`."""

"""Self-contained HTML reports, replays, videos and pictures from files.

`page.write_report(inputs, out)` is the entry. `sources` reads; this module lists the sections of a page, which `page`
draws; `markup`, `svg`, `plots`, `shapes`, `raster` and `replay` draw.

This module registers them and is all that is imported when plug-ins are listed.
"""

from __future__ import annotations

from collections.abc import Iterable

from skillframe import hookimpl
from skillframe.extend import Lazy, LazyCommand, OutputType, RequirementType, SectionType

skillframe_contract = "0.2"

report = LazyCommand("Make a self-contained HTML report from results.", "skillframe_reports.command:command")
HERE = "skillframe_reports"


@hookimpl
def skillframe_sections() -> Iterable[SectionType]:
    """The sections of a report. Those of other plug-ins stand before the last one."""
    place = f"{HERE}.page"
    yield SectionType(
        name="verdict", title="What the verdict rests on", order=10, draw=Lazy(f"{place}:verdict"),
        summary="how trials ended, margins to limits, what was varied and what was not",
    )  # fmt: skip
    yield SectionType(
        name="learned", title="What was learned", order=20, draw=Lazy(f"{place}:learned"),
        summary="the skills in words, pictures and numbers",
    )  # fmt: skip
    yield SectionType(
        name="demonstrations", title="The demonstrations", order=30, draw=Lazy(f"{place}:demonstrations"),
        summary="force and motion of each demonstration over time",
    )  # fmt: skip
    yield SectionType(
        name="run", title="The run", order=40, draw=Lazy(f"{place}:run"),
        summary="3-D replay, pictures and plots of each run",
    )  # fmt: skip
    yield SectionType(
        name="works", title="Where it works", order=45, draw=Lazy(f"{place}:works"),
        summary="success over the varied quantities, comparisons, failures",
    )  # fmt: skip
    yield SectionType(
        name="made", title="How this was made", order=90, draw=Lazy(f"{place}:made"),
        summary="commands, versions and hashes that repeat the results",
    )  # fmt: skip


@hookimpl
def skillframe_outputs() -> Iterable[OutputType]:
    """Pages, videos and pictures of runs, skills, segmentations, scenes and results."""
    place = f"{HERE}.outputs"
    yield OutputType(
        name="replay", of="run", summary="Page with a 3-D replay and plots of the run (.html)",
        endings=(".html", ".htm"), write=Lazy(f"{place}:replay"),
    )  # fmt: skip
    yield OutputType(
        name="video", of="run", summary="Video of the run (.mp4)", check=Lazy(f"{HERE}.video:check_film"),
        write=Lazy(f"{place}:video"),
    )  # fmt: skip
    yield OutputType(
        name="still", of="moment", summary="Picture of a run at a time (.png)", endings=(".png",),
        write=Lazy(f"{place}:still_file"),
    )  # fmt: skip
    yield OutputType(
        name="report", of="results", summary="Report of campaigns and runs (.html)", endings=(".html", ".htm"),
        write=Lazy(f"{place}:report"),
    )  # fmt: skip
    yield OutputType(
        name="explanation", of="skill", summary="Page of a skill in words and pictures (.html)",
        endings=(".html", ".htm"), write=Lazy(f"{place}:explanation"),
    )  # fmt: skip
    yield OutputType(
        name="boundaries", of="segmentation", summary="Page on which boundaries of phases are moved (.html)",
        endings=(".html", ".htm"), write=Lazy(f"{place}:boundaries"),
    )  # fmt: skip
    yield OutputType(
        name="scene", of="scene", summary="Picture of a scene at the start of a run, cut open (.png)",
        endings=(".png",), write=Lazy(f"{place}:scene_file"),
    )  # fmt: skip


@hookimpl
def skillframe_requirements() -> Iterable[RequirementType]:
    """OpenGL, with which MuJoCo draws the frames of a video."""
    yield RequirementType(
        name="OpenGL", summary="run --video with MuJoCo's renderer", find=Lazy(f"{HERE}.opengl:found"),
        fix=Lazy(f"{HERE}.opengl:fix"),
    )  # fmt: skip

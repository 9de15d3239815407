"""Checks of a report's section: reproducible plain parts from its files."""

from __future__ import annotations

import re
import shutil
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from xml.etree import ElementTree

from skillframe.extend import Grid, Illustration, ReportFiles, SectionType, part_problem
from skillframe_testkit.checks.material import example_campaign
from skillframe_testkit.checks.problems import attempt
from skillframe_testkit.checks.watch import left_behind, read_elsewhere, watched

TAGS = (
    "a|b|i|u|p|em|strong|div|span|br|hr|h[1-6]|table|tr|td|th|ul|ol|li|img|script|style|svg|iframe|code|pre|sub|sup|"
    "small|font|html|body|button|input|form|link|meta|section"
)
MARKUP = re.compile(rf"</?(?:{TAGS})(?:\s*/?>|\s+[\w-]+\s*=)|&(?:[a-z]+|#\d+);", re.IGNORECASE)
"""HTML tags and entities in plain text."""
ELSEWHERE = r"(?!#|data:)"
ACTS = re.compile(
    rf"<\s*(?:script|foreignObject|iframe)\b|\son\w+\s*=|(?:href|src)\s*=\s*[\"']{ELSEWHERE}|"
    rf"url\(\s*[\"']?{ELSEWHERE}",
    re.IGNORECASE,
)
"""Forbidden in drawings: scripts, embedded pages, and external addresses."""


def check_section(section: SectionType) -> list[str]:
    """Problems of a section, with example chapters in a temporary folder."""
    if not isinstance(section.title, str) or not section.title.strip():
        return ["record: the title is empty; give the heading that it has on the page"]
    if MARKUP.search(section.title):
        return [f"record: the title holds markup, {section.title!r:.60}; it is shown as typed, so write plain text"]
    if (section.make is None) == (section.draw is None):
        return ["record: give make, or draw, and not both"]
    if section.make is None:
        return []
    problems: list[str] = []
    with tempfile.TemporaryDirectory() as place:
        chapters = _chapters(Path(place))
        for name, (folder, files) in chapters.items():
            problems += attempt(name, lambda folder=folder, files=files: _chapter(section, folder, files))  # type: ignore[misc]
        if not problems:
            problems += attempt("repeats", lambda: _repeats(section, Path(place), chapters))
    return problems


def _chapters(place: Path) -> dict[str, tuple[Path, Mapping[str, Path]]]:
    whole, begun, run = place / "whole" / "slide", place / "begun" / "slide", place / "run" / "slide"
    files = example_campaign(whole)
    begun.mkdir(parents=True)
    shutil.copyfile(files["campaign.toml"], begun / "campaign.toml")
    run.mkdir(parents=True)
    shutil.copyfile(files["traces/000001.npz"], run / "run.npz")
    return {
        "a campaign": (whole, files),
        "a campaign without results": (begun, {"campaign.toml": begun / "campaign.toml"}),
        "a run": (run, {"run.npz": run / "run.npz"}),
    }


def _parts(section: SectionType, files: Mapping[str, Path]) -> list[object]:
    made = () if section.make is None else section.make(ReportFiles(title="slide", files=files))
    if isinstance(made, str):
        raise TypeError("gave one text; give a list of parts")
    return list(made)


def _chapter(section: SectionType, folder: Path, files: Mapping[str, Path]) -> Iterator[str]:
    before = {name: path.read_bytes() for name, path in files.items()}
    with watched() as seen:
        parts = _parts(section, files)
    for part in parts:
        yield from _part(part)
    yield from read_elsewhere(seen, folder)
    yield from left_behind(seen)
    if {name: path.read_bytes() for name, path in files.items()} != before:
        yield "changes the files that it is made from"


def _part(part: object) -> Iterator[str]:
    if problem := part_problem(part):
        yield problem
    elif isinstance(part, Illustration):
        yield from _plain(part.title, part.caption)
        if ElementTree.fromstring(part.svg).tag.rpartition("}")[2] != "svg":
            yield f"the drawing {part.title!r} is not SVG"
        if found := ACTS.search(part.svg):
            yield f"the drawing {part.title!r} holds {found[0].strip()!r}; nothing in it acts or is loaded on the page"
    elif isinstance(part, Grid):
        yield from _plain(*part.head, *(cell for row in part.rows for cell in row), part.caption)
    else:
        yield from _plain(part)


def _plain(*texts: object) -> Iterator[str]:
    for text in texts:
        if isinstance(text, str) and (found := MARKUP.search(text)):
            yield f"holds markup, {found[0]!r:.40}; it is shown as typed, so write plain text"
            return


def _repeats(
    section: SectionType, place: Path, chapters: Mapping[str, tuple[Path, Mapping[str, Path]]]
) -> Iterator[str]:
    for name, (folder, files) in chapters.items():
        first = repr(_parts(section, files))
        if repr(_parts(section, files)) != first:
            yield f"{name}: gives something else for the same files when it is called again"
            continue
        copy = place / "copied" / folder.parent.name / folder.name
        shutil.copytree(folder, copy)
        if repr(_parts(section, {n: copy / n for n in files})) != first:
            yield f"{name}: gives something else for the same files in another folder; name files as `names` does"

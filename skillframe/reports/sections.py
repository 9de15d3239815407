"""Sections of plug-ins: made from the chapter's files, escaped, and each for itself.

What a section gives is text, tables and drawings. Text is escaped; drawings become images, in which nothing can act on
the page. A section that fails is named on the page with its plug-in, and the rest of the page is as it would be.
"""

from __future__ import annotations

import html
import sys
from collections.abc import Mapping
from contextlib import redirect_stdout
from pathlib import Path
from typing import Any, NamedTuple

from skillframe.errors import SkillframeError
from skillframe.extend.outputs import part_problem
from skillframe.extend.records import Grid, Illustration, ReportFiles, SectionType
from skillframe.extend.registry import registry
from skillframe.reports.markup import Markup, image, join, note, number, table, tag

MOST_BYTES = 2_000_000
"""Of one section (ours): five of them leave the page below what mail and code hosts take."""


class MadeSection(NamedTuple):
    """A section as it stands on the page."""

    name: str
    title: str
    body: Markup


class BadSection(SkillframeError):
    """A section gave something that cannot stand on a page."""


def has_sections() -> bool:
    """Does any plug-in have a section?"""
    return bool(registry().names("section"))


def made_sections(files: ReportFiles) -> list[MadeSection]:
    """The sections of all plug-ins that have something to say about a chapter, by name."""
    made = [made_section(record, files) for record in registry().records("section")]
    return [section for section in made if section.body]


def made_section(record: SectionType, files: ReportFiles) -> MadeSection:
    """One section. What its plug-in raises becomes a sentence in its place."""
    title = _text(record.title)
    try:
        with redirect_stdout(sys.stderr):
            parts = record.make(files)
            if isinstance(parts, str):
                raise BadSection("it gave one text; give a list of parts")
            body = join(part_markup(part) for part in parts)
        if len(body.encode("utf-8")) > MOST_BYTES:
            raise BadSection(f"it is larger than {MOST_BYTES / 1e6:g} MB")
    except (Exception, SystemExit) as error:  # a plug-in's mistake must not take the page down
        body = note(f"{_source(record)} could not make this section: {_said(error)}.")
    return MadeSection(record.name, title, body)


def _source(record: SectionType) -> str:
    """The plug-in that a section comes from, in words."""
    try:
        plugin = registry().provider("section", record.name)
    except SkillframeError:  # tried by itself
        return f"The plug-in of section {record.name}"
    return f"Section {record.name} of {plugin.distribution} {plugin.version}"


def _said(error: BaseException) -> str:
    text = str(error) if isinstance(error, SkillframeError) else f"{type(error).__name__}: {error}"
    return _text(text).rstrip(".")


def part_markup(part: object) -> Markup:
    """A paragraph, a table or a drawing of a plug-in.

    Raises:
        BadSection: it is none of these.
    """
    if problem := part_problem(part):
        raise BadSection(problem)
    if isinstance(part, Grid):
        rows = [tuple(_cell(cell) for cell in row) for row in part.rows]
        caption = tag("p", _escaped(part.caption), class_="caption") if part.caption else ""
        return join([table([_cell(cell) for cell in part.head], rows), caption])
    if isinstance(part, Illustration):
        return image(_text(part.title), _text(part.caption), _text(part.svg))
    return tag("p", _escaped(part))


def _cell(value: Any) -> Markup:
    if isinstance(value, float):
        return Markup(number(float(value)))
    return _escaped(value)


def _text(value: object) -> str:
    """Any value as plain text, also one that passes for markup. Half a surrogate pair is no text."""
    return str(value).encode("utf-8", "replace").decode()


def _escaped(value: object) -> Markup:
    return Markup(html.escape(_text(value), quote=True))


def files_of(folder: Path) -> Mapping[str, Path]:
    """What lies in a chapter's folder, by its name there. Hidden files and links to elsewhere are left out."""
    root = folder.resolve()
    found = {path.relative_to(folder): path for path in folder.rglob("*") if path.is_file()}
    return {
        name.as_posix(): path
        for name, path in sorted(found.items())
        if not any(part.startswith(".") for part in name.parts) and path.resolve().is_relative_to(root)
    }

"""Report sections that plug-ins make of text, tables and drawings.

Text is escaped, and drawings become images, which cannot run scripts. A failing section is named with its plug-in, and
the others are unaffected. Sections in HTML: see `sections`.
"""

from __future__ import annotations

import html
import sys
from collections.abc import Mapping
from contextlib import redirect_stdout
from pathlib import Path
from typing import Any, NamedTuple

from skillframe.errors import SkillframeError
from skillframe.extend import Grid, Illustration, ReportFiles, SectionType, part_problem, registry
from skillframe_reports.markup import Markup, image, join, note, number, table, tag

MOST_BYTES = 2_000_000
"""Most bytes of a section; mail and code hosts still accept a page of five."""


class MadeSection(NamedTuple):
    """A finished section."""

    name: str
    title: str
    body: Markup
    order: int


class BadSection(SkillframeError):
    """A section returned something invalid."""


def has_sections() -> bool:
    """Return whether any section is made of parts."""
    return any(record.make is not None for record in registry().records("section"))


def made_sections(files: ReportFiles) -> list[MadeSection]:
    """Return a chapter's non-empty sections of parts, by name."""
    records = [record for record in registry().records("section") if record.make is not None]
    return [section for section in (made_section(record, files) for record in records) if section.body]


def made_section(record: SectionType, files: ReportFiles) -> MadeSection:
    """Return one section. A plug-in's exception becomes a sentence."""
    title = _text(record.title)
    try:
        with redirect_stdout(sys.stderr):
            parts = record.make(files) if record.make is not None else ()
            if isinstance(parts, str):
                raise BadSection("it gave one text; give a list of parts")
            body = join(part_markup(part) for part in parts)
        if len(body.encode("utf-8")) > MOST_BYTES:
            raise BadSection(f"it is larger than {MOST_BYTES / 1e6:g} MB")
    except (Exception, SystemExit) as error:  # a plug-in's error must not break the page
        body = note(f"{_source(record)} could not make this section: {_said(error)}.")
    return MadeSection(record.name, title, body, record.order)


def _source(record: SectionType) -> str:
    try:
        plugin = registry().provider("section", record.name)
    except SkillframeError:  # an unregistered section under test
        return f"The plug-in of section {record.name}"
    return f"Section {record.name} of {plugin.distribution} {plugin.version}"


def _said(error: BaseException) -> str:
    text = str(error) if isinstance(error, SkillframeError) else f"{type(error).__name__}: {error}"
    return _text(text).rstrip(".")


def part_markup(part: object) -> Markup:
    """Return a plug-in's paragraph, table or drawing as HTML.

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
    return str(value).encode("utf-8", "replace").decode()


def _escaped(value: object) -> Markup:
    return Markup(html.escape(_text(value), quote=True))


def files_of(folder: Path) -> Mapping[str, Path]:
    """Return the files in a chapter's folder by name, without hidden files and outside links."""
    root = folder.resolve()
    found = {path.relative_to(folder): path for path in folder.rglob("*") if path.is_file()}
    return {
        name.as_posix(): path
        for name, path in sorted(found.items())
        if not any(part.startswith(".") for part in name.parts) and path.resolve().is_relative_to(root)
    }

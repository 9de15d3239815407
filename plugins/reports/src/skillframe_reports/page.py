"""The report: chapters in one self-contained HTML file.

Its content security policy forbids all addresses: styles and scripts are inline, images are data.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from skillframe.errors import InputError
from skillframe.extend import registry
from skillframe.files import write_whole
from skillframe_reports.headline import lead, tiles
from skillframe_reports.learned import learned_section
from skillframe_reports.markup import Markup, note, tag
from skillframe_reports.provenance import provenance_section
from skillframe_reports.runs import cover, demonstrations_section, runs_section
from skillframe_reports.shell import asset, bar, head
from skillframe_reports.sources import Chapter, read_chapters
from skillframe_reports.trust import trust_section
from skillframe_reports.verdict import banner, verdict_section

MOST_BYTES = 10_000_000
LIVE = (
    "The campaign has not ended. skillframe report --watch makes this page anew, and it loads itself again every 5 "
    "seconds."
)


class Page(NamedTuple):
    """Context for drawing a section.

    Attributes:
        chapter: its content.
        prefix: of identifiers, unique on the page.
        scenes: geometry by key, once per page.
    """

    chapter: Chapter
    prefix: str
    scenes: dict[str, Markup]


class Section(NamedTuple):
    """A finished section: end of its anchor, heading, and content."""

    name: str
    title: str
    body: Markup


def sections_of(page: Page) -> list[Section]:
    """Return a chapter's non-empty sections, by `SectionType.order` and name."""
    found = [(each.order, each.name, Section(f"plugin-{each.name}", each.title, each.body))
             for each in page.chapter.sections]  # fmt: skip
    for record in registry().records("section"):
        if record.draw is not None and (body := record.draw(page)):
            found.append((record.order, record.name, Section(record.name, record.title, Markup(body))))
    return [section for *_, section in sorted(found, key=lambda each: each[:2])]


def verdict(page: Page) -> Markup:
    """Return the basis of the verdict of a campaign with trials."""
    chapter = page.chapter
    told = chapter.folder and chapter.results is not None and chapter.results.rows
    return verdict_section(chapter) if told else Markup("")


def learned(page: Page) -> Markup:
    """Return the skills of a campaign's folder."""
    return learned_section(page.chapter) if page.chapter.folder else Markup("")


def demonstrations(page: Page) -> Markup:
    """Return the demonstrations of a campaign's folder."""
    return demonstrations_section(page.chapter) if page.chapter.folder else Markup("")


def run(page: Page) -> Markup:
    """Return the runs."""
    return runs_section(page.chapter, page.prefix, page.scenes)


def works(page: Page) -> Markup:
    """Return where a campaign's skills work."""
    return trust_section(page.chapter) if page.chapter.folder else Markup("")


def made(page: Page) -> Markup:
    """Return how the results were made."""
    return provenance_section(page.chapter)


def write_report(inputs: Sequence[Path], out: Path) -> int:
    """Write a report of campaign folders and trace files.

    Returns:
        its size in bytes.

    Raises:
        InputError: no input, unreadable input, or an unwritable file.
    """
    return write_chapters(read_chapters(inputs), out)


def write_chapters(chapters: Sequence[Chapter], out: Path, *, live: bool = False) -> int:
    """Write a report of chapters and return its size in bytes.

    Raises:
        InputError: there are no chapters, or the file cannot be written.
    """
    page = render(chapters, live=live).encode("utf-8")
    write_whole(out, page)
    return len(page)


def render(chapters: Sequence[Chapter], *, live: bool = False) -> str:
    """Return the document, a function of the chapters alone.

    Raises:
        InputError: there are no chapters.
    """
    if not chapters:
        raise InputError("report", "there is nothing to report on", "give a campaign's folder or a trace file")
    chapters = sorted(chapters, key=lambda chapter: chapter.kind is None)  # first pages come first
    scenes: dict[str, Markup] = {}
    names = [chapter.name for chapter in chapters]
    names = [
        f"{n} ({c.folder})" if names.count(n) > 1 and c.folder else n for n, c in zip(names, chapters, strict=True)
    ]
    alone, bodies = len(chapters) == 1, []
    for i, (chapter, name) in enumerate(zip(chapters, names, strict=True), start=1):
        hero = tag(
            "header", tag("p", "Report" if alone else f"Chapter {i}", class_="eyebrow"), tag("h1", name),
            banner(chapter) if chapter.kind is None else "",
            tag("div", tag("div", lead(chapter)), cover(chapter), class_="opening"), tiles(chapter), class_="hero",
        )  # fmt: skip
        notes = [note(text) for text in chapter.notes]
        found = sections_of(Page(chapter, f"c{i}", scenes))
        sections = [tag("section", tag("h2", each.title), each.body, id=f"c{i}-{each.name}") for each in found]
        kind = chapter.kind
        first = tag("div", Markup(kind.page(chapter)), id=anchor_of(kind.title, i)) if kind is not None else ""
        bodies.append(tag("div", first, hero, *notes, *sections, class_="chapter", id=f"c{i}"))
    title = chapters[0].name if alone else "skillframe report"
    again = tag("meta", http_equiv="refresh", content="5") if live else ""
    titles = [(i, chapter.kind.title) for i, chapter in enumerate(chapters, start=1) if chapter.kind is not None]
    links = [
        tag("a", title if len(titles) == 1 else f"{title} {i}", href=f"#{anchor_of(title, i)}") for i, title in titles
    ]
    if alone:
        links += [tag("a", section.title, href=f"#c1-{section.name}") for section in found]
    else:
        links += [tag("a", name, href=f"#c{i}") for i, name in enumerate(names, start=1)]
    body = tag(
        "body",
        bar(links),
        tag("main", note(LIVE, role="status") if live else "", *bodies),
        tag("footer", "Made by skillframe from files alone. Forces: environment on tool. Intervals are two-sided."),
        tag("noscript", note("Without scripts the 3-D replay does not move; stills and plots show the same run.")),
        *scenes.values(),
        tag("script", asset("theme.js"), asset("viewer.js")),
    )
    return "<!DOCTYPE html>\n" + tag("html", head(title, again), body, lang="en")


def anchor_of(title: str, index: int) -> str:
    """Return the anchor of a chapter's first page."""
    name = title.lower()
    return name if index == 1 else f"{name}-{index}"

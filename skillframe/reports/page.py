"""The page: chapters put together into one HTML file that needs nothing else and reaches for nothing outside.

The document's own policy forbids every address: styles and scripts are inline, images are data.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from skillframe.errors import InputError
from skillframe.files import write_whole
from skillframe.reports.certified import certificate_page
from skillframe.reports.headline import lead, tiles
from skillframe.reports.learned import learned_section
from skillframe.reports.markup import Markup, join, note, tag
from skillframe.reports.provenance import provenance_section
from skillframe.reports.runs import cover, demonstrations_section, runs_section
from skillframe.reports.shell import asset, bar, head
from skillframe.reports.sources import Chapter, read_chapters
from skillframe.reports.trust import trust_section
from skillframe.reports.verdict import banner, verdict_section

MOST_BYTES = 10_000_000
RELOAD_S = 5
LIVE = (
    f"The campaign has not ended. skillframe report --watch makes this page anew, and it loads itself again every "
    f"{RELOAD_S} seconds."
)


def write_report(inputs: Sequence[Path], out: Path) -> int:
    """Make a report from campaign folders and trace files.

    Args:
        inputs: folders and traces.
        out: the HTML file, written whole or not at all.

    Returns:
        its size in bytes.

    Raises:
        InputError: nothing to report on, input that cannot be read, or a file that cannot be written.
    """
    return write_chapters(read_chapters(inputs), out)


def write_chapters(chapters: Sequence[Chapter], out: Path, *, live: bool = False) -> int:
    """As `write_report`, of what was read before.

    Args:
        chapters: what the page shows.
        out: the HTML file.
        live: the page loads itself again and again, for it will be made anew.

    Returns:
        its size in bytes.

    Raises:
        InputError: there are no chapters, or the file cannot be written.
    """
    page = render(chapters, live=live).encode("utf-8")
    write_whole(out, page)
    return len(page)


def render(chapters: Sequence[Chapter], *, live: bool = False) -> str:
    """The whole document. The same chapters give the same text.

    Raises:
        InputError: there are no chapters.
    """
    if not chapters:
        raise InputError("report", "there is nothing to report on", "give a campaign's folder or a trace file")
    scenes: dict[str, Markup] = {}
    bodies = [_chapter(chapter, i, scenes, alone=len(chapters) == 1) for i, chapter in enumerate(chapters, start=1)]
    title = chapters[0].name if len(chapters) == 1 else "skillframe report"
    again = tag("meta", http_equiv="refresh", content=str(RELOAD_S)) if live else ""
    body = tag(
        "body",
        _top(chapters),
        tag("main", note(LIVE, role="status") if live else "", *bodies),
        _foot(),
        *scenes.values(),
        tag("script", asset("theme.js"), asset("viewer.js")),
    )
    return "<!DOCTYPE html>\n" + tag("html", head(title, again), body, lang="en")


SECTIONS = (
    ("verdict", "What the verdict rests on"),
    ("learned", "What was learned"),
    ("demonstrations", "The demonstrations"),
    ("run", "The run"),
    ("works", "Where it works"),
    ("made", "How this was made"),
)
PLUGIN = "plugin-"
"""Begins the addresses of plug-ins' sections; they come before the last one."""


def _top(chapters: Sequence[Chapter]) -> Markup:
    if len(chapters) == 1:
        links = [tag("a", title, href=f"#c1-{name}") for name, title in _sections(chapters[0])]
    else:
        links = [tag("a", chapter.name, href=f"#c{i}") for i, chapter in enumerate(chapters, start=1)]
    return bar(links)


def _sections(chapter: Chapter) -> list[tuple[str, str]]:
    """The sections that have something to say: a loose trace has neither skill nor campaign."""
    told = chapter.results is not None and chapter.results.rows
    own = [
        (name, title) for name, title in SECTIONS
        if (chapter.folder or name in ("run", "made")) and (told or name != "verdict")
    ]  # fmt: skip
    return [*own[:-1], *((f"{PLUGIN}{section.name}", section.title) for section in chapter.sections), own[-1]]


def _chapter(chapter: Chapter, index: int, scenes: dict[str, Markup], alone: bool) -> Markup:
    makers = {
        "verdict": lambda: verdict_section(chapter),
        "learned": lambda: learned_section(chapter),
        "demonstrations": lambda: demonstrations_section(chapter),
        "run": lambda: runs_section(chapter, f"c{index}", scenes),
        "works": lambda: trust_section(chapter),
        "made": lambda: provenance_section(chapter),
    }
    given = {f"{PLUGIN}{section.name}": section.body for section in chapter.sections}
    title = join([tag("p", "Report" if alone else f"Chapter {index}", class_="eyebrow"), tag("h1", chapter.name)])
    words = tag("div", lead(chapter))
    hero = tag(
        "header",
        title,
        banner(chapter) if chapter.asked is None else "",
        tag("div", words, cover(chapter), class_="opening"),
        tiles(chapter),
        class_="hero",
    )
    notes = [note(text) for text in chapter.notes]
    sections = [
        tag("section", tag("h2", title), given[name] if name in given else makers[name](), id=f"c{index}-{name}")
        for name, title in _sections(chapter)
    ]
    return tag("div", certificate_page(chapter), hero, *notes, *sections, class_="chapter", id=f"c{index}")


def _foot() -> Markup:
    return join([
        tag("footer", "Made by skillframe from files alone. Forces: environment on tool. Intervals are two-sided."),
        tag("noscript", note("Without scripts the 3-D replay does not move; stills and plots show the same run.")),
    ])  # fmt: skip

"""Self-contained page of all rows: published and own results, tables and figures, in the style of a report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib.resources import files
from typing import Any

from skillframe_reports.markup import Markup, data_uri, figure, join, note, table, tag
from skillframe_reports.shell import POLICY

from skillframe_papers.bars import SAID, with_intervals
from skillframe_papers.document import origin, threshold

BADGES = {"pass": "badge won", "fail": "badge lost", "reported": "badge"}
HEAD = ("row", "what is claimed", "published", "ours", "verdict", "values")
STYLE = """
.links > span { display: inline-flex; gap: 0.55rem; } .topic { font-size: 0.9rem; font-weight: 600; }
.links a.fail { color: var(--bad); }
.rows { font-size: 0.92rem; } .rows td { min-width: 3.2rem; } .rows td:nth-child(2) { min-width: 13rem; }
.rows td:nth-child(3), .rows td:nth-child(4) { min-width: 12rem; }
.facts { display: grid; grid-template-columns: max-content minmax(0, 1fr); gap: 0.25rem 1.2rem; margin: 0.6rem 0; }
.facts dt { color: var(--soft); } .facts dd { margin: 0; overflow-wrap: anywhere; }
figure img { max-height: 560px; object-fit: contain; }
.figures { columns: 2 410px; column-gap: 1rem; margin: 1rem 0; }
.figures figure { break-inside: avoid; margin-bottom: 1rem; }
.figures > figure:only-child { column-span: all; max-width: 860px; }
:root[data-theme="dark"] img.paper { filter: brightness(0.86); }
@media (max-width: 820px) {
  .facts { grid-template-columns: minmax(0, 1fr); gap: 0 0; } .facts dd { margin-bottom: 0.5rem; }
}
@media (max-width: 520px) {
  .rows th:nth-child(3), .rows td:nth-child(3), .rows th:nth-child(4), .rows td:nth-child(4) { display: none; }
  .rows td, .rows td:nth-child(2) { min-width: 0; } .rows td:first-child { min-width: 1.6rem; }
}
@media (prefers-color-scheme: dark) { :root:not([data-theme="light"]) img.paper { filter: brightness(0.86); } }
"""


def render(entries: Sequence[Mapping[str, Any]]) -> str:
    """The whole document, reproducible."""
    shared = files("skillframe_reports").joinpath("assets", "page.css").read_text(encoding="utf-8")
    head = tag(
        "head", tag("meta", charset="utf-8"), tag("meta", http_equiv="Content-Security-Policy", content=POLICY),
        tag("meta", name="viewport", content="width=device-width, initial-scale=1"),
        tag("title", "skillframe reproduce"), tag("style", Markup(shared + STYLE)),
    )  # fmt: skip
    topics: dict[str, list[Markup]] = {}
    for each in entries:
        hint = f"row {each['row']}, {each['verdict']}: {each['summary']}"
        link = tag("a", each["row"], href=f"#row-{each['row']}", title=hint, class_=each["verdict"])
        topics.setdefault(each.get("topic") or "row", []).append(link)
    top = tag(
        "nav",
        tag("span", "skillframe", class_="brand"),
        tag(
            "div",
            *[tag("span", tag("span", topic, class_="topic"), *links) for topic, links in topics.items()],
            class_="links",
        ),
    )
    body = tag(
        "body",
        top,
        tag("main", _hero(entries), *(_section(each) for each in entries)),
        tag("footer", "Made by skillframe reproduce from the rows' files alone."),
    )
    return "<!DOCTYPE html>\n" + tag("html", head, body, lang="en")


def _hero(entries: Sequence[Mapping[str, Any]]) -> Markup:
    count = {verdict: sum(each["verdict"] == verdict for each in entries) for verdict in BADGES}
    lead = (
        f"Published results, computed again: {count['pass']} pass, {count['fail']} fail, {count['reported']} are "
        "reported without a verdict. A row that does not reproduce is a result, too."
    )
    quick = any(each["quick"] for each in entries)
    lines = [
        (tag("a", each["row"], href=f"#row-{each['row']}"), each["summary"], each["published"],
         with_intervals(each["ours"]), _badge(each), each["values_are"])
        for each in entries
    ]  # fmt: skip
    return tag(
        "header", tag("p", "Reproduction", class_="eyebrow"), tag("h1", "The papers' results, row by row"),
        tag("p", lead, class_="lead"), note(SAID),
        note("This was a quick run: fewer trials than behind the table of the docs.") if quick else "",
        table(HEAD, lines, class_="rows", numeric=9), class_="hero",
    )  # fmt: skip


def _badge(each: Mapping[str, Any]) -> Markup:
    return tag("span", each["verdict"], class_=BADGES[each["verdict"]])


def _section(each: Mapping[str, Any]) -> Markup:
    alone = each["group"] == each["row"]
    shared = "" if alone else f"; what the rows of {each['group']!r} share is in the time of the first that needs it"
    facts = [
        ("published", f"{each['published']} ({each['source']})"),
        ("ours", with_intervals(each["ours"])),
        ("threshold", threshold(each)),
        ("values", origin(each)),
        ("difference", with_intervals(each["difference"])),
        ("command", tag("code", each["command"])),
        (
            "computed in",
            f"{each['wall_s']:.1f} s ({each['cpu_s']:.1f} s of processor time), seed {each['seed']}{shared}",
        ),
    ]
    listed = tag("dl", *(join([tag("dt", k), tag("dd", v)]) for k, v in facts if v), class_="facts")
    behind = each["table"]
    rows = [[with_intervals(cell) for cell in row] for row in behind["rows"]]
    return tag(
        "section", tag("h2", f"{each['row']}. {each['summary']} ", _badge(each)), listed,
        table(behind["head"], rows, numeric=9) if rows else "",
        tag("div", *(_picture(p) for p in each["pictures"]), class_="figures") if each["pictures"] else "",
        id=f"row-{each['row']}",
    )  # fmt: skip


def _picture(drawn: Mapping[str, str]) -> Markup:
    """A drawing as an image, so that it cannot act on the page."""
    source = data_uri("image/svg+xml", drawn["svg"].encode("utf-8"))
    image = tag("img", src=source, alt=drawn["title"], class_="paper")
    return figure(drawn["title"], drawn["caption"], image, class_="plot")

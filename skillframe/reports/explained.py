"""Why a skill is as it is, on one HTML page that needs nothing else: words, pictures, where it comes from."""

from __future__ import annotations

from collections.abc import Sequence

from skillframe.extend.records import Document, Illustration
from skillframe.reports.learned import labelled
from skillframe.reports.markup import Markup, data_uri, tag

_STYLE = """
body { font: 16px/1.55 system-ui, sans-serif; color: #1d2025; background: #f6f7f9; margin: 0; }
main { max-width: 60rem; margin: 0 auto; padding: 2rem 1.25rem 4rem; }
h1 { font-size: 1.5rem; margin: 0 0 .25rem; }
.headline { font-size: 1.2rem; margin: 0 0 1.5rem; }
.card { background: #fff; border: 1px solid #e1e4e9; border-radius: 10px; padding: 1rem 1.25rem; margin: 1.25rem 0; }
.card h2 { font-size: 1.1rem; margin: 0 0 .75rem; }
.card img { display: block; max-width: 100%; margin: 0 auto; }
.card p, footer { color: #4b515b; font-size: .92rem; }
"""


def page(name: str, document: Document, words: Sequence[str], pictures: Sequence[Illustration]) -> str:
    """One HTML page that needs nothing else: words, pictures, where it comes from."""
    cards = [
        tag(
            "section",
            tag("h2", picture.title),
            tag("img", src=data_uri("image/svg+xml", picture.svg.encode()), alt=picture.title),
            tag("p", picture.caption),
            class_="card",
        )
        for picture in pictures
    ]
    details = tag(
        "section", tag("h2", "In words"), tag("ul", *(tag("li", *labelled(line)) for line in words[1:])), class_="card"
    )
    sources = ", ".join(source["file"] for source in document["learned_from"]) or "nothing"
    made = f"Skill of type {document['type']}, learned from {sources}."
    head = tag(
        "head", Markup('<meta charset="utf-8"/>'), tag("title", name), tag("style", Markup(_STYLE)),
        Markup('<meta name="viewport" content="width=device-width, initial-scale=1"/>'),
    )  # fmt: skip
    body = tag("main", tag("h1", name), tag("p", words[0], class_="headline"), *cards, details, tag("footer", made))
    return "<!doctype html>\n" + tag("html", head, tag("body", body), lang="en")

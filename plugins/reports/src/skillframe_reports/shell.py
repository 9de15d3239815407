"""Common frame of all pages: head, content security policy and top bar."""

from __future__ import annotations

from collections.abc import Iterable
from importlib.resources import files

from skillframe_reports.markup import Markup, tag

POLICY = "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; img-src data:"
"""Forbids all addresses: styles and scripts are inline, images are data."""


def asset(name: str) -> Markup:
    """Return a style sheet or script of the package."""
    return Markup(files("skillframe_reports").joinpath("assets", name).read_text(encoding="utf-8"))


def head(title: str, *more: object, styles: Iterable[str] = ("page.css",)) -> Markup:
    """Return the document's head."""
    return tag(
        "head", tag("meta", charset="utf-8"), tag("meta", http_equiv="Content-Security-Policy", content=POLICY),
        tag("meta", name="viewport", content="width=device-width, initial-scale=1"), tag("title", title),
        *(tag("style", asset(name)) for name in styles), *more,
    )  # fmt: skip


def bar(links: Iterable[Markup]) -> Markup:
    """Return the top bar: links, and the switch of `theme.js` between light and dark."""
    toggle = tag("button", "Light / dark", id="theme", type="button")
    return tag("nav", tag("span", "skillframe", class_="brand"), tag("div", *links, class_="links"), toggle)

"""What every page has around its content: the document's head, its policy, and the bar at the top."""

from __future__ import annotations

from collections.abc import Iterable
from importlib.resources import files

from skillframe.reports.markup import Markup, tag

POLICY = "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; img-src data:"
"""Forbids every address: styles and scripts are inline, images are data."""


def asset(name: str) -> Markup:
    """A style sheet or a script of the package, as it stands."""
    return Markup(files("skillframe.reports").joinpath("assets", name).read_text(encoding="utf-8"))


def head(title: str, *more: object, styles: Iterable[str] = ("page.css",)) -> Markup:
    """The document's head.

    Args:
        title: of the browser's tab.
        more: further elements.
        styles: names of style sheets of the package.
    """
    return tag(
        "head", tag("meta", charset="utf-8"), tag("meta", http_equiv="Content-Security-Policy", content=POLICY),
        tag("meta", name="viewport", content="width=device-width, initial-scale=1"), tag("title", title),
        *(tag("style", asset(name)) for name in styles), *more,
    )  # fmt: skip


def bar(links: Iterable[Markup]) -> Markup:
    """The bar at the top: links, and the switch between light and dark, which `theme.js` makes work."""
    toggle = tag("button", "Light / dark", id="theme", type="button")
    return tag("nav", tag("span", "skillframe", class_="brand"), tag("div", *links, class_="links"), toggle)

"""`skillframe skill`: what a skill file holds, in words and in pictures."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from skillframe.cli.endings import PAGE
from skillframe.cli.output import emit_json
from skillframe.cli.words import tell

if TYPE_CHECKING:
    from skillframe.extend.records import Document, Illustration

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


@click.group()
def command() -> None:
    """Show and explain a learned skill.

    \b
    Example:
      skillframe skill show slide.skill.json
    """


@command.command()
@click.argument("file", type=click.Path(path_type=Path))
@click.option("--json", "as_json", is_flag=True, help="The checked document and its words as JSON on stdout.")
def show(file: Path, as_json: bool) -> None:
    """Say what a skill does: "push along -z at 20 mm/s; free along x; turns freely about y".

    \b
    Example:
      skillframe skill show peg.skill.json
    """
    from skillframe.document.file import load
    from skillframe.extend.registry import registry

    document = load(file)
    kind = registry().behaviour(document["type"])
    words = kind.describe(document) if kind.describe is not None else [kind.summary]
    if as_json:
        emit_json({**document, "words": words})
        return
    tell(words)
    sources = ", ".join(source["file"] for source in document["learned_from"])
    made = _maker(document["created_by"])
    click.echo(f"learned from {sources or 'nothing'}; made by {made}")


def _maker(created_by: dict[str, str]) -> str:
    """In words: skillframe-lmc 0.2.0 with skillframe 0.2.0."""
    core, plugin = f"skillframe {created_by.get('skillframe', '')}".strip(), created_by.get("plugin")
    if plugin in (None, "skillframe"):
        return core
    return f"{plugin} {created_by.get('plugin_version', '')} with {core}"


@command.command()
@click.argument("file", type=click.Path(path_type=Path))
@click.option("--out", required=True, type=PAGE, help="HTML file to write.")
def explain(file: Path, out: Path) -> None:
    """Draw why a skill is as it is: one self-contained HTML page.

    \b
    Example:
      skillframe skill explain peg.skill.json --out peg.html
    """
    from skillframe.document.file import load
    from skillframe.extend.registry import registry
    from skillframe.files import write_whole

    document = load(file)
    kind = registry().behaviour(document["type"])
    words = kind.describe(document) if kind.describe is not None else [kind.summary]
    pictures = kind.explain(document) if kind.explain is not None else []
    write_whole(out, _page(file.name, document, words, pictures).encode())
    click.echo(f"{out}: {len(pictures)} picture{'s' * (len(pictures) != 1)}")


def _page(name: str, document: Document, words: Sequence[str], pictures: Sequence[Illustration]) -> str:
    """One HTML page that needs nothing else: words, pictures, where it comes from."""
    from skillframe.report.learned import labelled
    from skillframe.report.markup import Markup, data_uri, tag

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

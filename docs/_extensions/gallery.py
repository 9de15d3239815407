"""A page for each script in `examples/`, with its picture and what it prints where these are there; and an overview.

Nothing is run here: `make docs` makes pictures that are missing, `make gallery` all of them in full. Pages are written
when the build begins, into `docs/gallery/`, which is not kept in version control.
"""

from __future__ import annotations

import ast
from pathlib import Path
from typing import Any, NamedTuple

ROOT = Path(__file__).resolve().parents[2]
MISSING = "*No picture here: type* `make gallery`."
HEAD = """# Gallery

Ten scripts, one subject each; all lie in `examples/` and are run by a test. Each takes `--out FOLDER` and, for a first
look, `--quick`.
"""


class Example(NamedTuple):
    """A script: its name, the first line of its docstring, and the rest."""

    name: str
    title: str
    text: str


def examples(folder: Path) -> list[Example]:
    """The scripts of a folder by name."""
    return [_read(path) for path in sorted(folder.glob("*.py"))]


def _read(path: Path) -> Example:
    title, _, text = (ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or "").partition("\n")
    return Example(path.stem, title.rstrip("."), text.strip())


def page(example: Example, pictures: Path) -> str:
    """The page of an example."""
    picture, printed = pictures / f"{example.name}.png", pictures / f"{example.name}.txt"
    parts = [f"# {example.title}", example.text]
    parts.append(f"```{{image}} pictures/{picture.name}\n:alt: {example.title}\n```" if picture.is_file() else MISSING)
    if printed.is_file() and (said := printed.read_text(encoding="utf-8").strip()):
        parts.append(f"It prints\n\n```text\n{said}\n```")
    parts.append(f"`examples/{example.name}.py`:")
    parts.append(f"```{{literalinclude}} ../../examples/{example.name}.py\n:language: python\n```")
    return "\n\n".join(parts) + "\n"


def overview(found: list[Example], pictures: Path) -> str:
    """The page of all examples."""
    cards = [line for example in found for line in _card(example, (pictures / f"{example.name}.png").is_file())]
    tree = ["```{toctree}", ":hidden:", "", *(example.name for example in found), "```"]
    return "\n".join([HEAD, "```{eval-rst}", ".. container:: gallery", "", *cards, "```", "", *tree, ""])


def _card(example: Example, drawn: bool) -> list[str]:
    link = f":doc:`{example.title} <{example.name}>`"
    if not drawn:
        return [f"   {link}", ""]
    figure = f"   .. figure:: pictures/{example.name}.png"
    return [figure, f"      :target: {example.name}.html", f"      :alt: {example.title}", "", f"      {link}", ""]


def write(app: Any) -> None:
    """Write the pages; what has not changed is left alone, so that a second build is quick."""
    folder = Path(app.srcdir) / "gallery"
    folder.mkdir(exist_ok=True)
    found, pictures = examples(ROOT / "examples"), folder / "pictures"
    pages = {"index": overview(found, pictures)} | {each.name: page(each, pictures) for each in found}
    for path in folder.glob("*.md"):
        if path.stem not in pages:
            path.unlink()
    for name, text in pages.items():
        path = folder / f"{name}.md"
        if not path.is_file() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")


def setup(app: Any) -> dict[str, bool]:
    """Register with Sphinx."""
    app.connect("builder-inited", write)
    return {"parallel_read_safe": True, "parallel_write_safe": True}

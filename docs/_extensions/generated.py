"""Tables that pages of the docs are filled with while they are built: results, changes of code, exported constants.

A page holds the line `<!-- generated -->` where its table comes. Nothing is computed here: the first table is made of
the verdicts that ship with `skillframe-papers`, the second of `tests/mutants/mutants.toml` and `caught.csv`, the third
of the lists of names of the core's packages.
"""

from __future__ import annotations

import ast
import csv
import json
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

ROOT = Path(__file__).resolve().parents[2]
MUTANTS, CAUGHT = (ROOT / "tests" / "mutants" / name for name in ("mutants.toml", "caught.csv"))
ROWS = ROOT / "plugins" / "papers" / "src" / "skillframe_papers" / "reproduced" / "reproduce.json"
STUBS = tuple(sorted((ROOT / "skillframe").glob("*/__init__.pyi")))
MARK = "<!-- generated -->\n"


def reproduced() -> str:
    """The papers' results, row by row."""
    from skillframe_papers import document

    return document.body(json.loads(ROWS.read_text(encoding="utf-8")))


def caught() -> str:
    """The changes of code, each with the test that noticed it when they were last run."""
    listed = tomllib.loads(MUTANTS.read_text(encoding="utf-8"))["mutant"]
    with CAUGHT.open(newline="", encoding="utf-8") as file:
        by = {row["change"]: row["caught_by"] for row in csv.DictReader(file)}
    survived = sum(by[each["what"]] == "" for each in listed)
    head = f"{len(listed)} changes: {len(listed) - survived} caught, {survived} survived."
    rows = [_row(each, by[each["what"]]) for each in listed]
    return "\n".join([head, "", "| changed file | what the change does | caught by |", "|---|---|---|", *rows]) + "\n"


def _row(change: dict[str, Any], test: str) -> str:
    file, _, name = test.partition("::")
    words = name.removeprefix("test_").replace("_", " ")
    by = f"`{Path(file).name}`: {words}" if test else "**nothing**"
    return f"| `{Path(change['file']).name}` | {change['what']}{' (s)' if change.get('survived') else ''} | {by} |"


def constants() -> str:
    """The constants and types that packages of the core export, which autodoc does not find there."""
    rows = ["| package | name | what it is |", "|---|---|---|"]
    for stub in STUBS:
        package = stub.parent
        for node in ast.parse(stub.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.ImportFrom) and node.module:
                found = _assigned(package / f"{node.module.replace('.', '/')}.py")
                rows += [
                    f"| `skillframe.{package.name}` | `{each.name}` | {found[each.name]} |"
                    for each in node.names
                    if each.name in found
                ]
    return "\n".join(rows) + "\n"


def _assigned(module: Path) -> dict[str, str]:
    """Names that a module assigns at its top, with the text below each, or with its comment `#:`."""
    if not module.exists():  # a package
        return {}
    source = module.read_text(encoding="utf-8")
    lines, body, found = source.splitlines(), ast.parse(source).body, dict[str, str]()
    for node, below in zip(body, [*body[1:], None], strict=True):
        if isinstance(node, ast.Assign | ast.AnnAssign):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            line, before = lines[node.lineno - 1], lines[node.lineno - 2]
            text = line.partition("#: ")[2] or (before.partition("#: ")[2] if before.startswith("#: ") else "")
            if not text and isinstance(below, ast.Expr) and isinstance(below.value, ast.Constant):
                text = " ".join(str(below.value.value).split())
            names = [each.id for target in targets for each in ast.walk(target) if isinstance(each, ast.Name)]
            found |= dict.fromkeys(names, text.replace("|", "\\|"))
    return found


class Table(NamedTuple):
    """What makes a page's table, and the files that it reads."""

    text: Callable[[], str]
    files: tuple[Path, ...]


TABLES = {
    "explanation/reproduced": Table(reproduced, (ROWS,)),
    "evidence/mutants": Table(caught, (MUTANTS, CAUGHT)),
    "reference/api": Table(constants, STUBS),
}


def filled(page: str, text: str) -> str:
    """The text of a page with its table in place of the mark."""
    return text.replace(MARK, TABLES[page].text()) if page in TABLES else text


def fill(app: Any, page: str, source: list[str]) -> None:
    """Fill a page that Sphinx has read, and have it read again when a file of its table changes."""
    if page in TABLES:
        source[0] = filled(page, source[0])
        for file in TABLES[page].files:
            app.env.note_dependency(str(file))


def setup(app: Any) -> dict[str, bool]:
    """Register with Sphinx."""
    app.connect("source-read", fill)
    return {"parallel_read_safe": True, "parallel_write_safe": True}

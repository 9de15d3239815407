"""Tables that pages of the docs are filled with while they are built: the papers' results, and the changes of code.

A page holds the line `<!-- generated -->` where its table comes. Nothing is computed here: the first table is made of
the verdicts that ship with `skillframe-papers`, the second of `tests/mutants/mutants.toml` and `caught.csv`.
"""

from __future__ import annotations

import csv
import json
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

ROOT = Path(__file__).resolve().parents[2]
MUTANTS, CAUGHT = (ROOT / "tests" / "mutants" / name for name in ("mutants.toml", "caught.csv"))
ROWS = ROOT / "plugins" / "papers" / "src" / "skillframe_papers" / "reproduced" / "reproduce.json"
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


class Table(NamedTuple):
    """What makes a page's table, and the files that it reads."""

    text: Callable[[], str]
    files: tuple[Path, ...]


TABLES = {
    "explanation/reproduced": Table(reproduced, (ROWS,)),
    "evidence/mutants": Table(caught, (MUTANTS, CAUGHT)),
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

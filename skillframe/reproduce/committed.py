"""Has a verdict changed? The verdicts that the docs show are committed beside them, for full and for quick runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from skillframe.files.documents import read_json
from skillframe.paths import data_dirs

FOLDER = "docs/reproduced"


def verdicts(*, quick: bool) -> dict[str, str]:
    """Verdict by row as committed; empty where the docs do not ship."""
    for folder in data_dirs(FOLDER):
        path = folder / ("quick.json" if quick else "reproduce.json")
        if path.is_file():
            return {each["row"]: each["verdict"] for each in read_json(path, "install again")}
    return {}


def changes(entries: Sequence[Mapping[str, Any]], committed: Mapping[str, str]) -> list[str]:
    """A sentence for every row whose verdict is not the committed one; rows that are not committed are passed over."""
    return [
        f"row {each['row']} is {each['verdict']!r}, the docs say {committed[each['row']]!r}"
        for each in entries
        if each["row"] in committed and each["verdict"] != committed[each["row"]]
    ]

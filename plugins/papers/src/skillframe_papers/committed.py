"""Changes against the verdicts that ship with this package and appear in the docs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from skillframe.files.documents import read_json

FOLDER = Path(__file__).parent / "reproduced"


def verdicts(*, quick: bool) -> dict[str, str]:
    """Committed verdict by row, of a full or of a quick run.

    Raises:
        InputError: the file that ships with the package is missing or damaged.
    """
    path = FOLDER / ("quick.json" if quick else "reproduce.json")
    return {each["row"]: each["verdict"] for each in read_json(path, "install skillframe-papers again")}


def changes(entries: Sequence[Mapping[str, Any]], committed: Mapping[str, str]) -> list[str]:
    """A sentence for every committed row whose verdict differs."""
    return [
        f"row {each['row']} is {each['verdict']!r}, the docs say {committed[each['row']]!r}"
        for each in entries
        if each["row"] in committed and each["verdict"] != committed[each["row"]]
    ]

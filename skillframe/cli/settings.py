"""Tables of settings with default, range and unit, for `worlds --settings` and `robots --keys`."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

from skillframe.cli.output import LIST_WIDTH, table


def tell_settings(rows: Sequence[dict[str, Any]]) -> None:
    """Print what --set takes."""
    lines = [
        (row.get("option") or row["name"], row["world"] or "any", *_figures(row), plain(row["about"])) for row in rows
    ]
    table(("setting", "world", "default", "range", "what it is"), lines, LIST_WIDTH)


def tell_keys(rows: Sequence[dict[str, Any]]) -> None:
    """Print the keys of a robot.toml."""
    keys = [(row["name"], *_figures(row), plain(row["about"]) if row["unit"] else row["about"]) for row in rows]
    table(("key", "default", "range", "what it is"), keys, LIST_WIDTH)


def _figures(row: dict[str, Any]) -> tuple[str, str]:
    from skillframe.config.units import Range, shown

    default = row["default"]
    number = isinstance(default, int | float) and not isinstance(default, bool)
    limits = None if row["range"] is None else Range(*row["range"])
    said = shown(default, row["unit"]) if number and row["unit"] else typed(default)
    return said, "" if limits is None else limits.words(row["unit"])


def plain(about: str) -> str:
    """A quantity's text without unit and range, which have their own columns."""
    return re.sub(r" \[[^\]]*\]", "", about)


def typed(value: Any) -> str:
    """A default as typed, "" if it depends on something else."""
    if value is None:
        return ""
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:.6g}" if isinstance(value, float) else f"{value}"

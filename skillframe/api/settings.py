"""Settings of trials and worlds, and warnings for bare numbers that look like millimetres or degrees."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import is_dataclass
from typing import Any, get_args, get_type_hints

from skillframe.config import settings_of, texts
from skillframe.config.units import OF_RUNS, Quantity, doubt
from skillframe.extend.drives import of_world, quantities
from skillframe.extend.records import WorldType
from skillframe.extend.registry import registry
from skillframe.robot.spec import RobotFile, RobotSpec


def row_of(each: Quantity, world: str | None = None) -> dict[str, Any]:
    """A quantity as plain values: `name`, `world`, `unit`, `default`, `about`, `range`, `why`, and an `option`."""
    limits = each.range
    return {
        "name": each.name, "world": world, "unit": each.unit, "default": each.nominal, "about": each.about,
        "range": limits and limits[:2], "why": limits.why if limits else "",
        **({"option": each.option} if each.option else {}),
    }  # fmt: skip


def of_trials() -> Iterator[dict[str, Any]]:
    """Quantities of runs, with their `option` of `skillframe run`, and of trials."""
    yield from (row_of(each) for each in (*OF_RUNS, *quantities().values()))


def settings_of_world(record: WorldType) -> Iterator[dict[str, Any]]:
    """A world's parameters."""
    yield from (row_of(each, record.name) for each in of_world(record.params).values())


def of_robot() -> Iterator[dict[str, Any]]:
    """Keys of robot.toml: "control.rate_hz", "home.NAME" in a table by names, "arm[].name" in a list.

    Each with `name`, `world` (None), `unit`, `default`, `about` and `range`, as of trials. The text alone holds a unit
    that nobody types.
    """
    said = texts(RobotSpec)  # has the same fields, with descriptions
    tables = [record.tables() for record in registry().records("drive") if record.tables is not None]
    of_drives = (row for table in tables for name, kind in table.items() for row in _keys(kind, f"{name}."))
    for row in (*_keys(RobotFile, ""), *of_drives):
        yield {**row, "about": row["about"] or said.get(row["name"].removesuffix(".NAME"), ""), "world": None}


def _keys(kind: type, group: str) -> Iterator[dict[str, Any]]:
    """Fields of a dataclass and of those in it. `group` is the prefix of their keys."""
    hints = get_type_hints(kind)
    for row in settings_of(kind):
        hint, name = hints[row["name"]], f"{group}{row['name']}"
        parts = [hint, *get_args(hint)]
        many = ".NAME" if dict in (getattr(each, "__origin__", None) for each in parts) else ""
        many = "[]" if isinstance(row["default"], tuple) and any(map(is_dataclass, parts)) else many
        inner = next((each for each in parts if is_dataclass(each)), None)
        if isinstance(inner, type):
            yield from _keys(inner, f"{name}{many}.")
        else:
            yield {**row, "name": f"{name}{many}"}


def doubts(world: str, settings: Mapping[str, Any]) -> list[str]:
    """Sentences on bare numbers that look like millimetres or degrees."""
    known = quantities(registry().world(world).params)
    rows = [(key, value, known[key]) for key, value in settings.items() if key in known]
    found = [doubt(key, value, quantity.unit, quantity.nominal) for key, value, quantity in rows]
    return [text for text in found if text]

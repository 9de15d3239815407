"""What can be set of a trial and of a world, and which bare numbers look like millimetres or degrees."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import is_dataclass
from math import isnan
from typing import Any, get_args, get_type_hints

from skillframe.config.fields import settings_of, texts
from skillframe.config.of_runs import OF_RUNS
from skillframe.config.units import doubt
from skillframe.extend.records import WorldType
from skillframe.extend.registry import registry
from skillframe.robot.spec import RobotFile, RobotSpec
from skillframe.world.quantities import VARIED


def of_trials() -> Iterator[dict[str, Any]]:
    """Rows of what can differ between trials: `name`, `world` (None), `unit`, `default`, `about`, `range`, `why`."""
    for each in VARIED:
        limits = each.range
        yield {
            "name": each.name, "world": None, "unit": each.unit, "default": each.nominal, "about": each.about,
            "range": None if limits is None else limits[:2], "why": "" if limits is None else limits.why,
        }  # fmt: skip


def of_runs() -> Iterator[dict[str, Any]]:
    """Rows of what holds for a whole run or campaign, with its `option` of `skillframe run`."""
    for each in OF_RUNS:
        default = None if isnan(each.default) else each.default
        yield {
            "name": each.name, "world": None, "unit": each.unit, "default": default,
            "about": each.about, "range": each.range[:2], "why": each.range.why, "option": each.option,
        }  # fmt: skip


def of_world(record: WorldType) -> Iterator[dict[str, Any]]:
    """Rows of a world's own parameters."""
    for each in settings_of(record.params):
        yield {**each, "name": f"world.{each['name']}", "world": record.name}


def of_robot() -> Iterator[dict[str, Any]]:
    """Rows of the keys of robot.toml: "control.rate_hz", "home.NAME" in a table by names, "arm[].name" in a list.

    Each with `name`, `world` (None), `unit`, `default`, `about` and `range`, as of trials. A unit that nobody types
    stands in the text alone.
    """
    said = texts(RobotSpec)  # word for word the same fields, and described there
    for row in _keys(RobotFile, ""):
        yield {**row, "about": row["about"] or said.get(row["name"].removesuffix(".NAME"), ""), "world": None}


def _keys(kind: type, group: str) -> Iterator[dict[str, Any]]:
    """Rows of a record and of the records in it. `group` is what stands before its keys."""
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
    """Sentences about bare numbers that look like millimetres or degrees."""
    rows = {row["name"]: row for row in [*of_trials(), *of_world(registry().world(world))]}
    known = [(key, value, rows[key]) for key, value in settings.items() if key in rows]
    found = [doubt(key, value, row["unit"], row["default"]) for key, value, row in known]
    return [text for text in found if text]

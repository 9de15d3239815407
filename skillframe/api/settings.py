"""What can be set of a trial and of a world, and which bare numbers look like millimetres or degrees."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from math import isnan
from typing import Any

from skillframe.config.fields import settings_of
from skillframe.config.of_runs import OF_RUNS
from skillframe.config.units import doubt
from skillframe.extend.records import WorldType
from skillframe.extend.registry import registry
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


def doubts(world: str, settings: Mapping[str, Any]) -> list[str]:
    """Sentences about bare numbers that look like millimetres or degrees."""
    rows = {row["name"]: row for row in [*of_trials(), *of_world(registry().world(world))]}
    known = [(key, value, rows[key]) for key, value in settings.items() if key in rows]
    found = [doubt(key, value, row["unit"], row["default"]) for key, value, row in known]
    return [text for text in found if text]

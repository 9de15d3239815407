"""Page and table of AutoMate's assemblies: rates of every method, and each assembly with its picture."""

from __future__ import annotations

import math
from collections.abc import Sequence
from importlib.resources import files
from typing import Any, NamedTuple

from skillframe_reports.markup import Markup, data_uri, join, note, table, tag
from skillframe_reports.shell import POLICY

from skillframe_benchmarks.assembly import Level, Plan
from skillframe_benchmarks.assets import DEVELOPED
from skillframe_benchmarks.counts import OFTEN, Found, Share, share

HEAD = ("level", "assemblies", "method", "seated", "95 % interval", ">= 80 %", "published check")
GROUPS = ("developed on", "untouched")
STYLE = """
.parts { display: grid; grid-template-columns: repeat(auto-fill, minmax(min(100%, 360px), 1fr)); gap: 1rem; }
.parts figure { margin: 0; } .parts img { max-width: 100%; height: auto; } .parts table { font-size: 0.78rem; }
.level { white-space: nowrap; }
"""


class Total(NamedTuple):
    """One line of the table: a level, a group of assemblies and a method."""

    level: str
    group: str
    method: str
    seated: Share
    checked: Share | None


def totals(found: Sequence[Found], levels: Sequence[Level], methods: Sequence[str]) -> list[Total]:
    """The table, with developed-on assemblies apart."""
    out = []
    for level in levels:
        for group in GROUPS:
            mine = [each for each in found if (each.name in DEVELOPED) == (group == GROUPS[0])]
            for method in methods:
                cells = [each.cells[key] for each in mine if (key := (level.name, method)) in each.cells]
                if cells:
                    known = [cell for cell in cells if cell.checked is not None]
                    theirs = share(known, checked=True) if known else None
                    out.append(Total(level.name, group, method, share(cells), theirs))
    return out


def lines(given: Sequence[Total]) -> list[tuple[str, ...]]:
    """The table's cells as text."""
    return [
        (
            each.level, f"{each.seated.assemblies} {each.group}", each.method, f"{each.seated.rate:.0%}",
            "too few" if each.seated.low is None else f"{each.seated.low:.0%} to {each.seated.high:.0%}",
            f"{each.seated.often} of {each.seated.assemblies}",
            "" if each.checked is None else f"{each.checked.rate:.0%}",
        )
        for each in given
    ]  # fmt: skip


def plain(found: Sequence[Found], given: Sequence[Total]) -> dict[str, Any]:
    """All of it as JSON values."""
    return {
        "totals": [
            {"level": t.level, "group": t.group, "method": t.method, **_share("seated", t.seated),
             **({} if t.checked is None else _share("published_check", t.checked))}
            for t in given
        ],
        "assemblies": [
            {"name": each.name, "refused": each.refused, "unlearned": dict(each.unlearned), "cost_s": dict(each.cost),
             "parts": {k: v for k, v in each.parts.items() if k != "sha256"},
             "cells": [{"level": level, "method": method, **_cell(cell)}
                       for (level, method), cell in each.cells.items()]}
            for each in found
        ],
    }  # fmt: skip


def _share(name: str, given: Share) -> dict[str, Any]:
    return {f"{name}_{key}": value for key, value in given._asdict().items()}


def _cell(cell: Any) -> dict[str, Any]:
    values = cell._asdict() | {"causes": dict(cell.causes)}
    return {key: None if isinstance(value, float) and math.isnan(value) else value for key, value in values.items()}


def render(found: Sequence[Found], given: Sequence[Total], plan: Plan, count: int) -> str:
    """The whole self-contained document."""
    shared = files("skillframe_reports").joinpath("assets", "page.css").read_text(encoding="utf-8")
    head = tag(
        "head", tag("meta", charset="utf-8"), tag("meta", http_equiv="Content-Security-Policy", content=POLICY),
        tag("meta", name="viewport", content="width=device-width, initial-scale=1"),
        tag("title", "skillframe benchmark automate"), tag("style", Markup(shared + STYLE)),
    )  # fmt: skip
    refused, count_unlearned = [each for each in found if each.refused], sum(bool(each.unlearned) for each in found)
    unlearned = f"Of {count_unlearned} a method learned nothing, and its trials count as failed. " * bool(
        count_unlearned
    )
    said = (
        f"{len(found)} of {count} assemblies done, {len(refused)} of them refused. {unlearned}"
        f"{plan.robot}, {plan.trials} trials a level and method, two demonstrations each "
        f"(seed {plan.seed}; of the samples {plan.draws}). "
        f"Seated: within 1 mm of the assembled height and 2 mm sideways, and the skill ended by itself. "
        f"Intervals resample assemblies. "
        f"The column >= 80 % counts assemblies of which {OFTEN:.0%} of the trials and more are seated."
    )
    shown = table(HEAD, lines(given), numeric=3) if given else note("Nothing ran yet.")
    each = tag("div", *map(_figure, found), class_="parts")
    main = tag("main", tag("h1", "AutoMate's assemblies"), note(said), shown, tag("h2", "One by one"), each)
    body = tag("body", main)
    return "<!DOCTYPE html>\n" + tag("html", head, body, lang="en")


def _figure(found: Found) -> Markup:
    parts = found.parts
    said = f"{1e3 * parts['depth_m']:.3g} mm deep, {1e3 * parts['clearance_m']:.2g} mm of play" if parts else ""
    rows = [
        (tag("span", level, class_="level"), method,
         tag("span", f"{cell.seated} of {cell.trials}{f', {cell.refused} starts refused' * bool(cell.refused)}",
             class_="level"),
         ", ".join(f"{n} {c}" for c, n in cell.causes.items()))
        for (level, method), cell in found.cells.items()
    ]  # fmt: skip
    shown = table(("level", "method", "seated", "not seated"), rows, numeric=9) if rows else ""
    none = [join([tag("br"), f"{method}: {why}"]) for method, why in found.unlearned.items()]
    below = tag("figcaption", said, tag("br"), found.refused, *none)
    picture = join([])
    if found.picture.exists():
        source = data_uri("image/png", found.picture.read_bytes())
        picture = tag("img", src=source, alt="the parts, cut open", loading="lazy")
    return tag("figure", tag("h4", found.name), picture, below, shown)

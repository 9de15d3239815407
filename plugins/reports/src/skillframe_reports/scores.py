"""Scores of a campaign's trials, from results.csv, and of a run, from its trace."""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import product
from statistics import median
from typing import Any

from skillframe.campaign import SCORE
from skillframe_reports.markup import Markup, join, number, table, tag
from skillframe_reports.results import Results
from skillframe_reports.sources import Chapter

HEAD = ("score", "skill", "trials", "median", "smallest", "largest", "unit")


def scores_table(chapter: Chapter, results: Results) -> Markup:
    """Return each score of each skill, empty without scores."""
    names = sorted({name for row in results.rows for name in row.values if name.startswith(SCORE)})
    if not names:
        return Markup("")
    about = {name: _about(chapter, name.removeprefix(SCORE)) for name in names}
    rows = list[tuple[object, ...]]()
    for name, skill in product(names, results.skills):
        given = [row.values.get(name, math.nan) for row in results.of(skill)]
        values = [value for value in given if math.isfinite(value)]
        figures = [number(f(values)) for f in (median, min, max)] if values else ["none"] * 3
        rows.append((words(name.removeprefix(SCORE)), skill, len(values), *figures, about[name].get("unit", "")))
    said = [f"{words(name.removeprefix(SCORE))}: {text}" for name in names if (text := about[name].get("summary", ""))]
    caption = "Of all trials that have the figure, failed ones too. " + " ".join(
        f"{text.rstrip('.')}." for text in said
    )
    return join([tag("h3", "Scores"), table(HEAD, rows, numeric=2), tag("p", caption, class_="caption")])


def _about(chapter: Chapter, name: str) -> Mapping[str, str]:
    told = chapter.summary.get("scores")
    found = told.get(name) if isinstance(told, dict) else None
    return {k: v for k, v in found.items() if isinstance(v, str)} if isinstance(found, dict) else {}


def said_of(meta: Mapping[str, Any]) -> list[str]:
    """Return the scores of a run in words."""
    found = meta.get("scores") or {}
    return [f"{words(name)} {_figure(score)}" for name, score in found.items() if isinstance(score, Mapping)]


def _figure(score: Mapping[str, Any]) -> str:
    value = score.get("value")
    if isinstance(value, bool) or not isinstance(value, int | float):
        return "none"
    return f"{number(float(value))} {score.get('unit', '')}".strip()


def words(name: str) -> str:
    """Return a score's name as words."""
    return name.replace("_", " ")

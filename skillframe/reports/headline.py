"""The first screen: what was learned and how it did, figures first, for someone who has never seen the project."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from skillframe.campaign.spec import name_of
from skillframe.reports.learned import described
from skillframe.reports.markup import Markup, escape, join, number, percent, tag
from skillframe.reports.peaks import WORDS, said
from skillframe.reports.quantities import quantity
from skillframe.reports.results import Rate, Results
from skillframe.reports.sources import Chapter
from skillframe.reports.svg import Axes, picture

MEDIANS = (*WORDS, "duration_s")


def lead(chapter: Chapter) -> Markup:
    """What happened, in a few sentences."""
    if chapter.results is not None and chapter.results.rows:
        return join([
            tag("p", *_claims(chapter, chapter.results), class_="lead"),
            tag("p", _setting(chapter, chapter.results), class_="lead small"),
            *([tag("p", _sentence(why), class_="lead small")] if (why := chapter.results.validity.why_none) else []),
        ])  # fmt: skip
    if chapter.runs:
        return tag("p", *_run_sentences(chapter), class_="lead")
    return tag("p", "There are neither trials nor runs in this folder yet.", class_="lead")


def _sentence(why: str) -> str:
    return f"There are no intervals and no p-values: {why}."


def tiles(chapter: Chapter) -> Markup:
    """A tile per skill with its rate and interval."""
    results = chapter.results
    if results is None or not results.rows:
        return Markup("")
    return tag("div", *[_tile(results, skill, i) for i, skill in enumerate(results.skills)], class_="tiles")


def _claims(chapter: Chapter, results: Results) -> list[object]:
    first, *others = results.skills
    words: list[object] = [*_claim(results, first), f" with {first}", _origin(chapter.skills.get(first)), "."]
    for skill in others:
        words += [" On the same draws, ", *_claim(results, skill), f" with {skill}."]
    lines = next((found for d in chapter.skills.values() if (found := described(d)[0])), [])
    return [*words, *([" What was learned: ", tag("em", lines[0].strip().rstrip(".")), "."] if lines else [])]


def _claim(results: Results, skill: str) -> list[object]:
    rate = results.rate(skill)
    return [
        tag("strong", f"{rate.successes} of {rate.trials}"),
        f"{' real' if results.real else ''} trials succeeded ({percent(rate.share)}; {results.said(rate)})"
        f"{results.mark(skill)}",
    ]


def _origin(document: dict[str, Any] | None) -> str:
    sources = (document or {}).get("learned_from")
    if not isinstance(sources, list) or not sources:
        return ""
    return f", learned from {'one demonstration' if len(sources) == 1 else f'{len(sources)} demonstrations'}"


def _setting(chapter: Chapter, results: Results) -> str:
    """Who did what, and over which ranges."""
    robot, world = (str(chapter.spec.get(key) or chapter.summary.get(key) or "") for key in ("robot", "world"))
    where = f"Robot {name_of(robot)}, world {world}" if robot and world else "Every trial"
    spans = ranges(results)
    return f"{where}; varied from trial to trial: {', '.join(spans)}." if spans else f"{where}; nothing varied."


def ranges(results: Results) -> list[str]:
    """Each varied quantity with the range that its trials cover."""
    return [_range(results, name) for name in results.varied]


def _range(results: Results, name: str) -> str:
    q = quantity(name)
    values = [q.factor * row.values.get(name, math.nan) for row in results.rows]
    finite = [v for v in values if math.isfinite(v)]
    return f"{q.label} {number(min(finite), 2)} to {number(max(finite), 2)} {q.unit}".strip()


def _tile(results: Results, skill: str, index: int) -> Markup:
    rate, kind = results.rate(skill), "real trials" if results.real else "trials"
    return tag(
        "div", tag("p", skill, class_="tile-name"),
        tag("p", percent(rate.share), class_=f"tile-figure s{index % 4 + 1}"),
        tag("p", f"{rate.successes} of {rate.trials} {kind} succeeded{results.mark(skill)}", class_="tile-text"),
        interval_bar(rate, index),
        tag("p", results.said(rate), class_="tile-text"),
        tag("p", _typical(results, skill), class_="tile-text faint"), class_="tile",
    )  # fmt: skip


def interval_bar(rate: Rate, index: int) -> Markup:
    """A rate on a scale from 0 to 1 with its interval, if there is one, as a whisker."""
    axes = Axes(width=240, height=22, x=(0.0, 1.0), y=(0.0, 1.0))
    stroke, whisker, point = f"s{index % 4 + 1}", Markup(""), Markup("")
    if rate.interval is not None:
        low, high = (round(4 + 232 * v, 1) for v in rate.interval)
        whisker = tag("line", x1=low, x2=high, y1=11, y2=11, class_=f"whisker {stroke}")
    if rate.trials:
        point = tag("circle", cx=round(4 + 232 * rate.share, 1), cy=11, r=5, class_=f"point {stroke}")
    return picture(
        axes, f"{percent(rate.share)}, {rate.span or 'without an interval'}",
        tag("line", x1=4, x2=236, y1=11, y2=11, class_="track"), whisker, point, class_="interval",
    )  # fmt: skip


def _typical(results: Results, skill: str) -> str:
    rows = results.of(skill)
    columns = {name: [v for r in rows if math.isfinite(v := r.values.get(name, math.nan))] for name in MEDIANS}
    medians = {name: float(np.median(values)) for name, values in columns.items() if values}
    parts = said(medians, number)
    parts += [f"duration {number(medians['duration_s'])} s"] if "duration_s" in medians else []
    return f"medians: {', '.join(parts)}" if parts else ""


def _run_sentences(chapter: Chapter) -> list[object]:
    won = sum(bool(run.trace.meta.get("success")) for run in chapter.runs)
    count = len(chapter.runs)
    if count == 1:
        meta = chapter.runs[0].trace.meta
        outcome = "succeeded" if won else "did not succeed"
        reason = str(meta.get("reason") or meta.get("failure") or "")
        return ["This run ", tag("strong", outcome), escape(f": {reason}." if reason else ".")]
    return [tag("strong", f"{won} of {count}"), " runs that are shown here succeeded."]

"""First screen of a chapter: what was learned, and its success."""

from __future__ import annotations

import math

import numpy as np

from skillframe.campaign import name_of, parse_axis
from skillframe.errors import InputError
from skillframe.execution import WORDS, peak_forces
from skillframe_reports.learned import described
from skillframe_reports.markup import Markup, join, number, percent, tag
from skillframe_reports.quantities import quantity
from skillframe_reports.results import Rate, Results
from skillframe_reports.setup_section import table_of
from skillframe_reports.sources import Chapter
from skillframe_reports.svg import Axes, picture

MEDIANS = (*WORDS, "duration_s")


def lead(chapter: Chapter) -> Markup:
    """Return a summary in a few sentences."""
    results = chapter.results
    if results is None or not results.rows:
        won, count = sum(bool(run.trace.meta.get("success")) for run in chapter.runs), len(chapter.runs)
        if not count:
            return tag("p", "There are neither trials nor runs in this folder yet.", class_="lead")
        if count > 1:
            return tag("p", tag("strong", f"{won} of {count}"), " runs that are shown here succeeded.", class_="lead")
        meta = chapter.runs[0].trace.meta
        reason = str(meta.get("reason") or meta.get("failure") or "")
        how = tag("strong", "succeeded" if won else "did not succeed")
        return tag("p", "This run ", how, f": {reason}." if reason else ".", class_="lead")
    first, *others = results.skills
    sources = (chapter.skills.get(first) or {}).get("learned_from")
    count = len(sources) if isinstance(sources, list) else 0
    taught = f", learned from {'one demonstration' if count == 1 else f'{count} demonstrations'}" if count else ""
    words: list[object] = [*_claim(results, first), f" with {first}", taught, "."]
    for skill in others:
        words += [" On the same samples, ", *_claim(results, skill), f" with {skill}."]
    lines = next((found for d in chapter.skills.values() if (found := described(d)[0])), [])
    words += [" What was learned: ", tag("em", lines[0].strip().rstrip(".")), "."] if lines else []
    robot, world = (str(chapter.spec.get(key) or chapter.summary.get(key) or "") for key in ("robot", "world"))
    where = f"Robot {name_of(robot)}, world {world}" if robot and world else "Every trial"
    spans = ranges(chapter, results)
    what = f"varied from trial to trial: {', '.join(spans)}" if spans else "nothing varied"
    setting = f"{where}; {what}."
    setting += f" The intervals hold{results.condition}." if results.condition else ""
    why = f"There are no intervals and no p-values: {results.validity.why_none}."
    return join([
        tag("p", *words, class_="lead"), tag("p", setting, class_="lead small"),
        tag("p", why, class_="lead small") if results.validity.why_none else "",
    ])  # fmt: skip


def tiles(chapter: Chapter) -> Markup:
    """Return a tile per skill with its rate and interval."""
    results = chapter.results
    if results is None or not results.rows:
        return Markup("")
    return tag("div", *[_tile(results, skill, i) for i, skill in enumerate(results.skills)], class_="tiles")


def _claim(results: Results, skill: str) -> list[object]:
    rate = results.rate(skill)
    return [
        tag("strong", f"{rate.successes} of {rate.trials}"),
        f"{' real' if results.real else ''} trials succeeded ({percent(rate.share)}){results.mark(skill)}",
    ]


def ranges(chapter: Chapter, results: Results) -> list[str]:
    """Return each varied quantity with its declared range, else that of its trials."""
    said = []
    for name in results.varied:
        q = quantity(name)
        try:
            axis = parse_axis(table_of(chapter.spec, "vary").get(name), name)
        except InputError:
            axis = None
        if axis is not None and axis.kind in ("uniform", "sobol"):
            low, high = (number(q.factor * float(end), 3) for end in axis.numbers)
            said.append(f"{q.label} {low} to {high} {q.unit}".strip())
        else:
            values = [q.factor * row.values.get(name, math.nan) for row in results.rows]
            finite = [v for v in values if math.isfinite(v)]
            span = f"{number(min(finite), 2)} to {number(max(finite), 2)} {q.unit}"
            said.append(f"{q.label} sampled from {span}".strip())
    return said


def _tile(results: Results, skill: str, index: int) -> Markup:
    rate, kind = results.rate(skill), "real trials" if results.real else "trials"
    rows = results.of(skill)
    columns = {name: [v for r in rows if math.isfinite(v := r.values.get(name, math.nan))] for name in MEDIANS}
    medians = {name: float(np.median(values)) for name, values in columns.items() if values}
    parts = peak_forces(medians, number)[:1]  # the other two forces appear below
    parts += [f"duration {number(medians['duration_s'])} s"] if "duration_s" in medians else []
    return tag(
        "div", tag("p", skill, class_="tile-name"),
        tag("p", percent(rate.share), class_=f"tile-figure s{index % 4 + 1}"),
        tag("p", f"{rate.successes} of {rate.trials} {kind} succeeded{results.mark(skill)}", class_="tile-text"),
        interval_bar(rate, index),
        tag("p", results.said(rate), class_="tile-text"),
        tag("p", f"medians: {', '.join(parts)}" if parts else "", class_="tile-text faint"), class_="tile",
    )  # fmt: skip


def interval_bar(rate: Rate, index: int) -> Markup:
    """Return a rate on a scale from 0 to 1, with its interval if known."""
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

"""Success over varied quantities: maps of two quantities, curves of one.

Cells and points hold counts, and 95 % intervals if the campaign permits (`campaign.statistics`). Quantities are ranked
by the mutual information between their quintile and success, the largest over skills, which detects two-sided limits
too. The region of `theory` is drawn over both.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from skillframe.frames import Float
from skillframe_reports.markup import Markup, figure, tag
from skillframe_reports.quantities import ShownQuantity, quantity
from skillframe_reports.results import ResultRow, Results
from skillframe_reports.svg import Axes, Point, padded, picture, text
from skillframe_reports.theory import Region, boundary, mark

TRIALS_PER_CELL = 5
"""Trials that a cell should hold at least."""
CURVE_BINS = 8


def influence(results: Results) -> list[str]:
    """Return varied quantities with at least two known values, most influential first."""
    known = {name: values_of(results.rows, quantity(name)) for name in results.varied}
    drawn = [name for name, values in known.items() if len(np.unique(values[np.isfinite(values)])) > 1]
    scores = {name: max(_information(results.of(s), name) for s in results.skills) for name in drawn}
    return sorted(drawn, key=lambda name: (-round(scores[name], 9), drawn.index(name)))


def _information(rows: Sequence[ResultRow], name: str) -> float:
    """Mutual information [nat] between success and the quintile of a quantity."""
    values = np.array([row.values.get(name, math.nan) for row in rows])
    wins = np.array([row.success for row in rows])[np.isfinite(values)]
    values = values[np.isfinite(values)]
    if not len(values):
        return 0.0
    bins = np.searchsorted(np.unique(np.quantile(values, [0.2, 0.4, 0.6, 0.8])), values, side="left")
    total = 0.0
    for b in np.unique(bins):
        for outcome in (False, True):
            joint = float(np.mean((bins == b) & (wins == outcome)))
            apart = float(np.mean(bins == b) * np.mean(wins == outcome))
            total += joint * math.log(joint / apart) if joint > 0.0 else 0.0
    return total


def edges_of(values: Float, trials: int) -> Float:
    """Return cell borders (K + 1,): one cell per value if there are few, else equal widths."""
    unique = np.unique(values[np.isfinite(values)])
    if len(unique) <= 8:
        steps = np.diff(unique)
        return np.concatenate([[unique[0] - steps[0] / 2], unique[:-1] + steps / 2, [unique[-1] + steps[-1] / 2]])
    count = 2 * int(np.clip(math.sqrt(trials / TRIALS_PER_CELL) / 2, 1, 3)) + 1  # 3, 5 or 7, one in the middle
    return np.linspace(unique[0], unique[-1], count + 1)


def values_of(rows: Sequence[ResultRow], name: ShownQuantity) -> Float:
    """Return a quantity's values (n,) in display units."""
    return name.factor * np.array([row.values.get(name.name, math.nan) for row in rows])


def cell_map(results: Results, skill: str, names: Sequence[str], limits: Sequence[Region]) -> Markup:
    """Return the map of one skill over two quantities."""
    across, up = quantity(names[0]), quantity(names[1])
    everything, rows = list(results.rows), results.of(skill)
    xs, ys = edges_of(values_of(everything, across), len(rows)), edges_of(values_of(everything, up), len(rows))
    axes = Axes(width=460, height=400, x=(xs[0], xs[-1]), y=(ys[0], ys[-1]), x_label=across.axis, y_label=up.axis)
    rate = results.rate(skill)
    cells = [_cell(axes, results, rows, (across, up), x, y) for x in pairwise(xs) for y in pairwise(ys)]
    dots = [_dot(axes, x, y, r) for x, y, r in zip(values_of(rows, across), values_of(rows, up), rows, strict=True)]
    lines = [axes.frame(), *(boundary(axes, (across, up), limit) for limit in limits)]
    parts = [*(cell for cell, _ in cells), *lines, *dots, *(words for _, words in cells)]
    svg = picture(axes, f"Success of {skill} over {across.label} and {up.label}", *parts, class_="map")
    said = f"{rate.successes} of {rate.trials} trials succeeded: {results.said(rate)}."
    return figure(skill, said, svg, class_="plot")


def _cell(
    axes: Axes, results: Results, rows: Sequence[ResultRow], names: tuple[ShownQuantity, ShownQuantity],
    x: tuple[float, float], y: tuple[float, float],
) -> tuple[Markup, Markup]:  # fmt: skip
    inside = [r for r in rows if _within(r, names[0], x, axes.x) and _within(r, names[1], y, axes.y)]
    left, right, low, high = axes.across(x[0]), axes.across(x[1]), axes.up(y[0]), axes.up(y[1])
    box = {"x": f"{left:.1f}", "y": f"{high:.1f}", "width": f"{right - left:.1f}", "height": f"{low - high:.1f}"}
    if not inside:
        return tag("rect", tag("title", "no trials"), **box, class_="cell empty"), Markup("")
    rate, middle = results.rate_of(inside), (0.5 * (left + right), 0.5 * (low + high))
    color = shade(rate.share)
    words = [text(middle[0], middle[1], f"{rate.successes}/{rate.trials}", "count", "middle")]
    if rate.interval is not None:
        span = f"{100 * rate.interval.low:.0f}–{100 * rate.interval.high:.0f} %"
        words.append(text(middle[0], middle[1] + 11, span, "span", "middle"))
    tip = f"{rate.successes} of {rate.trials}, {results.said(rate)}"
    return tag("rect", tag("title", tip), **box, class_="cell", fill=color), tag(
        "g", *words, stroke=color, class_="halo"
    )


def _within(row: ResultRow, name: ShownQuantity, cell: tuple[float, float], whole: tuple[float, float]) -> bool:
    value = name.factor * row.values.get(name.name, math.nan)
    return bool(cell[0] <= value < cell[1] or (value == whole[1] == cell[1]))


def shade(share: float) -> str:
    """Return the colour of a success share, from orange (fails) to blue (works), readable without colour vision."""
    fails, between, works = np.array([[224, 132, 80], [244, 240, 232], [98, 162, 216]])
    low, high, t = (fails, between, 2 * share) if share < 0.5 else (between, works, 2 * share - 1)
    r, g, b = (round(float(v)) for v in low + t * (high - low))
    return f"#{r:02x}{g:02x}{b:02x}"


def _dot(axes: Axes, x: float, y: float, row: ResultRow) -> Markup:
    if not (math.isfinite(x) and math.isfinite(y)):
        return Markup("")
    px, py = float(axes.across(x)), float(axes.up(y))
    title = tag("title", f"trial {row.trial}: {'success' if row.success else row.failure or 'failure'}")
    if row.success:
        return tag("circle", title, cx=f"{px:.1f}", cy=f"{py:.1f}", r=2.2, class_="won")
    return tag("path", title, d=f"M{px - 2.6:.1f} {py - 2.6:.1f}l5.2 5.2m0 -5.2l-5.2 5.2", class_="lost")


def rate_curves(results: Results, name: str, limits: Sequence[Region]) -> Markup:
    """Return success curves over one quantity for all skills, with an interval per bin."""
    across = quantity(name)
    values = values_of(list(results.rows), across)
    borders = edges_of(values, TRIALS_PER_CELL * CURVE_BINS**2)
    axes = Axes(x=padded(borders[0], borders[-1], 0.02), y=(-4.0, 104.0), x_label=across.axis, y_label="success [%]")
    parts = [axes.frame(y_ticks=[0, 25, 50, 75, 100])]
    parts += [mark(axes, across, limit) for limit in limits if limit.name == name]
    for index, skill in enumerate(results.skills):
        rows, points = results.of(skill), list[Point]()
        shift = (index - 0.5) * 0.06 * (borders[1] - borders[0])  # so that skills do not cover each other
        for x in pairwise(borders):
            inside = [r for r in rows if _within(r, across, x, (borders[0], borders[-1]))]
            if inside:
                rate = results.rate_of(inside)
                span = rate.interval and (100 * rate.interval.low, 100 * rate.interval.high)
                tip = f"{rate.successes} of {rate.trials}, {rate.span or 'no interval'}"
                points.append((0.5 * (x[0] + x[1]) + shift, 100 * rate.share, span, tip))
        parts.append(axes.series(points, f"s{index % 4 + 1}") if points else Markup(""))
    svg = picture(axes, f"Success over {across.label}", *parts)
    return figure(f"Over {across.label}", "", svg, class_="plot")

"""The map of a question: where trials are predicted to succeed, how sure, the certified box and the breaking point.

Its axes are the two quantities of the largest index; others are cut at the middle of the certified box, or at their
nominal values. Shades are a guess by the surrogate, never a rate: the trials behind it were picked.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import groupby

import numpy as np

from skillframe.campaign.claims.rounds import BORDER
from skillframe.campaign.claims.searches import BREAK
from skillframe.campaign.claims.surrogate import Surrogate
from skillframe.frames import Float
from skillframe.reports.asked import Asked
from skillframe.reports.markup import Markup, figure, join, note, number, percent, tag
from skillframe.reports.quantities import quantity
from skillframe.reports.svg import Axes, picture
from skillframe.reports.theory import Region, boundary, said

CELLS = 60
OVERLAP = 0.4
"""Of rows of cells, so that no seam shows between them."""
SHADES = ("fails", "unsure", "holds")
UNSURE = 0.674489750196082
"""Quantile of 75 % of the normal distribution: the guess gives success between 25 and 75 % inside the band (ours)."""


def border_map(asked: Asked, theory: Sequence[Region] = ()) -> Markup:
    """The map with its caption, or a sentence where there is nothing to draw.

    Args:
        asked: the question.
        theory: regions in which closed-form theory says that it works.
    """
    surrogate = asked.surrogate()
    if surrogate is None:
        how = "succeeded" if len(asked.works) and asked.works.all() else "failed"
        return note(f"All {len(asked.works)} trials that were looked at {how}, so there is no border to draw.")
    if len(asked.names) < 2:
        return note("One quantity varied, so there is no map.")
    across, up = asked.ranked(surrogate)[:2]
    x, y = (quantity(asked.names[i]) for i in (across, up))
    ends = [asked.question.ranges[asked.names[i]] for i in (across, up)]
    axes = Axes(
        width=460, height=330, x=_shown(ends[0], x.factor), y=_shown(ends[1], y.factor), x_label=x.axis, y_label=y.axis,
        top=26.0,
    )  # fmt: skip
    cut = _cut(asked)
    drawn = picture(
        axes, "Where trials are predicted to succeed", _shades(axes, surrogate, cut, across, up), axes.frame(),
        join(boundary(axes, (x, y), region) for region in theory), _dots(axes, asked, across, up),
        _box(axes, asked, across, up), _breaking(axes, asked, across, up),
        class_="border-map",
    )  # fmt: skip
    shown = [region for region in theory if region.name in (x.name, y.name)]
    return figure("", _caption(asked, cut, across, up, shown), drawn, class_="plot")


def _shown(ends: tuple[float, float], factor: float) -> tuple[float, float]:
    return ends[0] * factor, ends[1] * factor


def _cut(asked: Asked) -> Float:
    """(d,) scaled values of the quantities that the map does not show."""
    at = box_of(asked)
    middle = {name: 0.5 * (low + high) for name, (low, high) in at.items()} if at else {}
    nominal = asked.found.get(BREAK, {}).get("nominal", {})
    whole = {name: 0.5 * (low + high) for name, (low, high) in asked.question.ranges.items()}
    result: Float = asked.question.scaled({**whole, **nominal, **middle})[0]
    return result


def box_of(asked: Asked) -> Mapping[str, tuple[float, float]]:
    """The certified box, else the one that was claimed, in SI."""
    certified = (asked.predicate or {}).get("box")
    claimed = asked.claim["boxes"][-1] if asked.claim else {}
    return {name: (float(low), float(high)) for name, (low, high) in (certified or claimed).items()}


def _shades(axes: Axes, surrogate: Surrogate, cut: Float, across: int, up: int) -> Markup:
    """A shape for each shade, a row of cells at a time."""
    centres = (np.arange(CELLS) + 0.5) * 2.0 / CELLS - 1.0
    points = np.tile(cut, (CELLS * CELLS, 1))
    points[:, up], points[:, across] = np.repeat(centres, CELLS), np.tile(centres, CELLS)
    mean, spread = surrogate.mean(points), surrogate.deviation(points)
    kinds = np.where(np.abs(mean) < UNSURE * spread, 1, np.where(mean > 0.0, 2, 0)).reshape(CELLS, CELLS)
    width, height = (axes.right - axes.across(axes.x[0])) / CELLS, (axes.bottom - axes.top) / CELLS
    shapes = ["", "", ""]
    for row, line in enumerate(kinds):
        column = 0
        for kind, run in groupby(line.tolist()):
            count = len(list(run))
            left, top = axes.across(axes.x[0]) + column * width, axes.bottom - (row + 1) * height
            wide, high = count * width, height + OVERLAP
            shapes[kind] += f"M{left:.1f} {top:.1f}h{wide:.1f}v{high:.1f}h{-wide:.1f}z"
            column += count
    return join(tag("path", d=d, class_=f"shade {SHADES[kind]}") for kind, d in enumerate(shapes) if d)


def _place(axes: Axes, asked: Asked, point: Float, across: int, up: int) -> tuple[float, float]:
    """Where a scaled point lies in the picture."""
    x = axes.x[0] + (point[across] + 1.0) / 2.0 * (axes.x[1] - axes.x[0])
    y = axes.y[0] + (point[up] + 1.0) / 2.0 * (axes.y[1] - axes.y[0])
    return round(float(axes.across(x)), 1), round(float(axes.up(y)), 1)


def _dots(axes: Axes, asked: Asked, across: int, up: int) -> Markup:
    parts = []
    for point, works in zip(asked.points, asked.works, strict=True):
        x, y = _place(axes, asked, point, across, up)
        parts.append(tag("circle", cx=x, cy=y, r=1.8, class_="looked won" if works else "looked lost"))
    return join(parts)


def _box(axes: Axes, asked: Asked, across: int, up: int) -> Markup:
    box = box_of(asked)
    if not box:
        return Markup("")
    low, high = (asked.question.scaled({name: ends[i] for name, ends in box.items()})[0] for i in (0, 1))
    left, bottom = _place(axes, asked, low, across, up)
    right, top = _place(axes, asked, high, across, up)
    certified = bool((asked.predicate or {}).get("box"))
    kind = "box" if certified else "box claimed"
    return tag("rect", x=left, y=top, width=round(right - left, 1), height=round(bottom - top, 1), class_=kind)


def _breaking(axes: Axes, asked: Asked, across: int, up: int) -> Markup:
    found = asked.found.get(BREAK, {})
    if not found.get("confirmed"):
        return Markup("")
    x, y = _place(axes, asked, asked.question.scaled(found["point"])[0], across, up)
    ox, oy = _place(axes, asked, asked.question.scaled(found["nominal"])[0], across, up)
    return join([
        tag("line", x1=ox, y1=oy, x2=x, y2=y, class_="to-break"),
        tag("path", d=f"M{x - 5} {y - 5}L{x + 5} {y + 5}M{x - 5} {y + 5}L{x + 5} {y - 5}", class_="break"),
    ])  # fmt: skip


def _caption(asked: Asked, cut: Float, across: int, up: int, theory: Sequence[Region]) -> Markup:
    rest = [i for i in range(len(asked.names)) if i not in (across, up)]
    at = asked.question.in_si(cut)
    shown = [(quantity(asked.names[i]), at[i]) for i in rest]
    held = [f"{q.label} {number(q.factor * value)} {q.unit}".strip() for q, value in shown]
    picked = "many of them picked near the border" if asked.found.get(BORDER) else "spread evenly and no sample"
    parts: list[object] = [
        tag("span", "", class_="swatch holds"), " predicted to succeed, ", tag("span", "", class_="swatch fails"),
        " to fail, ", tag("span", "", class_="swatch unsure"), " as likely as not (25 to 75 %). Dots: trials that "
        f"were looked at, {picked}, so no rate may be read from them. ",
    ]  # fmt: skip
    parts += ["Outline: the certified box. "] if (asked.predicate or {}).get("box") else []
    parts += ["Dashed: the box that was claimed. "] if asked.claim and not (asked.predicate or {}).get("box") else []
    parts += ["Cross: the smallest disturbance found. "] if asked.found.get(BREAK, {}).get("confirmed") else []
    parts += [f"Dashed line: closed-form theory says that it works within {said(r)}. " for r in theory]
    parts += [f"The axes matter most; the cut is at {', '.join(held)}. "] if held else []
    found = asked.found.get(BORDER)
    if found:
        parts.append(f"Islands below {percent(float(found['smallest_island']))} of the ranges may have been missed.")
    return join(parts)

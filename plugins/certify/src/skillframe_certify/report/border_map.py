"""Map of predicted success with its uncertainty, the certified box and the breaking point.

The axes are the two quantities with the largest indices; the others are at the middle of the certified box, or nominal.
Shades are predictions, not rates, since the trials were picked.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import groupby

import numpy as np
from skillframe_reports.markup import Markup, figure, join, note, number, percent, tag
from skillframe_reports.quantities import quantity
from skillframe_reports.svg import Axes, picture
from skillframe_reports.theory import Region, boundary, said

from skillframe.frames import Float
from skillframe_certify.report.answers import Asked
from skillframe_certify.rounds import BORDER
from skillframe_certify.searches import BREAK

SHADES = ("fails", "unsure", "holds")


def border_map(asked: Asked, theory: Sequence[Region] = ()) -> Markup:
    """Return the map with its caption, or a sentence if there is nothing to draw."""
    surrogate = asked.surrogate()
    if surrogate is None:
        how = "succeeded" if len(asked.works) and asked.works.all() else "failed"
        return note(f"All {len(asked.works)} exploratory trials {how}, so there is no border to draw.")
    if len(asked.names) < 2:
        return note("One quantity varied, so there is no map.")
    certified = bool((asked.predicate or {}).get("box"))
    across, up = asked.ranked(surrogate)[:2]
    x, y = (quantity(asked.names[i]) for i in (across, up))
    ends = [asked.question.ranges[asked.names[i]] for i in (across, up)]
    axes = Axes(
        width=460, height=330, top=26.0, x_label=x.axis, y_label=y.axis,
        x=(ends[0][0] * x.factor, ends[0][1] * x.factor), y=(ends[1][0] * y.factor, ends[1][1] * y.factor),
    )  # fmt: skip
    at = box_of(asked)
    middle = {name: 0.5 * (low + high) for name, (low, high) in at.items()} if at else {}
    nominal = asked.found.get(BREAK, {}).get("nominal", {})
    whole = {name: 0.5 * (low + high) for name, (low, high) in asked.question.ranges.items()}
    cut: Float = asked.question.scaled({**whole, **nominal, **middle})[0]
    cells = 60  # along each side
    centres = (np.arange(cells) + 0.5) * 2.0 / cells - 1.0
    points = np.tile(cut, (cells * cells, 1))
    points[:, up], points[:, across] = np.repeat(centres, cells), np.tile(centres, cells)
    mean, spread = surrogate.mean(points), surrogate.deviation(points)
    unsure = 0.674489750196082 * spread  # the predicted success is between 25 and 75 %
    kinds = np.where(np.abs(mean) < unsure, 1, np.where(mean > 0.0, 2, 0)).reshape(cells, cells)
    width, height = (axes.right - axes.across(axes.x[0])) / cells, (axes.bottom - axes.top) / cells
    shapes = ["", "", ""]
    for row, line in enumerate(kinds):
        column = 0
        for kind, run in groupby(line.tolist()):
            count = len(list(run))
            left, top = axes.across(axes.x[0]) + column * width, axes.bottom - (row + 1) * height
            wide, high = count * width, height + 0.4  # rows overlap, which hides seams
            shapes[kind] += f"M{left:.1f} {top:.1f}h{wide:.1f}v{high:.1f}h{-wide:.1f}z"
            column += count
    shades = [tag("path", d=d, class_=f"shade {SHADES[kind]}") for kind, d in enumerate(shapes) if d]
    parts = []
    for point, works in zip(asked.points, asked.works, strict=True):
        px, py = _place(axes, asked, point, across, up)
        parts.append(tag("circle", cx=px, cy=py, r=1.8, class_="looked won" if works else "looked lost"))
    if box := box_of(asked):
        low, high = (asked.question.scaled({name: ends[i] for name, ends in box.items()})[0] for i in (0, 1))
        (left, bottom), (right, top) = (_place(axes, asked, end, across, up) for end in (low, high))
        size = {"width": round(right - left, 1), "height": round(bottom - top, 1)}
        parts.append(tag("rect", x=left, y=top, **size, class_="box" if certified else "box claimed"))
    found = asked.found.get(BREAK, {})
    if found.get("confirmed"):
        bx, by = _place(axes, asked, asked.question.scaled(found["point"])[0], across, up)
        ox, oy = _place(axes, asked, asked.question.scaled(found["nominal"])[0], across, up)
        parts.append(tag("line", x1=ox, y1=oy, x2=bx, y2=by, class_="to-break"))
        cross = f"M{bx - 5} {by - 5}L{bx + 5} {by + 5}M{bx - 5} {by + 5}L{bx + 5} {by - 5}"
        parts.append(tag("path", d=cross, class_="break"))
    drawn = picture(
        axes, "Where trials are predicted to succeed", join(shades), axes.frame(),
        join(boundary(axes, (x, y), region) for region in theory), join(parts),
        class_="border-map",
    )  # fmt: skip
    shown = [region for region in theory if region.name in (x.name, y.name)]
    return figure("", _caption(asked, cut, across, up, shown), drawn, class_="plot")


def box_of(asked: Asked) -> Mapping[str, tuple[float, float]]:
    """Return the certified box, else the claimed one, in SI."""
    certified = (asked.predicate or {}).get("box")
    claimed = asked.claim["boxes"][-1] if asked.claim else {}
    return {name: (float(low), float(high)) for name, (low, high) in (certified or claimed).items()}


def _place(axes: Axes, asked: Asked, point: Float, across: int, up: int) -> tuple[float, float]:
    x = axes.x[0] + (point[across] + 1.0) / 2.0 * (axes.x[1] - axes.x[0])
    y = axes.y[0] + (point[up] + 1.0) / 2.0 * (axes.y[1] - axes.y[0])
    return round(float(axes.across(x)), 1), round(float(axes.up(y)), 1)


def _caption(asked: Asked, cut: Float, across: int, up: int, theory: Sequence[Region]) -> Markup:
    rest = [i for i in range(len(asked.names)) if i not in (across, up)]
    at = asked.question.in_si(cut)
    shown = [(quantity(asked.names[i]), at[i]) for i in rest]
    held = [f"{q.label} {number(q.factor * value)} {q.unit}".strip() for q, value in shown]
    picked = "many of them picked near the border" if asked.found.get(BORDER) else "spread evenly"
    parts: list[object] = [
        tag("span", "", class_="swatch holds"), " predicted to succeed, ", tag("span", "", class_="swatch fails"),
        " to fail, ", tag("span", "", class_="swatch unsure"), " as likely as not (25 to 75 %). Dots: "
        f"exploratory trials before the claim, {picked}. They are no random sample and give no success rate. ",
    ]  # fmt: skip
    parts += ["Outline: the certified box. "] if (asked.predicate or {}).get("box") else []
    parts += ["Dashed: the box that was claimed. "] if asked.claim and not (asked.predicate or {}).get("box") else []
    parts += ["Cross: the smallest disturbance found. "] if asked.found.get(BREAK, {}).get("confirmed") else []
    parts += [
        f"Dashed line: by closed-form theory a push along the task's own direction succeeds within {said(r)}; one that "
        "is off by an angle shifts this. "
        for r in theory
    ]
    parts += [f"The axes matter most; the cut is at {', '.join(held)}. "] if held else []
    found = asked.found.get(BORDER)
    if found:
        parts.append(f"Islands below {percent(float(found['smallest_island']))} of the ranges may have been missed.")
    return join(parts)

"""Region of success by closed-form theory, drawn over simulated results.

A scene file's `analytic` holds limits at the nominal parameters by varied quantity (|quantity| stays below) or as
`largest_tilt_rad` (tilts about y). `analytic_over` holds them along a varied world parameter, {"world.friction":
{"values": [...], "largest_tilt_rad": [...]}}, which gives a curve.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from skillframe.frames import Float
from skillframe_reports.markup import Markup, escape, join, number, tag
from skillframe_reports.quantities import ShownQuantity, quantity
from skillframe_reports.svg import Axes

TILT_LIMIT = "largest_tilt_rad"


class Region(NamedTuple):
    """Predicted success while |quantity| stays below the limit.

    Attributes:
        name: of the quantity.
        limit: at the nominal parameters, in the units of the file.
        over: limits along varied parameters: name to (values (n,), limits (n,)).
    """

    name: str
    limit: float
    over: dict[str, tuple[Float, Float]]


def regions(scene: Mapping[str, Any], varied: Sequence[str]) -> list[Region]:
    """Return the predicted regions of varied quantities."""
    analytic = scene.get("analytic")
    found = []
    for key, value in sorted(analytic.items() if isinstance(analytic, Mapping) else ()):
        if isinstance(value, int | float) and math.isfinite(value):
            names = [n for n in varied if n == key or (key == TILT_LIMIT and n.endswith(".tilt_y"))]
            found += [Region(name, float(value), _along(scene, key, varied)) for name in names]
    return found


def _along(scene: Mapping[str, Any], key: str, varied: Sequence[str]) -> dict[str, tuple[Float, Float]]:
    tables = scene.get("analytic_over")
    result = {}
    for name, table in tables.items() if isinstance(tables, Mapping) else ():
        if name in varied and isinstance(table, Mapping) and key in table and len(table[key]) == len(table["values"]):
            result[name] = (np.array(table["values"], dtype=float), np.array(table[key], dtype=float))
    return result


def boundary(axes: Axes, names: tuple[ShownQuantity, ShownQuantity], region: Region) -> Markup:
    """Return a region's border on a map: a curve if it depends on the other quantity, else straight lines."""
    for index, name in enumerate(names):
        other = names[1 - index]
        if name.name == region.name and other.name in region.over:
            return join(_curve(axes, other, name, region, sign, across=index == 0) for sign in (-1.0, 1.0))
        if name.name == region.name:
            limits = (-region.limit * name.factor, region.limit * name.factor)
            line = axes.vertical if index == 0 else axes.horizontal
            return join(line(limit, "theory") for limit in limits if axes.inside(limit, vertical=index == 1))
    return Markup("")


def _curve(
    axes: Axes, other: ShownQuantity, name: ShownQuantity, region: Region, sign: float, *, across: bool
) -> Markup:
    values, limits = region.over[other.name]
    along, limit = other.factor * values, sign * name.factor * np.maximum(limits, 0.0)
    x, y = (limit, along) if across else (along, limit)
    inside = (x >= axes.x[0]) & (x <= axes.x[1]) & (y >= axes.y[0]) & (y <= axes.y[1])
    return axes.line(np.where(inside, x, np.nan), y, "theory")


def mark(axes: Axes, name: ShownQuantity, region: Region) -> Markup:
    """Return a region's border on its own axis: lines, or bands if it depends on another quantity."""
    if not region.over:
        ends = (sign * region.limit * name.factor for sign in (-1.0, 1.0))
        return join(axes.vertical(end, "theory") for end in ends if axes.inside(end, vertical=False))
    limits = name.factor * np.maximum(np.concatenate([limits for _, limits in region.over.values()]), 0.0)
    bands = []
    for sign in (-1.0, 1.0):
        first, second = sign * float(limits.min()), sign * float(limits.max())
        low, high = max(min(first, second), axes.x[0]), min(max(first, second), axes.x[1])
        if low < high:
            left, right = round(float(axes.across(low)), 1), round(float(axes.across(high)), 1)
            place = {"x": left, "y": axes.top, "width": round(right - left, 1), "height": axes.bottom - axes.top}
            bands.append(tag("rect", **place, class_="theory-band"))
    return join(bands)


def theory_sentence(found: Sequence[Region], varied: Sequence[str]) -> Markup:
    """Return a sentence on the dashed lines."""
    if not found:
        return Markup("")
    regions = "; ".join(map(said, found))
    text = (
        " Dashed: closed-form theory predicts that a compliant push along the task's own direction succeeds from any "
        f"start within {regions}"
    )
    worlds = [n for n in varied if n.startswith("world.") and not any(n in region.over for region in found)]
    nominal = f" (at the nominal {', '.join(quantity(n).label for n in worlds)}, which varied)" if worlds else ""
    return tag(
        "p", tag("span", class_="key theory-key"), escape(f"{text}{nominal}; beyond it, some starts may succeed.")
    )


def said(region: Region) -> str:
    """Return a region in words."""
    q = quantity(region.name)
    limit = f"|{q.label}| < {number(region.limit * q.factor)} {q.unit}".strip()
    over = ", ".join(quantity(name).label for name in region.over)
    return (
        f"{limit} at the nominal {over} and changing with it (a band where only one quantity is shown)"
        if over
        else limit
    )

"""Curves of a demonstration in lanes over one time axis, as wide as the window.

Curves stretch with the page; axis labels are HTML and do not.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.demonstration import Demonstration
from skillframe.extend import Curve
from skillframe.frames import Float, norm
from skillframe_reports.markup import Markup, join, number, tag
from skillframe_reports.plots import LEAST_RANGE, components, doubted, shades, turned
from skillframe_reports.svg import BOTTOM, LEFT, RIGHT, TOP, Axes, envelope, padded, ticks


class Lane(NamedTuple):
    """A lane: title, unit, curves, and doubtful samples (T,)."""

    title: str
    unit: str
    curves: Sequence[Curve]
    doubtful: NDArray[np.bool_] | None = None


def velocity_of(demonstration: Demonstration) -> Float:
    """Return mean velocities (T, 3) of the tool point over 50 ms [m/s], in base."""
    time = demonstration.time
    ahead, back = (np.clip(time + half, time[0], time[-1]) for half in (0.025, -0.025))
    steps = [np.interp(ahead, time, x) - np.interp(back, time, x) for x in demonstration.position.T]
    result: Float = np.stack(steps, axis=1) / (ahead - back)[:, None]
    return result


def lanes_of(demonstration: Demonstration) -> list[Markup]:
    """Return lanes of position, orientation, speed, force and torque."""
    moved = 1e3 * (demonstration.position - demonstration.position[0])
    turn = turned(demonstration.quaternion, demonstration.quaternion[:1])
    speed, force, torque = 1e3 * velocity_of(demonstration), demonstration.wrench[:, :3], demonstration.wrench[:, 3:]
    unsure = doubted(demonstration.extra)
    lanes = [
        Lane("Position", "mm", components(moved, "")),
        Lane("Orientation", "°", components(turn, "")),
        Lane("Speed", "mm/s", [*components(speed, "thin"), _size("|v|", speed)]),
        Lane("Force", "N", [*components(force, "thin"), _size("|F|", force)], unsure),
        Lane("Torque", "Nm", [*components(torque, "thin"), _size("|T|", torque)], unsure),
    ]
    return [_drawn(lane, demonstration.time) for lane in lanes]


def _size(name: str, values: Float) -> Curve:
    return Curve(name=name, values=norm(values), stroke="line ink")


def _drawn(lane: Lane, time: Float) -> Markup:
    values = np.concatenate([c.values[np.isfinite(c.values)] for c in lane.curves])
    ends = (float(values.min()), float(values.max())) if len(values) else (math.nan, math.nan)
    wide, tall = 1000.0, 100.0  # of a lane in its own units, which the page stretches
    axes = Axes(
        width=LEFT + wide + RIGHT, height=TOP + tall + BOTTOM, x=(float(time[0]), float(time[-1])),
        y=padded(*ends, least=LEAST_RANGE.get(lane.unit, 1.0)),
    )  # fmt: skip
    marks = [v for v in ticks(*axes.y, 4) if axes.inside(v)]
    curves = [axes.line(*envelope(time, c.values, 320), c.stroke) for c in lane.curves]
    grid = [axes.horizontal(v, "zero" if v == 0 else "grid") for v in marks]
    drawing = tag(
        "svg", tag("title", f"{lane.title} over time"), *grid, shades(axes, time, lane.doubtful), *curves, role="img",
        viewbox=f"{LEFT:g} {TOP:g} {wide:g} {tall:g}", preserveAspectRatio="none",
    )  # fmt: skip
    below = [100.0 * (axes.up(v) - axes.top) / (axes.bottom - axes.top) for v in marks]  # from the lane's top [%]
    beside = [tag("span", number(v), class_="mark", style=f"top:{s:.2f}%") for v, s in zip(marks, below, strict=True)]
    names = [tag("span", tag("i", class_=f"key {c.stroke.split()[1]}"), c.name) for c in lane.curves]
    title = tag("p", tag("strong", lane.title), f" [{lane.unit}]", *names, class_="names")
    return tag("div", title, tag("div", drawing, *beside, class_="drawing"), class_="lane")


def axis(first: float, last: float) -> Markup:
    """Return the time axis in the recording's seconds."""
    marks = [
        tag("span", f"{t + 0.0:.12g}", style=f"left:{100.0 * (t - first) / (last - first):.3f}%")
        for t in ticks(first, last, 7)
    ]
    return tag("div", join(marks), tag("em", "[s]"), class_="axis")

"""Curves of a demonstration over one time axis, one lane below the other, as wide as the window.

Curves stretch with the page and their letters do not: figures at the axes are HTML beside the drawing.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.demonstration.record import Demonstration
from skillframe.frames import Float, norm
from skillframe.reports.markup import Markup, join, number, tag
from skillframe.reports.plots import LEAST_RANGE, Curve, components, doubted, shades, turned
from skillframe.reports.svg import BOTTOM, LEFT, RIGHT, TOP, Axes, envelope, padded, ticks

WIDE, TALL = 1000.0, 100.0
"""Of a lane in its own units, which the page stretches."""
MOST_POINTS = 320
SPEED_OVER_S = 0.05


class Lane(NamedTuple):
    """One lane: what it shows, in which unit, its curves, and which samples (T,) are doubtful."""

    title: str
    unit: str
    curves: Sequence[Curve]
    doubtful: NDArray[np.bool_] | None = None


def velocity_of(demonstration: Demonstration) -> Float:
    """Mean velocities (T, 3) of the tool point over 50 ms around every sample [m/s], in base."""
    time = demonstration.time
    ahead, back = (np.clip(time + half, time[0], time[-1]) for half in (0.5 * SPEED_OVER_S, -0.5 * SPEED_OVER_S))
    steps = [np.interp(ahead, time, x) - np.interp(back, time, x) for x in demonstration.position.T]
    result: Float = np.stack(steps, axis=1) / (ahead - back)[:, None]
    return result


def lanes_of(demonstration: Demonstration) -> list[Markup]:
    """Position, attitude, speed, force and torque of a demonstration."""
    moved = 1e3 * (demonstration.position - demonstration.position[0])
    turn = turned(demonstration.quaternion, demonstration.quaternion[:1])
    speed, force, torque = 1e3 * velocity_of(demonstration), demonstration.wrench[:, :3], demonstration.wrench[:, 3:]
    unsure = doubted(demonstration.extra)
    lanes = [
        Lane("Position", "mm", components(moved, "")),
        Lane("Attitude", "°", components(turn, "")),
        Lane("Speed", "mm/s", [*components(speed, "thin"), _size("|v|", speed)]),
        Lane("Force", "N", [*components(force, "thin"), _size("|F|", force)], unsure),
        Lane("Torque", "Nm", [*components(torque, "thin"), _size("|T|", torque)], unsure),
    ]
    return [_drawn(lane, demonstration.time) for lane in lanes]


def _size(name: str, values: Float) -> Curve:
    return Curve(name=name, values=norm(values), stroke="line ink")


def _drawn(lane: Lane, time: Float) -> Markup:
    axes = Axes(
        width=LEFT + WIDE + RIGHT, height=TOP + TALL + BOTTOM, x=(float(time[0]), float(time[-1])), y=_range(lane)
    )
    marks = [v for v in ticks(*axes.y, 4) if axes.inside(v)]
    curves = [axes.line(*envelope(time, c.values, MOST_POINTS), c.stroke) for c in lane.curves]
    grid = [_grid(axes, value) for value in marks]
    drawing = tag(
        "svg", tag("title", f"{lane.title} over time"), *grid, shades(axes, time, lane.doubtful), *curves, role="img",
        viewbox=f"{LEFT:g} {TOP:g} {WIDE:g} {TALL:g}", preserveAspectRatio="none",
    )  # fmt: skip
    beside = [tag("span", number(v), class_="mark", style=f"top:{_share(axes, v):.2f}%") for v in marks]
    names = [tag("span", tag("i", class_=f"key {c.stroke.split()[1]}"), c.name) for c in lane.curves]
    title = tag("p", tag("strong", lane.title), f" [{lane.unit}]", *names, class_="names")
    return tag("div", title, tag("div", drawing, *beside, class_="drawing"), class_="lane")


def _range(lane: Lane) -> tuple[float, float]:
    values = np.concatenate([c.values[np.isfinite(c.values)] for c in lane.curves])
    if not len(values):
        return 0.0, 1.0
    return padded(float(values.min()), float(values.max()), least=LEAST_RANGE.get(lane.unit, 1.0))


def _grid(axes: Axes, value: float) -> Markup:
    y = round(float(axes.up(value)), 1)
    return tag("line", x1=LEFT, x2=axes.right, y1=y, y2=y, class_="zero" if value == 0 else "grid")


def _share(axes: Axes, value: float) -> float:
    """How far below the lane's top a value lies [%]."""
    return float(100.0 * (axes.up(value) - axes.top) / (axes.bottom - axes.top))


def axis(first: float, last: float) -> Markup:
    """The time axis below the lanes, in seconds as they stand in the recording."""
    marks = [
        tag("span", f"{t + 0.0:.12g}", style=f"left:{100.0 * (t - first) / (last - first):.3f}%")
        for t in ticks(first, last, 7)
    ]
    return tag("div", join(marks), tag("em", "[s]"), class_="axis")

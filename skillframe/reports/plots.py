"""Plots over time of a run and of a demonstration: force, torque, motion, wanted against measured.

Forces are those of the environment on the tool in base axes; positions are relative to the start, in millimetres;
attitudes are rotation vectors from the start, in degrees (readable up to half a turn).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skillframe.demonstration.record import Demonstration
from skillframe.execution.trace import Trace
from skillframe.frames import Float, matrix_from_quaternion, norm, rotation_vector
from skillframe.reports.markup import Markup, figure, join, tag
from skillframe.reports.svg import LEFT, Axes, envelope, legend, padded, picture, text

AXES = ("x", "y", "z")
LEAST_RANGE = {"N": 1.0, "Nm": 0.05, "mm": 0.5, "°": 0.5, "bar": 1.0, "%": 1.0, "kN": 0.1, "kJ": 0.01}
MOST_EVENTS = 12
CONTACT_N = 0.5
LABEL_GAP, LIMIT_GAP = 12.0, 24.0
AFTER = 0.01
HEADROOM = 0.06
"""Share of a plot's height that is left above the curves, for the numbers of events."""
FORCE_CAPTION = (
    "What the environment does to the tool, filtered: the controller's estimate. Limits are held against it and "
    "against the simulator's own force; x, y, z are the robot's base axes."
)
DOUBT_CAPTION = (
    "Shaded: the estimate is not valid. Fewer than two pistons have been sliding for long enough, and what holds those "
    "that stand is not known."
)
ESTIMATE_CAPTION = (
    "What the environment does to the tool, as estimated from the pressures; x, y, z are the robot's base axes. "
    + DOUBT_CAPTION
)
VALID = 0.5
"""`force_valid` is 1 where the estimate is valid; what a recording holds may have been resampled."""
SHORT_PEAK = 1.1
"""A peak of the simulator that exceeds what the trace holds by this factor is told beside the plot."""
POSITION_CAPTION = (
    "Of the centre of compliance, from the start. Dashed: asked for by the skill; where they part, the environment led."
)
ATTITUDE_CAPTION = "Turn since the start about x, y and z. Dashed: asked for."
TORQUE_CAPTION = "About the centre of compliance."


@dataclass(frozen=True, slots=True, kw_only=True)
class Curve:
    """One curve: its name for the legend (empty for none), its values (T,), the class of its stroke."""

    name: str
    values: Float
    stroke: str


def time_plot(
    title: str, unit: str, time: Float, curves: Sequence[Curve], *, caption: str = "",
    limit: float | None = None, events: Sequence[tuple[float, str]] = (), width: float = 460.0,
    shaded: NDArray[np.bool_] | None = None,
) -> Markup:  # fmt: skip
    """A plot over time, shaded where `shaded` (T,) is true. A limit is drawn when it is near enough to matter."""
    axes = Axes(
        width=width, x=_time_range(time), y=_value_range(curves, unit, limit), x_label="time [s]", y_label=f"[{unit}]"
    )
    names = [(c.name, c.stroke) for c in curves if c.name]
    content = [
        axes.frame(),
        shades(axes, time, shaded),
        *(axes.line(*envelope(time, c.values), c.stroke) for c in curves),
    ]
    content += [legend(axes, names), _limit_line(axes, limit, unit), _event_marks(axes, events), _cursor(axes)]
    svg = picture(axes, title, *content, class_="time", data_width=axes.width, data_left=LEFT, data_right=axes.right,
                  data_start=float(axes.x[0]), data_stop=float(axes.x[1]))  # fmt: skip
    return figure(title, caption, svg, class_="plot")


def _time_range(time: Float) -> tuple[float, float]:
    low, high = float(time[0]), float(time[-1])
    return (low, high) if high > low else (low, low + 1.0)


def _value_range(curves: Sequence[Curve], unit: str, limit: float | None) -> tuple[float, float]:
    values = np.concatenate([c.values[np.isfinite(c.values)] for c in curves])
    if not len(values):
        return 0.0, 1.0
    low, high = float(values.min()), float(values.max())
    if limit is not None and high > 0.5 * limit:
        high = max(high, limit)
    low, high = padded(low, high, least=LEAST_RANGE.get(unit, 1e-6))
    return low, high + HEADROOM * (high - low)


def shades(axes: Axes, time: Float, shaded: NDArray[np.bool_] | None) -> Markup:
    """A band over every stretch of samples that are to be shaded, each as long as its samples last."""
    if shaded is None or not np.any(shaded):
        return Markup("")
    edges = np.flatnonzero(np.diff(np.concatenate([[False], np.asarray(shaded, dtype=bool), [False]])))
    upto = np.append(time, time[-1])
    spans = [(axes.across(time[a]), axes.across(upto[b])) for a, b in zip(edges[::2], edges[1::2], strict=True)]
    tall = {"y": axes.top, "height": axes.bottom - axes.top, "class_": "doubtful"}
    return join([tag("rect", x=round(float(a), 1), width=round(float(b - a), 1), **tall) for a, b in spans])


def doubted(columns: Mapping[str, Float]) -> NDArray[np.bool_] | None:
    """(T,) where an estimated force is not valid, by a machine's or a recording's columns. None where none says so."""
    return columns["force_valid"] < VALID if "force_valid" in columns else None


def _limit_line(axes: Axes, limit: float | None, unit: str) -> Markup:
    if limit is None or not axes.inside(limit):
        return Markup("")
    y = float(axes.up(limit))
    line = tag("line", x1=LEFT, x2=axes.right, y1=round(y, 1), y2=round(y, 1), class_="limit")
    beside = y - 5 if y - axes.top > LIMIT_GAP else y + 12  # at the top stand the numbers of events
    return join([line, text(LEFT + 6, beside, f"limit {limit:g} {unit}", "limit-text", "start")])


def _event_marks(axes: Axes, events: Sequence[tuple[float, str]]) -> Markup:
    """Numbered lines at events. Numbers that would overlap are written together."""
    lines: list[Markup] = []
    labels: list[tuple[float, str]] = []
    first, last = axes.x
    for index, (told, what) in enumerate(events[:MOST_EVENTS], start=1):
        when = last if last < told < last + AFTER * (last - first) else told  # the end comes after the last sample
        if axes.inside(when, vertical=False):
            x = round(float(axes.across(when)), 1)
            tip = tag("title", f"{told:.2f} s: {what}")
            lines.append(tag("line", tip, x1=x, x2=x, y1=axes.top, y2=axes.bottom, class_="event"))
            gap = LABEL_GAP * (2 if x > axes.right - LABEL_GAP else 1)  # the last number stands before its line
            together = bool(labels) and x - labels[-1][0] < gap
            labels = (
                [*labels[:-1], (labels[-1][0], f"{labels[-1][1]}, {index}")] if together else [*labels, (x, f"{index}")]
            )
    return join([*lines, *(_event_label(axes, x, label) for x, label in labels)])


def _event_label(axes: Axes, x: float, label: str) -> Markup:
    at_edge = x + 6.0 * len(label) > axes.right
    return text(x - 3 if at_edge else x + 3, axes.top + 9, label, "event-text", "end" if at_edge else "start")


def _cursor(axes: Axes) -> Markup:
    return tag("line", x1=0, x2=0, y1=axes.top, y2=axes.bottom, class_="cursor")


def events_of(trace: Trace) -> list[tuple[float, str]]:
    """Events of a trace as (time [s], text), in order."""
    pairs = [e for e in trace.meta.get("events") or [] if isinstance(e, list | tuple) and len(e) == 2]
    told = [(float(when), str(what)) for when, what in pairs if isinstance(when, int | float)]
    return sorted(told or _read_off(trace))


def _read_off(trace: Trace) -> list[tuple[float, str]]:
    """What the curves themselves tell: first contact, highest force, the end."""
    time, force = np.asarray(trace.time, dtype=float), np.nan_to_num(norm(trace.wrench[:, :3]))
    touching = np.flatnonzero(np.nan_to_num(norm(trace.wrench_true[:, :3])) > CONTACT_N)
    events = [(float(time[touching[0]]), "first contact")] if len(touching) else []
    if force.max() > CONTACT_N:
        how = "estimated" if trace.estimated else "measured"
        events.append((float(time[np.argmax(force)]), f"highest {how} force, {force.max():.0f} N"))
    reason = str(trace.meta.get("reason") or trace.meta.get("failure") or "")
    return [*events, (float(time[-1]), f"the end: {reason}" if reason else "the end")]


def run_plots(trace: Trace, force_limit: float | None = None) -> list[Markup]:
    """Force, position, attitude and torque of a run. `force_limit` [N] is for a trace without its own.

    A hydraulic machine's estimate knows no torque, and its tool's attitude follows from the joints: both are left out.
    """
    time, events = np.asarray(trace.time, dtype=float), events_of(trace)
    limit = (trace.meta.get("limits") or {}).get("force_n", force_limit)
    true_size = Curve(name="in the simulator", values=norm(trace.wrench_true[:, :3]), stroke="line faint")
    size = Curve(name="|F|", values=norm(trace.wrench[:, :3]), stroke="line ink")
    origin, first = trace.position[0], trace.quaternion[:1]
    moved = _pairs(1e3 * (trace.desired_position - origin), 1e3 * (trace.position - origin))
    turns = _pairs(turned(trace.desired_quaternion, first), turned(trace.quaternion, first))
    plots = [
        time_plot("Contact force", "N", time, [true_size, *components(trace.wrench[:, :3], "thin"), size],
                  limit=None if limit is None else float(limit), events=events, shaded=doubted(trace.machine),
                  caption=(ESTIMATE_CAPTION if trace.estimated else FORCE_CAPTION) + _short_peak(trace)),
        time_plot("Position", "mm", time, moved, events=events, caption=POSITION_CAPTION),
        time_plot("Attitude", "°", time, turns, events=events, caption=ATTITUDE_CAPTION),
        time_plot("Contact torque", "Nm", time, components(trace.wrench[:, 3:], ""), events=events,
                  caption=TORQUE_CAPTION),
    ]  # fmt: skip
    return plots[:2] if trace.estimated else plots


def _short_peak(trace: Trace) -> str:
    """What is to be said of a peak between two samples of the trace."""
    peak, seen = trace.meta.get("peak_force_n"), float(np.nan_to_num(norm(trace.wrench_true[:, :3])).max())
    if not isinstance(peak, int | float) or len(trace.time) < 2:
        return ""
    if not SHORT_PEAK * max(seen, CONTACT_N) < peak < np.inf:
        return ""
    between = 1e3 * float(np.median(np.diff(trace.time)))
    return f" The simulator's peak of {peak:.0f} N lies between samples, which are {between:.0f} ms apart."


def demonstration_plots(demonstration: Demonstration) -> Markup:
    """Force, position and attitude of a demonstration."""
    time = demonstration.time - demonstration.time[0]
    moved = 1e3 * (demonstration.position - demonstration.position[0])
    turn = turned(demonstration.quaternion, demonstration.quaternion[:1])
    force, extra = demonstration.wrench[:, :3], demonstration.extra
    size = Curve(name="|F|", values=norm(force), stroke="line ink")
    return join([
        time_plot("Force", "N", time, [*components(force, "thin"), size], width=350, shaded=(unsure := doubted(extra)),
                  caption=DOUBT_CAPTION if unsure is not None and np.any(unsure) else ""),
        time_plot("Position", "mm", time, components(moved, ""), width=350),
        time_plot("Attitude", "°", time, components(turn, ""), width=350),
    ])  # fmt: skip


def turned(quaternion: Float, first: Float) -> Float:
    """Rotation vectors (T, 3) [degrees] from a first attitude (1, 4), in base axes."""
    start = matrix_from_quaternion(first)
    result: Float = np.degrees(rotation_vector(matrix_from_quaternion(quaternion) @ np.swapaxes(start, -1, -2)))
    return result


def components(values: Float, style: str) -> list[Curve]:
    """Curves of the components of vectors (T, 3), in the colours of x, y and z and in a further style."""
    return [Curve(name=n, values=values[:, i], stroke=f"line c{i + 1} {style}".strip()) for i, n in enumerate(AXES)]


def _pairs(wanted: Float, measured: Float) -> list[Curve]:
    dashed = [Curve(name="", values=wanted[:, i], stroke=f"line c{i + 1} dashed") for i in range(3)]
    return [*dashed, *components(measured, "")]

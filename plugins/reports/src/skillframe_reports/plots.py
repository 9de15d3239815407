"""Plots over time of a run: force, torque and motion.

Forces are the environment's on the tool in base axes. Positions are relative to the start [mm], orientations are
rotation vectors from the start [degrees], readable up to half a turn.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from skillframe.execution import Trace, force_source
from skillframe.extend import Curve, registry
from skillframe.frames import Float, matrix_from_quaternion, norm, rotation_vector
from skillframe_reports.markup import Markup, figure, join, tag
from skillframe_reports.svg import LEFT, Axes, envelope, legend, padded, picture, text

AXES = ("x", "y", "z")
LEAST_RANGE = {"N": 1.0, "Nm": 0.05, "mm": 0.5, "°": 0.5, "bar": 1.0, "%": 1.0, "kN": 0.1, "kJ": 0.01}
CONTACT_N = 0.5
"""Force above which the tool counts as touching [N]."""
FORCE_CAPTION = (
    "What the environment does to the tool, filtered: the controller's estimate. Limits are held against it and "
    "against the unfiltered force; x, y, z are the robot's base axes."
)
DOUBT_CAPTION = (
    "Shaded: the estimate is not valid. Fewer than two actuators have been moving for long enough, and what holds "
    "those that stand is not known."
)
ESTIMATE_CAPTION = (
    "What the environment does to the tool, as estimated from what the actuators measure; x, y, z are the robot's base "
    "axes. " + DOUBT_CAPTION
)
POSITION_CAPTION = (
    "Of the centre of compliance, from the start. Dashed: desired by the skill; where they differ, contact moved the "
    "tool."
)
ORIENTATION_CAPTION = "Turn since the start about x, y and z. Dashed: desired."
TORQUE_CAPTION = "About the centre of compliance."


def time_plot(
    title: str, unit: str, time: Float, curves: Sequence[Curve], *, caption: str = "",
    limit: float | None = None, events: Sequence[tuple[float, str]] = (), shaded: NDArray[np.bool_] | None = None,
) -> Markup:  # fmt: skip
    """Return a plot over time, shaded where `shaded` (T,) is true, with the limit if it is near."""
    low, high = float(time[0]), float(time[-1])
    axes = Axes(
        x=(low, high if high > low else low + 1.0), y=_value_range(curves, unit, limit),
        x_label="time [s]", y_label=f"[{unit}]",
    )  # fmt: skip
    names = [(c.name, c.stroke) for c in curves if c.name]
    content = [
        axes.frame(),
        shades(axes, time, shaded),
        *(axes.line(*envelope(time, c.values), c.stroke) for c in curves),
    ]
    content.append(legend(axes, names))
    if limit is not None and axes.inside(limit):
        y = float(axes.up(limit))
        beside = y - 5 if y - axes.top > 24.0 else y + 12  # the numbers of events are at the top
        said = text(LEFT + 6, beside, f"limit {limit:g} {unit}", "limit-text", "start")
        content += [axes.horizontal(limit, "limit"), said]
    content += [
        _event_marks(axes, events),
        tag("line", x1=0, x2=0, y1=axes.top, y2=axes.bottom, class_="cursor"),
    ]
    svg = picture(axes, title, *content, class_="time", data_width=axes.width, data_left=LEFT, data_right=axes.right,
                  data_start=float(axes.x[0]), data_stop=float(axes.x[1]))  # fmt: skip
    return figure(title, caption, svg, class_="plot")


def _value_range(curves: Sequence[Curve], unit: str, limit: float | None) -> tuple[float, float]:
    values = np.concatenate([c.values[np.isfinite(c.values)] for c in curves])
    if not len(values):
        return 0.0, 1.0
    low, high = float(values.min()), float(values.max())
    if limit is not None and high > 0.5 * limit:
        high = max(high, limit)
    low, high = padded(low, high, least=LEAST_RANGE.get(unit, 1e-6))
    return low, high + 0.06 * (high - low)  # room for the numbers of events


def shades(axes: Axes, time: Float, shaded: NDArray[np.bool_] | None) -> Markup:
    """Return bands over the shaded samples."""
    if shaded is None or not np.any(shaded):
        return Markup("")
    edges = np.flatnonzero(np.diff(np.concatenate([[False], np.asarray(shaded, dtype=bool), [False]])))
    upto = np.append(time, time[-1])
    spans = [(axes.across(time[a]), axes.across(upto[b])) for a, b in zip(edges[::2], edges[1::2], strict=True)]
    tall = {"y": axes.top, "height": axes.bottom - axes.top, "class_": "doubtful"}
    return join([tag("rect", x=round(float(a), 1), width=round(float(b - a), 1), **tall) for a, b in spans])


def doubted(columns: Mapping[str, Float]) -> NDArray[np.bool_] | None:
    """Return (T,) where an estimated force is invalid, or None without such a column."""
    # 1 for a valid estimate, and between 0 and 1 where it was resampled
    return columns["force_valid"] < 0.5 if "force_valid" in columns else None


def _event_marks(axes: Axes, events: Sequence[tuple[float, str]]) -> Markup:
    lines: list[Markup] = []
    labels: list[tuple[float, str]] = []
    first, last = axes.x
    for index, (told, what) in enumerate(events[:12], start=1):
        when = last if last < told < last + 0.01 * (last - first) else told  # the end comes after the last sample
        if axes.inside(when, vertical=False):
            x = round(float(axes.across(when)), 1)
            tip = tag("title", f"{told:.2f} s: {what}")
            lines.append(axes.vertical(when, "event", tip))
            gap = 24.0 if x > axes.right - 12.0 else 12.0  # the last number stands before its line
            together = bool(labels) and x - labels[-1][0] < gap
            labels = (
                [*labels[:-1], (labels[-1][0], f"{labels[-1][1]}, {index}")] if together else [*labels, (x, f"{index}")]
            )
    for x, label in labels:
        at_edge = x + 6.0 * len(label) > axes.right
        side, anchor = (-3, "end") if at_edge else (3, "start")
        lines.append(text(x + side, axes.top + 9, label, "event-text", anchor))
    return join(lines)


def events_of(trace: Trace) -> list[tuple[float, str]]:
    """Return events of a trace as (time [s], text), in order."""
    pairs = [e for e in trace.meta.get("events") or [] if isinstance(e, list | tuple) and len(e) == 2]
    told = [(float(when), str(what)) for when, what in pairs if isinstance(when, int | float)]
    if told:
        return sorted(told)
    time, force = np.asarray(trace.time, dtype=float), np.nan_to_num(norm(trace.wrench[:, :3]))
    # of a real run: 4 standard deviations of its sensor, which one of 16,000 samples of noise exceeds
    least = max(CONTACT_N, 4.0 * (trace.meta.get("sensor_noise_n") or 0.0))
    touching = np.flatnonzero(np.nan_to_num(norm(trace.wrench_true[:, :3])) > least)
    told += [(float(time[touching[0]]), "first contact")] if len(touching) else []
    if force.max() > CONTACT_N:
        how = "estimated" if trace.estimated else "measured"
        told.append((float(time[np.argmax(force)]), f"highest {how} force, {force.max():.0f} N"))
    reason = str(trace.meta.get("reason") or trace.meta.get("failure") or "")
    return sorted([*told, (float(time[-1]), f"the end: {reason}" if reason else "the end")])


def run_plots(trace: Trace, force_limit: float | None = None) -> list[Markup]:
    """Return force, position, orientation and torque plots. `force_limit` [N] is for a trace without its own.

    An estimated force has no torque, and its machine's orientation follows from the joints, so both are omitted.
    """
    time, events = np.asarray(trace.time, dtype=float), events_of(trace)
    limit = (trace.meta.get("limits") or {}).get("force_n", force_limit)
    true_size = Curve(name=force_source(trace.meta), values=norm(trace.wrench_true[:, :3]), stroke="line faint")
    size = Curve(name="|F|", values=norm(trace.wrench[:, :3]), stroke="line ink")
    origin, first = trace.position[0], trace.quaternion[:1]
    moved = _pairs(1e3 * (trace.desired_position - origin), 1e3 * (trace.position - origin))
    turns = _pairs(turned(trace.desired_quaternion, first), turned(trace.quaternion, first))
    plots = [
        time_plot("Contact force", "N", time, [true_size, *components(trace.wrench[:, :3], "thin"), size],
                  limit=None if limit is None else float(limit), events=events, shaded=doubted(trace.machine),
                  caption=(ESTIMATE_CAPTION if trace.estimated else FORCE_CAPTION) + _short_peak(trace)),
        time_plot("Position", "mm", time, moved, events=events, caption=POSITION_CAPTION),
        time_plot("Orientation", "°", time, turns, events=events, caption=ORIENTATION_CAPTION),
        time_plot("Contact torque", "Nm", time, components(trace.wrench[:, 3:], ""), events=events,
                  caption=TORQUE_CAPTION),
    ]  # fmt: skip
    return plots[:2] if trace.estimated else plots


def drive_plots(trace: Trace) -> list[Markup]:
    """Return the plots that drives add to a run."""
    time, events = np.asarray(trace.time, dtype=float), events_of(trace)
    return [
        time_plot(plot.title, plot.unit, time, plot.curves, events=events if plot.events else (), caption=plot.caption)
        for record in registry().records("drive")
        if record.plots is not None
        for plot in record.plots(trace)
    ]


def _short_peak(trace: Trace) -> str:
    peak, seen = trace.meta.get("peak_force_n"), float(np.nan_to_num(norm(trace.wrench_true[:, :3])).max())
    if not isinstance(peak, int | float) or len(trace.time) < 2:
        return ""
    if not 1.1 * max(seen, CONTACT_N) < peak < np.inf:
        return ""
    between = 1e3 * float(np.median(np.diff(trace.time)))
    return f" The unfiltered peak of {peak:.0f} N lies between samples, which are {between:.0f} ms apart."


def turned(quaternion: Float, first: Float) -> Float:
    """Return rotation vectors (T, 3) [degrees] from a first orientation (1, 4), in base axes."""
    start = matrix_from_quaternion(first)
    result: Float = np.degrees(rotation_vector(matrix_from_quaternion(quaternion) @ np.swapaxes(start, -1, -2)))
    return result


def components(values: Float, style: str) -> list[Curve]:
    """Return curves of the components of vectors (T, 3)."""
    return [Curve(name=n, values=values[:, i], stroke=f"line c{i + 1} {style}".strip()) for i, n in enumerate(AXES)]


def _pairs(wanted: Float, measured: Float) -> list[Curve]:
    dashed = [Curve(name="", values=wanted[:, i], stroke=f"line c{i + 1} dashed") for i in range(3)]
    return [*dashed, *components(measured, "")]

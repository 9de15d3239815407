"""Drawings as matplotlib figures, without pyplot's global state."""

from __future__ import annotations

from math import radians
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from skillframe.frames import Float, norm, unit
from skillframe_lmc.directions import SLACK, needs
from skillframe_lmc.phase import Part
from skillframe_lmc.pieces import Pieces, pooled
from skillframe_lmc.posterior import depth, log_probability, witnesses
from skillframe_lmc.projection import Plane, outline
from skillframe_lmc.sectors import Sectors

COLOURS = ("#d1495b", "#2e6fba", "#3a9d6e", "#c98a1b", "#7a52a8", "#4f8f9d")
TORN = 90.0  # degrees between neighbours: an outline on the sphere's far side cannot be filled
CELLS, DRAWN = 121, radians(4.0)  # points of the outline's grid a side; half opening of a drawn sector
INK, GREEN, BLUE, RED, GREY = "#1d2025", "#3a9d6e", "#2e6fba", "#d1495b", "#b9bec6"


def directions(part: Part, axes: str) -> Figure:
    """Sectors of every demonstration around the desired direction, and the pushes that explain them (Fig. 13)."""
    figure = Figure(figsize=(6.4, 5.4), layout="constrained")
    draw_directions(figure.add_subplot(), part, axes)
    return figure


def draw_directions(canvas: Axes, part: Part, axes: str) -> None:
    """The same on a canvas."""
    given = _shown(part)
    plane = Plane(_centre(part, given))
    alpha = part.evidence["pyramid_angle_rad"]
    drawn = DRAWN if alpha is None else min(alpha, radians(20.0))
    reach = [30.0]
    for colour, pieces in zip(_cycle(len(given)), given, strict=True):
        for v, m, contact in zip(pieces.motion, pieces.edge, pieces.contact, strict=True):
            points = plane.to_plane(outline(v, m, bool(contact), drawn))
            if np.abs(np.diff(points, axis=0)).max() > TORN:
                continue
            reach.append(float(np.abs(points).max()))
            opacity = min(0.5, 2.0 / len(pieces.motion))
            canvas.add_patch(Polygon(points, facecolor=colour, edgecolor=colour, alpha=opacity, lw=0.6))
        canvas.plot([], [], color=colour, lw=6, alpha=0.6)
    extent = min(1.06 * float(np.percentile(reach, 90)), 180.0)
    if part.desired_direction is not None:
        _explaining(canvas, plane, given, part, extent)
    _frame_marks(canvas, plane, extent)
    canvas.set(xlim=(-extent, extent), ylim=(-extent, extent), aspect="equal")
    canvas.set_xlabel(f"towards +{plane.labels[0]} ({axes})  [degrees]")
    canvas.set_ylabel(f"towards +{plane.labels[1]} ({axes})  [degrees]")
    _legend(canvas, len(given), part)


def _shown(part: Part) -> list[Pieces]:
    """The pieces that the file holds of each demonstration with any."""
    found = list[Pieces]()
    for seen in part.evidence["demonstrations"]:
        count = len(seen["contact"])
        if not count:
            continue
        v, m, edge = (unit(np.array(seen[key], dtype=float).reshape(-1, 3)) for key in ("motion", "push", "edge"))
        contact, length = np.array(seen["contact"], dtype=bool), np.array(seen["length"])
        found.append(Pieces(v, m, edge, contact, length, np.array(seen["turning"]), np.full(count, len(found))))
    return found


def _centre(part: Part, given: list[Pieces]) -> Float:
    if part.desired_direction is not None:
        return part.desired_direction
    middles = np.array([unit(unit(s.motion + s.edge).mean(axis=0)) for s in given])
    if norm(middles.mean(axis=0)) > 0.4:
        return unit(middles.mean(axis=0))
    along = np.linalg.svd(middles)[2][0]  # opposed: look perpendicular to the line between them
    k = int(np.argmin(np.abs(along)))
    return unit(along[k] * along - np.eye(3)[k])


def _explaining(canvas: Axes, plane: Plane, given: list[Pieces], part: Part, extent: float) -> None:
    """Outline of the plateau of the posterior, or of what the papers' pyramids share, and the push."""
    alpha = part.evidence["pyramid_angle_rad"]
    side = np.linspace(-extent, extent, CELLS)
    points = plane.to_sphere(np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2))
    if alpha is None:
        seen = witnesses(pooled(given), part.evidence["whole"])
        logs = log_probability(points, seen)
        values, level = -logs, -(logs.max() - depth(float(logs.max()), seen))
    else:
        values = needs(points, [Sectors(p.motion, p.push, p.contact) for p in given])[0]
        level = SLACK * alpha
    if values.min() < level:
        canvas.contour(side, side, values.reshape(CELLS, CELLS), levels=[level], colors=INK, linewidths=2.0)
    canvas.plot(0.0, 0.0, marker="*", ms=15, color=INK, mec="white", mew=0.8, ls="none")


def _cycle(count: int) -> list[str]:
    return [COLOURS[i % len(COLOURS)] for i in range(count)]


def _frame_marks(canvas: Axes, plane: Plane, extent: float) -> None:
    canvas.axhline(0.0, color=GREY, lw=0.6, zorder=0)
    canvas.axvline(0.0, color=GREY, lw=0.6, zorder=0)
    for k in range(3):
        for sign in (1.0, -1.0):
            point = plane.to_plane(sign * np.eye(3)[k : k + 1])[0]
            if np.abs(point).max() < 0.97 * extent:
                canvas.plot(*point, marker="o", ms=4, mfc="white", mec=INK, mew=1.0)
                label = f"{'+' if sign > 0 else '-'}{'xyz'[k]}"
                canvas.annotate(label, point, xytext=(6, -12), textcoords="offset points", color=INK)


def _legend(canvas: Axes, count: int, part: Part) -> None:
    handles: list[Artist] = [Polygon([(0, 0)], facecolor=c, alpha=0.5) for c in _cycle(count)]
    labels = [f"demonstration {i + 1}" for i in range(count)]
    if part.desired_direction is not None:
        handles += canvas.plot([], [], color=INK, lw=2.0) + canvas.plot([], [], marker="*", color=INK, ms=11, ls="none")
        labels += ["explains most", "chosen"]
    columns = min(len(handles), 4)
    canvas.legend(handles, labels, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=columns, frameon=False)


def axes(name: str, part: Part, frame: str) -> Figure:
    """Mean directions, principal axes and the criterion (Fig. 14)."""
    figure = Figure(figsize=(6.4, 3.6), layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=(1.25, 1.0), gridspec_kw={"wspace": 0.12})
    _means(left, part, frame)
    criterion = part.evidence["criterion"]
    best = int(np.argmin(criterion))
    bars = right.bar(
        range(len(criterion)), criterion, color=[RED if i == best else GREY for i in range(len(criterion))]
    )
    right.bar_label(bars, fmt="%.3g", padding=2, color=INK)
    right.set_xticks(range(len(criterion)))
    right.set_xlabel("compliant axes")
    right.set_ylabel("criterion (lower is better)")
    right.margins(y=0.12)
    return figure


def _means(canvas: Axes, part: Part, frame: str) -> None:
    seen = [d for d in part.evidence["demonstrations"] if d["motion"]]
    means = np.array([d["mean_direction"] for d in seen], dtype=float).reshape(-1, 3)
    D = part.desired_direction
    rest = means if D is None else means - (means @ D)[:, None] * D
    principal = np.linalg.svd(rest, full_matrices=True)[2]
    first = principal[0] * np.copysign(1.0, principal[0][np.argmax(np.abs(principal[0]))])
    second = principal[1] if D is None else D
    for k, axis in enumerate(principal[:2] if D is None else principal[:1]):
        strong = k < len(part.compliant_axes)
        end = np.array([axis @ first, axis @ second])
        canvas.plot(*np.stack([-end, end], axis=1), color=RED, lw=2.4 if strong else 1.0, alpha=1.0 if strong else 0.4)
    if D is not None:
        canvas.annotate("", (0.0, 1.0), (0.0, 0.0), arrowprops={"arrowstyle": "-|>", "color": "#17a2b8", "lw": 2.0})
        canvas.plot([], [], color="#17a2b8", lw=2.0, label="desired direction")
    canvas.plot(means @ first, means @ second, "x", color=BLUE, ms=11, mew=2.2, label="mean motion")
    if D is not None:
        canvas.plot(rest @ first, rest @ second, "x", color=GREEN, ms=11, mew=2.2, label="not explained by it")
    canvas.plot([], [], color=RED, lw=2.4, label="principal axis")
    low = min(-0.3, float((means @ second).min()) - 0.2) if D is not None else -1.12
    canvas.set(xlim=(-1.12, 1.12), ylim=(low, 1.12), aspect="equal")
    canvas.set_xticks((-1.0, -0.5, 0.0, 0.5, 1.0))
    canvas.set_xlabel(f"along {_triple(first)} ({frame})")
    canvas.set_ylabel(f"along {_triple(second)}")
    canvas.legend(loc="lower center", bbox_to_anchor=(0.45, 1.0), ncols=2, frameon=False, fontsize=8.5,
                  columnspacing=1.0, handlelength=1.4)  # fmt: skip


def _triple(axis: Float) -> str:
    return "(" + ", ".join(f"{x + 0.0:.2f}" for x in np.round(axis, 2)) + ")"


def work(evidence: dict[str, dict[str, Any]]) -> Figure:
    """Work of teacher and environment, by part."""
    figure = Figure(figsize=(6.4, 0.9 + 0.9 * len(evidence)), layout="constrained")
    canvas = figure.add_subplot()
    for row, (_, seen) in enumerate(evidence.items()):
        for offset, key, colour in ((-0.19, "work_teacher_j", BLUE), (0.19, "work_environment_j", RED)):
            bar = canvas.barh(row + offset, seen[key], height=0.34, color=colour)
            canvas.bar_label(bar, labels=[f"{seen[key]:.3g} J"], padding=4, color=INK)
    canvas.set_yticks(range(len(evidence)), list(evidence))
    canvas.invert_yaxis()
    canvas.margins(x=0.18)
    canvas.set_xlabel("work [J]")
    handles = [Polygon([(0, 0)], facecolor=c) for c in (BLUE, RED)]
    canvas.legend(
        handles, ["by the teacher", "by the environment"], loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2,
        frameon=False,
    )  # fmt: skip
    return figure

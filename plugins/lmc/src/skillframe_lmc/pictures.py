"""The drawings themselves, as matplotlib figures made without pyplot (nothing global is touched)."""

from __future__ import annotations

from math import radians
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from skillframe.frames import Float, norm, unit
from skillframe_lmc.phase import Part
from skillframe_lmc.projection import Plane, need_map, outline
from skillframe_lmc.sectors import Sectors

COLOURS = ("#d1495b", "#2e6fba", "#3a9d6e", "#c98a1b", "#7a52a8", "#4f8f9d")
TORN = 90.0  # degrees between neighbours: an outline that runs round the far side of the sphere cannot be filled
INK, GREEN, BLUE, RED, GREY = "#1d2025", "#3a9d6e", "#2e6fba", "#d1495b", "#b9bec6"


def directions(name: str, part: Part, axes: str) -> Figure:
    """Pyramids of every demonstration in a plane around the desired direction, and their intersection (Fig. 13)."""
    given = _sectors(part, teacher_driven_only=name == "rotation")
    plane = Plane(_centre(part, given))
    alpha = part.evidence["pyramid_angle_rad"]
    drawn = min(alpha, radians(20.0))
    figure = Figure(figsize=(6.4, 5.4), layout="constrained")
    canvas = figure.add_subplot()
    reach = [30.0]
    for colour, sectors in zip(_cycle(len(given)), given, strict=True):
        for v, m, contact in zip(sectors.motion, sectors.push, sectors.contact, strict=True):
            points = plane.to_plane(outline(v, m, bool(contact), drawn))
            if np.abs(np.diff(points, axis=0)).max() > TORN:
                continue
            reach.append(float(np.abs(points).max()))
            opacity = min(0.5, 2.0 / len(sectors.motion))
            canvas.add_patch(Polygon(points, facecolor=colour, edgecolor=colour, alpha=opacity, lw=0.6))
        canvas.plot([], [], color=colour, lw=6, alpha=0.6)
    extent = min(1.06 * float(np.percentile(reach, 90)), 180.0)
    _intersection(canvas, plane, given, part, extent)
    _frame_marks(canvas, plane, extent)
    canvas.set(xlim=(-extent, extent), ylim=(-extent, extent), aspect="equal")
    canvas.set_xlabel(f"towards +{plane.labels[0]} ({axes})  [degrees]")
    canvas.set_ylabel(f"towards +{plane.labels[1]} ({axes})  [degrees]")
    _legend(canvas, len(given), part)
    return figure


def _sectors(part: Part, *, teacher_driven_only: bool) -> list[Sectors]:
    """The sectors kept in the evidence. Those that did not vote are left out."""
    found = []
    for seen in part.evidence["demonstrations"]:
        v, m = (np.array(seen[key], dtype=float).reshape(-1, 3) for key in ("motion", "push"))
        contact = np.array(seen["contact"], dtype=bool)
        keep = (v * m).sum(-1) >= 0.0 if teacher_driven_only else np.ones(len(v), dtype=bool)
        if keep.any():
            found.append(Sectors(unit(v[keep]), unit(m[keep]), contact[keep]))
    return found


def _centre(part: Part, given: list[Sectors]) -> Float:
    if part.desired_direction is not None:
        return part.desired_direction
    middles = np.array([unit(unit(s.motion + s.push).mean(axis=0)) for s in given])
    if norm(middles.mean(axis=0)) > 0.4:
        return unit(middles.mean(axis=0))
    along = np.linalg.svd(middles)[2][0]  # they oppose each other: look square to the line between them
    k = int(np.argmin(np.abs(along)))
    return unit(along[k] * along - np.eye(3)[k])


def _cycle(count: int) -> list[str]:
    return [COLOURS[i % len(COLOURS)] for i in range(count)]


def _intersection(canvas: Axes, plane: Plane, given: list[Sectors], part: Part, extent: float) -> None:
    if part.desired_direction is None:
        return
    need = need_map(plane, given, 0.8, extent)
    side = np.linspace(-extent, extent, len(need))
    level = 1.25 * part.evidence["pyramid_angle_rad"]
    if need.min() < level:
        canvas.contour(side, side, need, levels=[level], colors=INK, linewidths=2.0)
    canvas.plot(0.0, 0.0, marker="*", ms=15, color=INK, mec="white", mew=0.8, ls="none")


def _frame_marks(canvas: Axes, plane: Plane, extent: float) -> None:
    """Where the axes of the frame pierce the picture."""
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
        labels += ["explains all", "chosen"]
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
    """Work of teacher and environment, each part apart."""
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

"""Pictures of a search document."""

from __future__ import annotations

import io
from math import degrees

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Ellipse

from skillframe.extend import Document, Illustration
from skillframe.frames import norm
from skillframe_search.contact import surface_axes
from skillframe_search.describe import NAMES
from skillframe_search.exploration import COORDINATES
from skillframe_search.phase import Phase, read_phase
from skillframe_search.plan import Plan, exerted, keyed, plan

FAR = 2.5  # standard deviations of the outer ellipse
INK, BLUE, RED, GREY = "#1d2025", "#2e6fba", "#d1495b", "#b9bec6"


def explain(document: Document) -> list[Illustration]:
    """The exploration distribution with a trajectory, and the force model."""
    phase = read_phase(document)
    trajectory = plan(keyed(phase), 0)
    turning = "turn" in phase.searched
    figure = Figure(figsize=(9.6 if turning else 5.6, 4.8))
    panels = figure.subplots(1, 2, squeeze=False)[0] if turning else [figure.add_subplot()]
    _panel(panels[0], phase, trajectory, 1)
    if turning:
        _panel(panels[1], phase, trajectory, len(phase.searched) - 1)
    caption = (
        f"Grey: the tool of the blindfolded teacher, relative to its start. Ellipses: one and {FAR:g} "
        f"standard deviations of the Gaussian fitted to it. Blue: one search, {1e3 * trajectory.length:.0f} mm in "
        f"{phase.stop.time_s:g} s."
    )
    if phase.exploration is None:
        caption = f"Blue: one search around the start, {1e3 * trajectory.length:.0f} mm in {phase.stop.time_s:g} s."
    found = [Illustration("Where it searches", caption, _svg(figure))]
    return found if phase.forces is None else [*found, _forces(phase)]


def _panel(canvas: Axes, phase: Phase, trajectory: Plan, second: int) -> None:
    pair = [0, min(second, len(phase.searched) - 1)]
    factor = np.array([degrees(1.0) if _turns(phase, i) else 1e3 for i in pair])
    places = np.array(phase.evidence.get("places", [])).reshape(-1, len(phase.searched))
    canvas.plot(*(places[:, pair] * factor).T, ".", color=GREY, ms=3)
    axes = surface_axes(np.array(phase.push.direction))
    all_five = np.concatenate([trajectory.place[:, :3] @ axes[:2].T, trajectory.place[:, 3:] @ axes.T], axis=1)
    canvas.plot(
        *(all_five[:, [COORDINATES.index(name) for name in phase.searched]][:, pair] * factor).T, color=BLUE, lw=0.9
    )
    if phase.exploration is not None and pair[0] != pair[1]:
        covariance = np.array(phase.exploration.covariance)[np.ix_(pair, pair)] * np.outer(factor, factor)
        mean = np.array(phase.exploration.mean)[pair] * factor
        value, vector = np.linalg.eigh(covariance)
        angle = float(np.degrees(np.arctan2(vector[1, 1], vector[0, 1])))
        for size in (1.0, FAR):
            wide, high = 2.0 * size * np.sqrt(value[::-1])
            canvas.add_patch(Ellipse(tuple(mean), wide, high, angle=angle, fill=False, ec=INK, lw=1.2))
    canvas.plot(0.0, 0.0, "+", color=RED, ms=12, mew=2)
    labels = [f"{NAMES[phase.searched[i]]} [{'degrees' if _turns(phase, i) else 'mm'}]" for i in pair]
    canvas.set(xlabel=labels[0], ylabel=labels[1])
    if not any(_turns(phase, i) for i in pair):
        canvas.set_aspect("equal")


def _turns(phase: Phase, i: int) -> bool:
    return COORDINATES.index(phase.searched[i]) >= 2


def _forces(phase: Phase) -> Illustration:
    speed = np.linspace(0.0, 1.5 * phase.path.speed, 40)
    figure = Figure(figsize=(5.6, 3.6))
    canvas = figure.add_subplot()
    axes = surface_axes(np.array(phase.push.direction))
    across = [i for i in range(len(phase.searched)) if not _turns(phase, i)]
    for angle in np.linspace(0.0, 2.0 * np.pi, 8, endpoint=False) if len(across) > 1 else (0.0, np.pi):
        way = np.array([np.cos(angle), np.sin(angle)])[: len(across)]
        rate = np.zeros((len(speed), len(phase.searched)))
        rate[:, across] = speed[:, None] * way
        rows = axes[[COORDINATES.index(phase.searched[i]) for i in across]]
        canvas.plot(1e3 * speed, exerted(phase, rate)[:, :3] @ (way @ rows), color=BLUE, alpha=0.7)
    canvas.axhline(0.0, color=GREY, lw=0.8)
    canvas.set(xlabel="speed along the surface [mm/s]", ylabel="force along the motion [N]")
    fastest = np.zeros((2, len(phase.searched)))
    fastest[:, 0] = [phase.path.speed, -phase.path.speed]
    wrench = exerted(phase, fastest)[:, :3]
    pressed = np.array(phase.push.direction)
    ratio = float(np.mean(norm(wrench - (wrench @ pressed)[:, None] * pressed) / phase.push.force))
    caption = (
        f"What the search exerts along its motion beside the push of {phase.push.force:.1f} N, for eight directions: "
        f"the force demonstrated at that velocity, at any place. At full speed it is {ratio:.2f} of the push, which "
        "is the friction that the model has learned."
    )
    return Illustration("What it exerts on the way", caption, _svg(figure))


def _svg(figure: Figure) -> str:
    text = io.StringIO()
    style = {"font.family": "DejaVu Sans", "font.size": 10, "svg.fonttype": "none", "svg.hashsalt": "skillframe"}
    with rc_context(style):
        figure.set_layout_engine("constrained")
        figure.savefig(text, format="svg", metadata={"Date": None})
    drawing = text.getvalue()
    return drawing[drawing.index("<svg") :]

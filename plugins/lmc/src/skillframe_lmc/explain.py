"""Pictures of a learned phase from the skill file alone, after Figs. 13 and 14 of the overview paper."""

from __future__ import annotations

import io
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from skillframe.extend import Document, Illustration
from skillframe_lmc import pictures
from skillframe_lmc.phase import Part, read_phase

if TYPE_CHECKING:
    from matplotlib.figure import Figure

STYLE = {
    "font.family": "DejaVu Sans",
    "font.size": 10,
    "axes.edgecolor": "#8a8f98",
    "axes.labelcolor": "#30343b",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.titlesize": 11,
    "axes.titleweight": "bold",
    "xtick.color": "#60656e",
    "ytick.color": "#60656e",
    "svg.fonttype": "none",
    "svg.hashsalt": "skillframe",
}


def explain(document: Document) -> list[Illustration]:
    """Directions and axes of each part that moved, then the work of both sides."""
    phase = read_phase(document)
    parts = {"translation": phase.translation, "rotation": phase.rotation}
    moved = {name: part for name, part in parts.items() if part.evidence.get("demonstrations") and not _held(part)}
    axes = "base" if document["frame"]["axes"] == "base" else "tool at start"
    found = []
    for name, part in moved.items():
        if part.evidence.get("feasible_solid_angle_sr") is not None:
            found.append(_directions(name, part, axes))
        if part.evidence.get("criterion"):
            found.append(_axes(name, part, axes))
    if moved:
        found.append(_work(moved))
    return found


def _held(part: Part) -> bool:
    return bool(part.evidence.get("held"))


def _directions(name: str, part: Part, axes: str) -> Illustration:
    drawing = _svg(lambda: pictures.directions(part, axes))
    what, load = ("push", "force") if name == "translation" else ("turning push", "torque")
    if part.desired_direction is None:
        end = "No direction explains enough of them, so no desired direction exists."
    else:
        end = (
            f"Inside the black outline a {what} explains most of what all demonstrations showed "
            f"({part.evidence['feasible_solid_angle_sr']:.2f} sr); the star is the one that was chosen, in its middle."
        )
    caption = (
        f"Each coloured patch is one piece of a demonstration: the {what}es that would have caused the motion that was "
        f"seen, between the motion itself and the negative of the measured {load}, with some room for a wavering hand. "
        f"One colour per demonstration. {end}"
    )
    return Illustration(f"Which {what}es explain the {name}?", caption, drawing)


def _axes(name: str, part: Part, axes: str) -> Illustration:
    drawing = _svg(lambda: pictures.axes(name, part, axes))
    count = len(part.compliant_axes)
    axes_are = f"{count} compliant {'axis' if count == 1 else 'axes'}"
    without = "" if part.desired_direction is None else ", less what the desired direction explains (green)"
    caption = (
        f"Left: the mean direction of motion of each demonstration (blue){without}, and the principal axes (red, those "
        "that became compliant drawn strong). What remains was caused by the environment, so the tool is compliant "
        "there. Right: the criterion weighs what stays unexplained against the number of axes; the lowest bar wins"
    )
    caption += f": {axes_are}."
    return Illustration(f"Along which axes must the {name} comply?", caption, drawing)


def _work(parts: dict[str, Part]) -> Illustration:
    drawing = _svg(lambda: pictures.work({name: part.evidence for name, part in parts.items()}))
    free = [name for name, part in parts.items() if part.fully_compliant]
    end = (
        f"The environment did most of the work in {' and '.join(free)}, which is therefore left free in all directions."
        if free
        else "The teacher did most of it, so what was shown was meant."
    )
    caption = f"Mechanical work during contact, by the sign of force times motion. {end}"
    return Illustration("Who moved the tool?", caption, drawing)


def _svg(draw: Callable[[], Figure]) -> str:
    import matplotlib
    from matplotlib.backends.backend_svg import FigureCanvasSVG

    with matplotlib.rc_context(STYLE):
        figure: Any = draw()
        FigureCanvasSVG(figure)
        file = io.StringIO()
        figure.savefig(file, format="svg", metadata={"Date": None, "Creator": None})
    text = file.getvalue()
    return text[text.index("<svg") :]

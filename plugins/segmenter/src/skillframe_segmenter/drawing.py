"""A matplotlib figure as SVG text, without pyplot: fonts stay text, and equal figures give equal text."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure

INK, BLUE, RED, GREEN, GREY = "#1d2025", "#2e6fba", "#d1495b", "#3a9d6e", "#b9bec6"
STYLE = {"font.family": "DejaVu Sans", "svg.fonttype": "none", "svg.hashsalt": "skillframe"}


def svg(figure: Figure) -> str:
    """The figure as an `<svg>` element."""
    from matplotlib import rc_context

    text = io.StringIO()
    for axes in figure.axes:
        axes.spines[["top", "right"]].set_visible(False)
    with rc_context(STYLE):
        figure.set_layout_engine("constrained")
        figure.savefig(text, format="svg", metadata={"Date": None})
    drawing = text.getvalue()
    return drawing[drawing.index("<svg") :]

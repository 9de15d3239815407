"""Where demonstrations were cut, as a matplotlib figure: a bar per demonstration over its time, a colour per phase."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

from skillframe.reports.drawing import svg

COLOURS = ("#2e6fba", "#c98a1b", "#3a9d6e", "#d1495b", "#7a52a8", "#4f8f9d", "#8a7a5b", "#b0457b")
BAR, MARGIN = 0.34, 0.9
"""Height of a bar, and of all that is not bars, in inches."""


def cuts(rows: Sequence[Mapping[str, Any]]) -> str:
    """Drawn cuts of demonstrations, with `boundaries` [s] and `labels` as in the policy file, as an `<svg>` element."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.6, MARGIN + BAR * max(len(rows), 1)))
    canvas = figure.add_subplot()
    for i, row in enumerate(rows):
        first, last = row.get("start", 0.0), row.get("end", max(row["boundaries"], default=1.0))
        for (start, stop), label in zip(pairwise([first, *row["boundaries"], last]), row["labels"], strict=True):
            canvas.barh(i, stop - start, left=start, height=0.72, color=COLOURS[label % len(COLOURS)])
            canvas.text(0.5 * (start + stop), i, f"{label + 1}", color="white", ha="center", va="center")
    canvas.set_yticks(range(len(rows)), [f"demonstration {i + 1}" for i in range(len(rows))])
    canvas.invert_yaxis()
    canvas.tick_params(axis="y", length=0)
    canvas.spines["left"].set_visible(False)
    canvas.set_xlabel("time [s]")
    return svg(figure)

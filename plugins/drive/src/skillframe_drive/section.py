"""The section of a report about a folder of `skillframe drive hold`: verdicts, estimates, and a picture."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import Any

import numpy as np

from skillframe.extend import Grid, Illustration, ReportFiles
from skillframe.files.documents import read_json
from skillframe.frames import Float

HOLD = "hold.json"
"""The file of a folder of `drive hold`. This module is imported for every report, so it imports no simulator."""


def hold_section(files: ReportFiles) -> Sequence[str | Grid | Illustration]:
    """The parts of the section, or none if the folder holds no result."""
    if HOLD not in files.names:
        return []
    content = read_json(files.path(HOLD), "make it again with skillframe drive hold")
    parts: list[str | Grid | Illustration] = []
    for run in content["runs"]:
        parts.append(f"{run['run']}: {run['said'][0]}.")
        rows = [
            (each["name"], each["value"], each["half_width"], f"{each['low']:.4g} to {each['high']:.4g}")
            for each in run["estimates"]
        ]
        head = ("quantity", "estimate", "half width of 90 %", "certified")
        parts.append(
            Grid(head, rows, "Estimated from the run's figures by simulated runs of a wider box, in SI units.")
        )
        told = ("[", *(each["name"] for each in run["estimates"]))  # a table's head, and what stands in the grid
        parts += [text for text in run["said"][1:] if not text.startswith(told)]
        caption = (
            f"Grey: {len(content['simulated'])} simulated runs of the certificate's box, each line from the least to "
            "the greatest of them. Red: the run, at the edge with an arrow if it lies further out."
        )
        parts.append(Illustration(f"Figures of {run['run']}", caption, _strips(content, run)))
    return parts


def _strips(content: dict[str, Any], run: dict[str, Any]) -> str:
    simulated = np.array([[np.nan if v is None else v for v in row] for row in content["simulated"]])
    row, left, wide = 22.0, 250.0, 640.0  # height of a line; begin and width of its strip, in the picture's own units
    lines = []
    for i, name in enumerate(content["names"]):
        y = row * (i + 1)
        lines.append(f'<text x="{left - 12}" y="{y + 4}" text-anchor="end">{escape(name)}</text>')
        lines += _strip(simulated[:, i], run["figures"][i], y, left, wide)
    height = row * (len(content["names"]) + 1)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {left + wide + 40} {height}" '
        f'font-family="sans-serif" font-size="12" fill="#555">{"".join(lines)}</svg>'
    )


def _strip(simulated: Float, own: float | None, y: float, left: float, wide: float) -> list[str]:
    """Dots of the simulated runs, and a bar for the run itself, on the line at y."""
    known = simulated[np.isfinite(simulated)]
    if not len(known):
        return []
    low, high = known.min(), known.max()
    width = high - low if high > low else 1.0
    marks = [
        f'<circle cx="{left + wide * (v - low) / width:.1f}" cy="{y}" r="3" fill="#999" fill-opacity="0.35"/>'
        for v in known
    ]
    if own is not None:
        share = (own - low) / width
        x = left + wide * min(max(share, -0.015), 1.015)
        arrow = "" if -0.015 <= share <= 1.015 else "&#8592;" if share < 0.0 else "&#8594;"
        marks.append(f'<rect x="{x - 2:.1f}" y="{y - 9}" width="4" height="18" fill="#b3261e"/>')
        marks.append(f'<text x="{x + (6 if share > 0.0 else -18):.1f}" y="{y + 4}" fill="#b3261e">{arrow}</text>')
    return marks

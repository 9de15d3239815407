"""Line charts and maps as SVG text.

Colours are CSS classes, so one drawing serves light, dark and paper.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from skillframe.frames import Float
from skillframe_reports.markup import Markup, join, number, tag

LEFT, RIGHT, TOP, BOTTOM = 52.0, 12.0, 34.0, 40.0
"""Margins of a plot in its own units."""
Point = tuple[float, float, tuple[float, float] | None, str]
"""Data x and y, range of y if known, and text that is shown on hovering."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Axes:
    """A plot's frame: data ranges and their place in the picture.

    Attributes:
        width, height: of the picture in its own units.
        x, y: (low, high) of the data.
        x_label, y_label: with units.
    """

    width: float = 460.0
    height: float = 240.0
    x: tuple[float, float]
    y: tuple[float, float]
    x_label: str = ""
    y_label: str = ""
    top: float = TOP

    @property
    def bottom(self) -> float:
        """Picture coordinate of the lower edge."""
        return self.height - BOTTOM

    @property
    def right(self) -> float:
        """Picture coordinate of the right edge."""
        return self.width - RIGHT

    def across(self, value: Any) -> Any:
        """Return picture x of data x."""
        return LEFT + (value - self.x[0]) / (self.x[1] - self.x[0]) * (self.right - LEFT)

    def up(self, value: Any) -> Any:
        """Return picture y of data y."""
        return self.bottom - (value - self.y[0]) / (self.y[1] - self.y[0]) * (self.bottom - self.top)

    def frame(self, x_ticks: Sequence[float] | None = None, y_ticks: Sequence[float] | None = None) -> Markup:
        """Return grid lines, tick labels and axis labels."""
        xs = ticks(*self.x, 6) if x_ticks is None else x_ticks
        ys = ticks(*self.y, 5) if y_ticks is None else y_ticks
        parts = []
        for v in xs:
            place = round(float(self.across(v)), 1)
            parts += [self.vertical(v, "grid"), text(place, self.bottom + 15, number(v), "tick", "middle")]
        for v in ys:
            place = round(float(self.up(v)), 1)
            parts += [
                self.horizontal(v, "zero" if v == 0 else "grid"),
                text(LEFT - 6, place + 4, number(v), "tick", "end"),
            ]
        parts.append(text(0.5 * (LEFT + self.right), self.height - 5, self.x_label, "label", "middle"))
        parts.append(text(4, self.top - 10, self.y_label, "label"))
        return join(parts)

    def vertical(self, x: float, class_: str, *content: object) -> Markup:
        """Return a line over the whole height at data x."""
        at = round(float(self.across(x)), 1)
        return tag("line", *content, x1=at, x2=at, y1=self.top, y2=self.bottom, class_=class_)

    def horizontal(self, y: float, class_: str) -> Markup:
        """Return a line over the whole width at data y."""
        at = round(float(self.up(y)), 1)
        return tag("line", x1=LEFT, x2=self.right, y1=at, y2=at, class_=class_)

    def series(self, points: Sequence[Point], stroke: str) -> Markup:
        """Return points with their ranges and the line through them, in one colour."""
        marks: list[Markup] = []
        for x, y, span, tip in points:
            px = round(float(self.across(x)), 1)
            if span is not None:
                low, high = (round(float(self.up(v)), 1) for v in span)
                marks.append(tag("line", x1=px, x2=px, y1=low, y2=high, class_=f"bar {stroke}"))
            dot = {"cx": px, "cy": round(float(self.up(y)), 1), "r": 3.4, "class_": f"point {stroke}"}
            marks.append(tag("circle", tag("title", tip), **dot))
        xs, ys = (np.array([point[i] for point in points], dtype=float) for i in (0, 1))
        return join([self.line(xs, ys, f"line {stroke}"), *marks])

    def line(self, x: Float, y: Float, class_: str) -> Markup:
        """Return a line through the data, broken at NaN."""
        pieces, good = [], np.isfinite(x) & np.isfinite(y)
        for run in np.split(np.arange(len(x)), np.flatnonzero(np.diff(good)) + 1):
            if len(run) and good[run[0]]:
                pieces.append(
                    "M"
                    + "L".join(f"{a:.1f} {b:.1f}" for a, b in zip(self.across(x[run]), self.up(y[run]), strict=True))
                )
        return tag("path", d="".join(pieces), class_=class_) if pieces else Markup("")

    def inside(self, value: float, *, vertical: bool = True) -> bool:
        """Return whether a value lies within the y (or x) range."""
        low, high = self.y if vertical else self.x
        return low <= value <= high


def text(x: float, y: float, content: object, class_: str, anchor: str = "start") -> Markup:
    """Return text at a point."""
    return tag(
        "text", content, x=round(x, 1), y=round(y, 1), class_=class_, text_anchor=None if anchor == "start" else anchor
    )


def picture(axes: Axes, label: str, *content: object, class_: str = "", **attributes: Any) -> Markup:
    """Return an SVG element with an accessible label."""
    return tag(
        "svg", tag("title", label), *content, viewbox=f"0 0 {axes.width:g} {axes.height:g}", role="img",
        class_=class_ or None, **attributes,
    )  # fmt: skip


def ticks(low: float, high: float, most: int) -> list[float]:
    """Return at most `most` round values (1, 2, 2.5 or 5 times a power of ten) within a range."""
    span = high - low
    if not np.isfinite(span) or span <= 0.0:
        return [low]
    power = 10.0 ** np.floor(np.log10(span / most))
    for factor in (1.0, 2.0, 2.5, 5.0, 10.0, 20.0):
        step = factor * power
        first, last = np.ceil(low / step - 1e-9), np.floor(high / step + 1e-9)
        if last - first + 1 <= most:
            return [float(round(k * step, 12)) for k in np.arange(first, last + 1)]
    return [low, high]


def padded(low: float, high: float, share: float = 0.06, least: float = 1e-6) -> tuple[float, float]:
    """Return a non-empty range with a margin."""
    if not (np.isfinite(low) and np.isfinite(high)):
        return 0.0, 1.0
    margin = max(share * (high - low), least)
    return low - margin, high + margin


def envelope(x: Float, y: Float, most: int = 260) -> tuple[Float, Float]:
    """Return a curve in at most 2 `most` points: lowest and highest sample of each bin."""
    if len(x) <= 2 * most:
        return x, y
    edges = np.linspace(0, len(x), most + 1).astype(int)
    filled = np.where(np.isfinite(y), y, 0.0)
    keep = {0, len(x) - 1}
    for start, stop in pairwise(edges):
        keep |= {start + int(np.argmin(filled[start:stop])), start + int(np.argmax(filled[start:stop]))}
    index = np.array(sorted(keep))
    return x[index], y[index]


def legend(axes: Axes, entries: Sequence[tuple[str, str]], start: float = 60.0) -> Markup:
    """Return curve names above the plot from (name, class of its stroke). Long ones are cut."""
    mark, letter = 28.0, 7.0  # width of a stroke with its gaps, and of a letter of 12.5 px
    letters = (axes.right - start - mark * len(entries)) / letter / max(len(entries), 1)
    longest = max(int(letters), 4) if sum(len(name) for name, _ in entries) > letters * len(entries) else 1000
    entries = [(name if len(name) <= longest else name[: longest - 1] + "\N{HORIZONTAL ELLIPSIS}", class_)
               for name, class_ in entries]  # fmt: skip
    widths = [mark + letter * len(name) for name, _ in entries]
    x = max(start, axes.right - sum(widths))
    parts = []
    for (name, class_), width in zip(entries, widths, strict=True):
        parts.append(
            tag("line", x1=round(x, 1), x2=round(x + 14, 1), y1=axes.top - 14, y2=axes.top - 14, class_=class_)
        )
        parts.append(text(x + 18, axes.top - 10, name, "legend"))
        x += width
    return join(parts)

"""Where demonstrations were cut, on one page: a person drags a boundary, and the page writes the line that repeats it.

The page knows what the policy file holds: `demonstrations` with their `boundaries` and `labels`, `phase_min_s`, without
which boundaries cannot be moved, and, of boundaries moved before, `found` and `set`. It needs nothing else and reaches
for nothing outside.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

from skillframe.demonstration.record import Demonstration
from skillframe.extend.records import Document
from skillframe.reports.lanes import axis, lanes_of
from skillframe.reports.markup import Markup, join, json_script, note, tag
from skillframe.reports.shell import asset, bar, head

PHASE = re.compile(r"[├└]─ phase (\d+)(.*?): (.*)")
GOLDEN_DEG, FIRST_HUE_DEG = 137.5, 215.0
"""Hues of phases lie a golden angle apart, so that any number of them stays apart."""
HOW = (
    "Drag a boundary to where the motion changes. Or choose it with the Tab key and step it with the arrow keys: "
    "0.01 s, with Shift 0.1 s; Escape puts it back. The line below repeats the cut as it then stands."
)
FIXED = (
    "Boundaries of these recordings are not moved by hand: they name places, and a phase ends where the tool has left "
    "its place. `--set places=false` learns in base, where boundaries can be moved."
)
FOLLOWED = (
    "Other boundaries were set, and this recording now has other phases than without them. To move these cuts, begin "
    "without --set-boundary."
)
POINT = (
    "Position and attitude are told from the start, about the recorded tool point; speed is the mean over 50 ms. Force "
    "and torque are those of the environment on the tool. All axes are those of the base."
)


class Cut(NamedTuple):
    """How a recording is cut, and how it would be had nobody moved anything.

    Attributes:
        shown: boundaries as they stand [s].
        found: boundaries as they are without `--set-boundary` [s].
        rest: where a boundary goes that is put back [s].
        set: whether a person has moved it.
        movable: whether boundaries of this recording can be moved.
    """

    shown: list[float]
    found: list[float]
    rest: list[float]
    set: list[bool]
    movable: bool


def cut_of(row: Mapping[str, Any], movable: bool) -> Cut:
    """How a row of the policy file's `demonstrations` is cut.

    A recording in which nothing was moved may have followed those in which something was. Where it then has other
    phases, its boundaries are not those that `--set-boundary` counts, and are not moved.
    """
    shown, before = list(row["boundaries"]), row.get("found") or row
    touched = [k in row.get("set", []) for k in range(len(shown))]
    alike = _pattern(before["labels"]) == _pattern(row["labels"])
    found = list(before["boundaries"]) if alike else shown
    return Cut(shown, found, found if any(touched) else shown, touched, movable and alike)


def _pattern(labels: Sequence[int]) -> list[int]:
    """Phases by first appearance: what stays when they are numbered otherwise."""
    order = list(dict.fromkeys(labels))
    return [order.index(label) for label in labels]


def page(document: Document, words: Sequence[str], demonstrations: Sequence[Demonstration], line: str) -> str:
    """The whole document.

    Args:
        document: of a policy.
        words: of the policy, as `segment` tells them.
        demonstrations: those that it was learned from, in order.
        line: the command that wrote the policy, without its `--set-boundary`.
    """
    rows = document["demonstrations"]
    least = document.get("phase_min_s")
    cuts = [cut_of(row, least is not None) for row in rows]
    many = f"{len(rows)} demonstration{'s' * (len(rows) != 1)}"
    phases = len(document["phases"])
    title = f"{many}, {phases} phase{'s' * (phases != 1)}"
    names = [row["file"] or f"demonstration {i}" for i, row in enumerate(rows, start=1)]
    hero = tag(
        "header", tag("p", "Cuts", class_="eyebrow"), tag("h1", title), tag("p", _lead(cuts, least), class_="lead"),
        _phases(words), class_="hero",
    )  # fmt: skip
    each = [
        _recording(i, name, row, cut, demonstration)
        for i, (name, row, cut, demonstration) in enumerate(
            zip(names, rows, cuts, demonstrations, strict=True), start=1
        )
    ]
    ends = [(float(d.time[0]), float(d.time[-1])) for d in demonstrations]
    data = {
        "min": least, "line": line,
        "recordings": [
            {**cut._asdict(), "start": row["start"], "end": row["end"], "first": first, "last": last}
            for row, cut, (first, last) in zip(rows, cuts, ends, strict=True)
        ],
    }  # fmt: skip
    body = tag(
        "body", bar(tag("a", name, href=f"#d{i}") for i, name in enumerate(names, start=1)),
        tag("main", hero, *each, tag("p", POINT, class_="caption")), _line(line, any(cut.movable for cut in cuts)),
        json_script("cuts", data), tag("script", asset("theme.js"), asset("cuts.js")),
    )  # fmt: skip
    top = head(title, styles=("page.css", "cuts.css"))
    return "<!DOCTYPE html>\n" + tag("html", top, body, lang="en")


def _lead(cuts: Sequence[Cut], least: float | None) -> Markup:
    if least is None:
        return join(tag("code", part) if i % 2 else part for i, part in enumerate(FIXED.split("`")))
    if not any(cut.shown for cut in cuts):
        return Markup("Nothing is cut: every demonstration is one phase. --phases asks for more.")
    return join([HOW, f" A phase keeps at least {least:g} s."])


def hue(label: int) -> str:
    """The style that gives an element its phase's colour."""
    return f"--hue:{(FIRST_HUE_DEG + GOLDEN_DEG * label) % 360.0:g}"


def _chip(label: int) -> Markup:
    return tag("b", label + 1, class_="chip", style=hue(label))


def _phases(words: Sequence[str]) -> Markup:
    """The phases in words, each with its colour, and folded what else the segmentation says."""
    found = [(line, PHASE.match(line)) for line in words]
    items = [
        tag("li", _chip(int(m[1]) - 1), f"{m[2].strip()}: " if m[2] else "", m[3]) for _, m in found if m is not None
    ]
    rest = [tag("li", line) for line, m in found if m is None]
    return join([
        tag("ul", *items, class_="phases") if items else "",
        tag("details", tag("summary", "What else is said of it"), tag("ul", *rest)) if rest else "",
    ])  # fmt: skip


def _recording(number: int, name: str, row: Mapping[str, Any], cut: Cut, demonstration: Demonstration) -> Markup:
    """One recording: its curves over time under its phases, the boundaries on them, and the boundaries as figures."""
    first, last = float(demonstration.time[0]), float(demonstration.time[-1])

    def share(time: float) -> float:
        return round(100.0 * (time - first) / (last - first), 4)

    bands = [
        tag("div", tag("b", label + 1), class_="band",
            style=f"{hue(label)};left:{share(start)}%;width:{share(stop) - share(start):.4f}%")
        for (start, stop), label in zip(pairwise([first, *cut.shown, last]), row["labels"], strict=True)
    ]  # fmt: skip
    handles = [_handle(number, k, time, share(time), cut.movable) for k, time in enumerate(cut.shown, start=1)]
    ghosts = [tag("div", class_="ghost") for _ in cut.shown] if cut.movable else []
    drawn = tag("div", *bands, *lanes_of(demonstration), axis(first, last), *ghosts, *handles, class_="lanes")
    figures = [_figure(k, time, row["labels"]) for k, time in enumerate(cut.shown, start=1)] if cut.movable else []
    length = tag("span", f"{last - first:.2f} s", class_="badge")
    title = tag("h2", f"{number}. ", name, " ", length)
    return tag(
        "section", title, note(FOLLOWED) if _followed(row) else "", tag("div", drawn, class_="card cut"),
        tag("ul", *figures, class_="boundaries") if figures else "", id=f"d{number}", class_="recording",
    )  # fmt: skip


def _followed(row: Mapping[str, Any]) -> bool:
    return "found" in row and _pattern(row["found"]["labels"]) != _pattern(row["labels"])


def _handle(number: int, boundary: int, time: float, share: float, movable: bool) -> Markup:
    says = f"boundary {boundary} of demonstration {number}"
    own = {"role": "slider", "tabindex": 0, "aria_label": says, "aria_valuenow": f"{time:.2f}"} if movable else {}
    pill = tag("span", tag("b", boundary), tag("i", f"{time:.2f} s"), class_="pill")
    return tag(
        "div", pill, class_="handle" if movable else "handle fixed", style=f"left:{share}%;--share:{share / 100:.4f}",
        **own,
    )  # fmt: skip


def _figure(boundary: int, time: float, labels: Sequence[int]) -> Markup:
    entry = tag("input", type="number", step="0.01", value=f"{time:.2f}", inputmode="decimal")
    name = tag("label", f"boundary {boundary} ", entry, " s")
    was = tag("span", f"found at {time:.2f} s", class_="was")
    return tag(
        "li", _chip(labels[boundary - 1]), _chip(labels[boundary]), name, was,
        tag("button", "Put back", type="button", class_="back"),
    )  # fmt: skip


def _line(line: str, movable: bool) -> Markup:
    """The command that repeats the cut, which the script keeps up to date."""
    buttons = [
        tag("button", "Copy", type="button", id="copy"),
        tag("button", "Put all back", type="button", id="reset") if movable else "",
    ]
    top = tag("div", tag("strong", "The line that repeats this cut"), *buttons, class_="top")
    said = tag("p", "Run it where segment was run.", class_="caption", id="told", role="status")
    alone = tag("noscript", "Without scripts the boundaries cannot be moved.")
    return tag("aside", tag("div", top, tag("pre", tag("code", line, id="line")), said, alone), class_="repeat")

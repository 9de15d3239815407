"""Page that shows the phase boundaries of demonstrations, and a command that reproduces edits by dragging.

It needs only the policy file: `demonstrations` with `boundaries` and `labels`, `phase_min_s` (without it, boundaries
are fixed), and for edited boundaries `found` and `set`.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

from skillframe.demonstration import Demonstration
from skillframe.extend import Document
from skillframe_reports.demonstration_curves import axis, lanes_of
from skillframe_reports.markup import Markup, join, json_script, note, tag
from skillframe_reports.shell import asset, bar, head

PHASE = re.compile(r"[├└]─ phase (\d+)(.*?): (.*)")
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
    "Position and orientation are relative to the start, of the recorded tool point; speed is the mean over 50 ms. "
    "Force and torque are those of the environment on the tool. All axes are those of the base."
)


class Cut(NamedTuple):
    """Boundaries of a recording, with and without edits.

    Attributes:
        shown: current boundaries [s].
        found: boundaries without `--set-boundary` [s].
        rest: where a reset boundary goes [s].
        set: whether each was edited.
        movable: whether boundaries of this recording can be moved.
    """

    shown: list[float]
    found: list[float]
    rest: list[float]
    set: list[bool]
    movable: bool


def cut_of(row: Mapping[str, Any], movable: bool) -> Cut:
    """Return the boundaries of a row of the policy file's `demonstrations`.

    An unedited recording may follow edited ones. If its phases then differ, `--set-boundary` counts other boundaries,
    so these are fixed.
    """
    shown, before = list(row["boundaries"]), row.get("found") or row
    touched = [k in row.get("set", []) for k in range(len(shown))]
    alike = _pattern(before["labels"]) == _pattern(row["labels"])
    found = list(before["boundaries"]) if alike else shown
    return Cut(shown, found, found if any(touched) else shown, touched, movable and alike)


def _pattern(labels: Sequence[int]) -> list[int]:
    order = list(dict.fromkeys(labels))
    return [order.index(label) for label in labels]


def page(document: Document, words: Sequence[str], demonstrations: Sequence[Demonstration], line: str) -> str:
    """Return the document."""
    rows = document["demonstrations"]
    least = document.get("phase_min_s")
    cuts = [cut_of(row, least is not None) for row in rows]
    phases = len(document["phases"])
    title = f"{len(rows)} demonstration{'s' * (len(rows) != 1)}, {phases} phase{'s' * (phases != 1)}"
    names = [row["file"] or f"demonstration {i}" for i, row in enumerate(rows, start=1)]
    if least is None:
        said = join(tag("code", part) if i % 2 else part for i, part in enumerate(FIXED.split("`")))
    elif any(cut.shown for cut in cuts):
        said = join([HOW, f" A phase keeps at least {least:g} s."])
    else:
        said = Markup("Every demonstration is one phase. --phases sets their number.")
    found = [(line, PHASE.match(line)) for line in words]
    items = [
        tag("li", _chip(int(m[1]) - 1), f"{m[2].strip()}: " if m[2] else "", m[3]) for _, m in found if m is not None
    ]
    rest = [tag("li", line) for line, m in found if m is None]
    hero = tag(
        "header", tag("p", "Cuts", class_="eyebrow"), tag("h1", title), tag("p", said, class_="lead"),
        tag("ul", *items, class_="phases") if items else "",
        tag("details", tag("summary", "More about the policy"), tag("ul", *rest)) if rest else "", class_="hero",
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
    buttons = [
        tag("button", "Copy", type="button", id="copy"),
        tag("button", "Put all back", type="button", id="reset") if any(cut.movable for cut in cuts) else "",
    ]
    heading = tag("div", tag("strong", "The line that repeats this cut"), *buttons, class_="top")
    repeat = tag(
        "div", heading, tag("pre", tag("code", line, id="line")),
        tag("p", "Run it where segment was run.", class_="caption", id="told", role="status"),
        tag("noscript", "Without scripts the boundaries cannot be moved."),
    )  # fmt: skip
    body = tag(
        "body", bar(tag("a", name, href=f"#d{i}") for i, name in enumerate(names, start=1)),
        tag("main", hero, *each, tag("p", POINT, class_="caption")),
        tag("aside", repeat, class_="repeat"),
        json_script("cuts", data), tag("script", asset("theme.js"), asset("cuts.js")),
    )  # fmt: skip
    top = head(title, styles=("page.css", "cuts.css"))
    return "<!DOCTYPE html>\n" + tag("html", top, body, lang="en")


def hue(label: int) -> str:
    """Return the style with a phase's colour. Hues differ by the golden angle, which separates any number of them."""
    return f"--hue:{(215.0 + 137.5 * label) % 360.0:g}"


def _chip(label: int) -> Markup:
    return tag("b", label + 1, class_="chip", style=hue(label))


def _recording(number: int, name: str, row: Mapping[str, Any], cut: Cut, demonstration: Demonstration) -> Markup:
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
    title = tag("h2", f"{number}. ", name, " ", tag("span", f"{last - first:.2f} s", class_="badge"))
    followed = "found" in row and _pattern(row["found"]["labels"]) != _pattern(row["labels"])
    return tag(
        "section", title, note(FOLLOWED) if followed else "", tag("div", drawn, class_="card cut"),
        tag("ul", *figures, class_="boundaries") if figures else "", id=f"d{number}", class_="recording",
    )  # fmt: skip


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

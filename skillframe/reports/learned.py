"""What was learned: a skill in words and pictures from its plug-in, and its numbers as they stand in the file."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Any

from skillframe.errors import SkillframeError
from skillframe.extend.records import SkillType
from skillframe.extend.registry import registry
from skillframe.reports.markup import Markup, escape, image, join, note, number, table, tag
from skillframe.reports.sources import Chapter

PARTS = ("translation", "rotation")
LABEL = re.compile(r"(phase \d+: )?[a-z]{1,12}: ")


def learned_section(chapter: Chapter) -> Markup:
    """Every skill file of the folder."""
    if not chapter.skills:
        return note("There is no skill file here.")
    return join(skill_block(name, document) for name, document in chapter.skills.items())


def described(document: Mapping[str, Any]) -> tuple[list[str], str]:
    """The skill in words, a line each, and a sentence about why there are none (or "")."""
    try:
        kind = registry().skill(str(document.get("type")))
        return (
            (list(kind.describe(dict(document))), "")
            if kind.describe
            else ([], f"Skills of type {kind.name} come without a description.")
        )
    except SkillframeError as error:
        return [], f"The plug-in for this type of skill is not here ({error}); below are the file's numbers."
    except Exception as error:  # a plug-in's mistake must not take the report down
        return [], f"The plug-in could not describe it ({type(error).__name__}: {error}); below are the file's numbers."


def skill_block(name: str, document: Mapping[str, Any]) -> Markup:
    """One skill: words, pictures, numbers, where it comes from."""
    lines, trouble = described(document)
    words = tag("ul", *[tag("li", *labelled(line)) for line in lines], class_="words") if lines else ""
    pictures, more_trouble = _pictures(document)
    numbers = _numbers(document)
    folded = numbers if trouble else tag("details", tag("summary", "The numbers in the file"), numbers)
    return tag(
        "article", tag("h3", name, " ", tag("span", f"type {document.get('type', 'unknown')}", class_="badge")),
        note(trouble) if trouble else "", words, _origin(document), note(more_trouble) if more_trouble else "",
        tag("div", *pictures, class_="grid stacked") if pictures else "", folded, class_="skill",
    )  # fmt: skip


def labelled(line: str) -> list[object]:
    """A line of a description with what it is about, if it says so first, set off."""
    found = LABEL.match(line)
    return [tag("strong", found[0]), line[found.end() :]] if found else [line]


def _kind(document: Mapping[str, Any]) -> SkillType | None:
    try:
        return registry().skill(str(document.get("type")))
    except SkillframeError:
        return None


def _pictures(document: Mapping[str, Any]) -> tuple[list[Markup], str]:
    """The plug-in's drawings, as images, so that nothing in them can act on the page."""
    kind = _kind(document)
    if kind is None or kind.explain is None:
        return [], ""
    try:
        drawn = kind.explain(dict(document))
        return [image(i.title, i.caption, i.svg) for i in drawn], ""
    except Exception as error:  # see `described`
        return [], f"The plug-in could not draw it ({type(error).__name__}: {error})."


def _origin(document: Mapping[str, Any]) -> Markup:
    sources = document.get("learned_from")
    sources = sources if isinstance(sources, list) else []
    names = [str(s.get("file", "?")) for s in sources if isinstance(s, Mapping)]
    if not names:
        return Markup("")
    count = "one demonstration" if len(names) == 1 else f"{len(names)} demonstrations"
    return tag("p", f"Learned from {count}: {', '.join(names)}.", class_="caption")


def _numbers(document: Mapping[str, Any]) -> Markup:
    phases = document.get("phases")
    frame = document.get("frame")
    blocks = []
    if isinstance(frame, Mapping):
        blocks.append(table(("frame", "value"), [(key, value_text(v)) for key, v in sorted(frame.items())], numeric=9))
    for index, phase in enumerate(phases if isinstance(phases, list) else [], start=1):
        blocks.append(_phase(index, phase) if isinstance(phase, Mapping) else Markup(""))
    return join(blocks) if blocks else note("The file holds no phases.")


def _phase(index: int, phase: Mapping[str, Any]) -> Markup:
    parts = [name for name in PARTS if isinstance(phase.get(name), Mapping)]
    keys = sorted({key for part in parts for key in flat(phase[part])})
    rows = [(key.replace("_", " "), *(value_text(flat(phase[part]).get(key)) for part in parts)) for key in keys]
    rest = [
        (key.replace("_", " "), value_text(v))
        for key, v in sorted(flat({k: v for k, v in phase.items() if k not in parts}).items())
    ]
    return join([
        tag("h4", f"Phase {index}"),
        table(("", *parts), rows, numeric=9) if rows else "",
        table(("", "value"), rest, numeric=9) if rest else "",
    ])  # fmt: skip


def flat(values: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Nested tables as one, keys joined by a point."""
    result: dict[str, Any] = {}
    for key, value in values.items():
        if isinstance(value, Mapping):
            result |= flat(value, f"{prefix}{key}.")
        else:
            result[f"{prefix}{key}"] = value
    return result


def value_text(value: Any) -> Markup:
    """A JSON value for people: numbers rounded, matrices row by row, null as a dash."""
    if isinstance(value, bool):
        return escape("yes" if value else "no")
    if isinstance(value, int | float):
        return escape(number(float(value), 4) if math.isfinite(value) else value)
    if isinstance(value, list) and value and all(isinstance(v, Mapping) for v in value):
        return escape(f"{len(value)} records, drawn above")
    if isinstance(value, list) and value and all(isinstance(v, list) for v in value):
        return join((value_text(row) for row in value), "<br>")
    if isinstance(value, list):
        return (
            escape("(" + ", ".join(value_text(v) for v in value[:12]) + (", …" if len(value) > 12 else "") + ")")
            if value
            else escape("none")
        )
    return escape("–" if value is None else value)

"""Learned skills: words and pictures from their plug-in, and the file's numbers."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Any

from skillframe.errors import SkillframeError
from skillframe.extend import registry
from skillframe_reports.markup import Markup, escape, image, join, note, number, table, tag
from skillframe_reports.sources import Chapter

PARTS = ("translation", "rotation")
LABEL = re.compile(r"(phase \d+: )?[a-z]{1,12}: ")


def learned_section(chapter: Chapter) -> Markup:
    """Return the skill files of a folder."""
    if not chapter.skills:
        return note("There is no skill file here.")
    return join(skill_block(name, document) for name, document in chapter.skills.items())


def described(document: Mapping[str, Any]) -> tuple[list[str], str]:
    """Return a skill's description in lines, or a sentence on why there is none."""
    try:
        kind = registry().skill(str(document.get("type")))
        return (
            (list(kind.describe(dict(document))), "")
            if kind.describe
            else ([], f"Skills of type {kind.name} come without a description.")
        )
    except SkillframeError as error:
        return [], f"The plug-in for this type of skill is not here ({error}); below are the file's numbers."
    except Exception as error:  # a plug-in's error must not break the report
        return [], f"The plug-in could not describe it ({type(error).__name__}: {error}); below are the file's numbers."


def skill_block(name: str, document: Mapping[str, Any]) -> Markup:
    """Return one skill: words, pictures, numbers, origin."""
    lines, trouble = described(document)
    words = tag("ul", *[tag("li", *labelled(line)) for line in lines], class_="words") if lines else ""
    pictures, more_trouble = list[Markup](), ""
    try:
        explain = registry().skill(str(document.get("type"))).explain
    except SkillframeError:  # `described` says so
        explain = None
    try:
        drawn = explain(dict(document)) if explain is not None else ()
        pictures = [image(i.title, i.caption, i.svg) for i in drawn]  # images cannot run scripts
    except Exception as error:  # a plug-in's error must not break the report
        more_trouble = f"The plug-in could not draw it ({type(error).__name__}: {error})."
    phases = document.get("phases")
    frame = document.get("frame")
    blocks = []
    if isinstance(frame, Mapping):
        blocks.append(table(("frame", "value"), [(key, value_text(v)) for key, v in sorted(frame.items())], numeric=9))
    for index, phase in enumerate(phases if isinstance(phases, list) else [], start=1):
        blocks.append(_phase(index, phase) if isinstance(phase, Mapping) else Markup(""))
    numbers = join(blocks) if blocks else note("The file holds no phases.")
    folded = numbers if trouble else tag("details", tag("summary", "The numbers in the file"), numbers)
    return tag(
        "article", tag("h3", name, " ", tag("span", f"type {document.get('type', 'unknown')}", class_="badge")),
        note(trouble) if trouble else "", words, _origin(document), note(more_trouble) if more_trouble else "",
        tag("div", *pictures, class_="grid stacked") if pictures else "", folded, class_="skill",
    )  # fmt: skip


def labelled(line: str) -> list[object]:
    """Return a line with its leading label emphasised."""
    found = LABEL.match(line)
    return [tag("strong", found[0]), line[found.end() :]] if found else [line]


def _origin(document: Mapping[str, Any]) -> Markup:
    sources = document.get("learned_from")
    sources = sources if isinstance(sources, list) else []
    names = [str(s.get("file", "?")) for s in sources if isinstance(s, Mapping)]
    if not names:
        return Markup("")
    count = "one demonstration" if len(names) == 1 else f"{len(names)} demonstrations"
    return tag("p", f"Learned from {count}: {', '.join(names)}.", class_="caption")


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
    """Return nested tables as one, with keys joined by a point."""
    result: dict[str, Any] = {}
    for key, value in values.items():
        if isinstance(value, Mapping):
            result |= flat(value, f"{prefix}{key}.")
        else:
            result[f"{prefix}{key}"] = value
    return result


def value_text(value: Any) -> Markup:
    """Return a JSON value for display: rounded numbers, matrices by rows, null as a dash."""
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

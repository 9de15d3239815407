"""How the page came about: what ran, with which versions and seeds, from which files, and how to repeat it."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from typing import Any

from skillframe.report.learned import flat, value_text
from skillframe.report.markup import Markup, join, table, tag
from skillframe.report.sources import Chapter

SHOWN_ELSEWHERE = ("skills", "comparisons", "format")


def provenance_section(chapter: Chapter) -> Markup:
    """Facts, files, commands."""
    facts = _facts(chapter)
    parts = [
        tag("h3", "Repeat it"),
        tag("pre", "\n".join(commands(chapter))),
        tag("p", _place(chapter), class_="caption"),
    ]
    if facts:
        parts += [tag("h3", "What it depends on"), table(("", "value"), facts, numeric=9)]
    if chapter.hashes:
        rows = [(name, tag("code", digest)) for name, digest in chapter.hashes]
        parts.append(
            tag(
                "details",
                tag("summary", f"The {len(rows)} files this chapter was made from (SHA-256)"),
                table(("file", "hash"), rows, numeric=9),
            )
        )
    if chapter.spec_text:
        parts.append(tag("details", tag("summary", "campaign.toml"), tag("pre", chapter.spec_text)))
    return join(parts)


def _facts(chapter: Chapter) -> list[tuple[object, object]]:
    """The summary's figures but those that are counted from the rows, and the scene's parameters."""
    summary = {k: v for k, v in chapter.summary.items() if k not in SHOWN_ELSEWHERE}
    scene = {k: v for k, v in chapter.scene.items() if k in ("params", "analytic")}
    values: dict[str, Any] = {**flat(summary), **{f"scene.{k}": v for k, v in flat(scene).items()}}
    if not values and chapter.runs:
        values = _trace_facts(chapter.runs[0].trace.meta)
    return [(_label(key), value_text(value)) for key, value in sorted(values.items())]


def _trace_facts(meta: Mapping[str, Any]) -> dict[str, Any]:
    names = ("robot", "world", "params", "seed", "trial", "draws", "skill", "center_of_compliance", "versions")
    return flat({key: meta[key] for key in names if meta.get(key) is not None})


def _label(key: str) -> str:
    return {"wall_s": "wall time [s]"}.get(key, key.replace("_", " "))


def _place(chapter: Chapter) -> str:
    """Where the commands are typed: the page knows names of files and not where they lie, so that it can be moved."""
    if chapter.folder:
        return f"Typed in the folder that holds {chapter.folder}."
    return "Typed in the folder that holds the traces."


def commands(chapter: Chapter) -> list[str]:
    """What to type to get the same again."""
    if not chapter.folder:
        names = " ".join(shlex.quote(run.name) for run in chapter.runs)
        return [f"skillframe report {names} --out report.html"]
    folder = shlex.quote(chapter.folder)
    lines = []
    if chapter.spec:
        lines.append(f"skillframe campaign run {shlex.quote(chapter.folder + '/campaign.toml')} --out again")
    if chapter.results is not None and chapter.results.rows:
        trial = next((r.trial for r in chapter.results.rows if not r.success), chapter.results.rows[0].trial)
        lines.append(f"skillframe campaign replay {folder} {trial}")
    return [*lines, f"skillframe report {folder} --out report.html"]

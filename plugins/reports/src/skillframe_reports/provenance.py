"""Provenance: what ran, versions, seeds and files, and commands to repeat it."""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Mapping
from typing import Any

from skillframe.campaign import CODE
from skillframe_reports.learned import flat, value_text
from skillframe_reports.markup import Markup, join, number, table, tag
from skillframe_reports.quantities import quantity
from skillframe_reports.sources import Chapter

SHOWN_ELSEWHERE = ("skills", "comparisons", "scores", "format", "version", "versions", "hashes", "ran_again")
LABELS = {
    "complete": "all trials have run", "planned_trials": "trials per skill", "sessions": "times started or resumed",
    "stopped_after_trial": "stopped early after trial", "wall_s": "wall time [s]",
    "center_of_compliance": "centre of compliance [m, tool frame]",
}  # fmt: skip
Rows = list[tuple[object, object]]


def provenance_section(chapter: Chapter) -> Markup:
    """Return facts, files and commands."""
    unbroken = (join((tag("span", word, class_="word") for word in line.split(" ")), " ") for line in commands(chapter))
    parts = [tag("h3", "Repeat it"), tag("pre", join(unbroken, "\n")), tag("p", _place(chapter), class_="caption")]
    meta = chapter.runs[0].trace.meta if chapter.runs and not chapter.summary else {}
    names = ("robot", "world", "seed", "trial", "draws", "skill", "center_of_compliance")
    ran = {key: meta[key] for key in names if meta.get(key) is not None} if meta else chapter.summary
    scene = chapter.scene or meta
    versions = _versions(chapter, meta)
    facts = {
        "The campaign" if chapter.summary else "The run": _plain(
            {key: value for key, value in ran.items() if key not in SHOWN_ELSEWHERE and value is not None}
        ),
        "The world's parameters, in SI units where none stands": _physical(scene.get("params") or {}),
        "What theory says of it": _physical(scene.get("analytic") or {}),
        "Versions": _plain({name: text for name, text in versions.items() if not name.endswith(CODE)}),
    }
    blocks = [
        tag("div", tag("h4", title), table(("", ""), rows, numeric=9, class_="bare"), class_="card")
        for title, rows in facts.items()
        if rows
    ]
    if blocks:
        parts += [tag("h3", "What it depends on"), tag("div", *blocks, class_="grid stacked")]
    if chapter.hashes:
        count = f"{len(chapter.hashes)} files" if len(chapter.hashes) > 1 else "file"
        parts.append(_folded(f"The {count} this chapter was made from (SHA-256)", chapter.hashes))
    as_run = flat(chapter.summary.get("hashes") or {})
    if as_run:
        as_run |= {name: text for name, text in _versions(chapter, {}).items() if name.endswith(CODE)}
        rows = [(name.removeprefix("files."), str(digest)) for name, digest in sorted(as_run.items())]
        parts.append(_folded("What ran, as the campaign recorded it (SHA-256)", rows))
    if chapter.spec_text:
        parts.append(tag("details", tag("summary", "campaign.toml"), tag("pre", chapter.spec_text)))
    return join(parts)


def _folded(title: str, hashes: Iterable[tuple[str, str]]) -> Markup:
    rows = [(name, tag("code", digest)) for name, digest in hashes]
    return tag("details", tag("summary", title), table(("file", "hash"), rows, numeric=9))


def _versions(chapter: Chapter, meta: Mapping[str, Any]) -> Mapping[str, Any]:
    return chapter.summary.get("versions") or meta.get("versions") or {}


def _plain(values: Mapping[str, Any]) -> Rows:
    flattened = flat(values)
    quantities = {key for key in flattened if key.startswith("draws.")}
    drawn = _physical({key.removeprefix("draws."): flattened[key] for key in sorted(quantities)})
    rest: Rows = [
        (LABELS.get(key, key.replace("_", " ")), value_text(flattened[key]))
        for key in sorted(set(flattened) - quantities)
    ]
    return rest + drawn


def _physical(values: Mapping[str, Any]) -> Rows:
    rows: Rows = []
    for key, value in sorted(flat(values).items()):
        named = quantity(key.removesuffix("_rad"))
        if isinstance(value, bool) or not isinstance(value, int | float):
            rows.append((named.label, value_text(value)))
        else:
            rows.append((named.label, f"{number(named.factor * value, 4)} {named.unit}".strip()))
    return rows


def _place(chapter: Chapter) -> str:
    if chapter.folder:
        return f"Typed in the folder that holds {chapter.folder}."
    if any(_command(run.trace.meta) for run in chapter.runs):
        return "Runs are typed where they were first typed, the report in the folder that holds the traces."
    return "Typed in the folder that holds the traces."


def _command(meta: Mapping[str, Any]) -> str:
    return str(meta.get("command") or "")


def commands(chapter: Chapter) -> list[str]:
    """Return the commands that reproduce the results."""
    if not chapter.folder:
        names = [shlex.quote(run.name) for run in chapter.runs]
        typed = [(_command(run.trace.meta), name) for run, name in zip(chapter.runs, names, strict=True)]
        runs = [f"{command} --out {name}" for command, name in typed if command]
        return [*runs, f"skillframe report {' '.join(names)} --out report.html"]
    folder = shlex.quote(chapter.folder)
    lines = []
    if chapter.spec:
        lines.append(f"skillframe campaign run {shlex.quote(chapter.folder + '/campaign.toml')} --out again")
    if chapter.results is not None and chapter.results.rows:
        trial = next((r.trial for r in chapter.results.rows if not r.success), chapter.results.rows[0].trial)
        lines.append(f"skillframe campaign replay {folder} {trial}")
    return [*lines, f"skillframe report {folder} --out report.html"]

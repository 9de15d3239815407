"""Inputs of a report: campaign folders and trace files, read once and hashed.

A folder may hold `campaign.toml`, `results.csv`, `summary.json`, `scene.json`, `skills/`, `traces/`, `demonstrations/`;
a folder of such folders gives a chapter for each. The page names absent parts. Unreadable files are refused, except
traces and demonstrations in a folder, which are noted and left out.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from skillframe.campaign import Plan, edited_results, flatten, live_table, name_of, parse_axis, plan_of
from skillframe.config import read_toml
from skillframe.demonstration import Demonstration
from skillframe.errors import InputError, SkillframeError
from skillframe.execution import Trace
from skillframe.extend import FolderType, ReportFiles, registry
from skillframe.files.documents import read_json, read_text
from skillframe_reports.parts import MadeSection, files_of, has_sections, made_sections
from skillframe_reports.results import Results, read_results
from skillframe_reports.typical import telling, why_typical

CAMPAIGN = ("campaign.toml", "results.csv", "summary.json")
PARTS = (*CAMPAIGN, "skills", "traces", "demonstrations")
TABLES, SHOWN = ("hashes", "versions", "params", "analytic", "analytic_over", "setup"), ("summary.json", "scene.json")
REMOVE = "correct or remove it"
QUESTION = "question.json"
"""File in the folder of a certificate."""


class Run(NamedTuple):
    """A trace, its name, and why it is shown, or ""."""

    name: str
    trace: Trace
    why: str = ""


@dataclass(kw_only=True)
class Chapter:
    """One campaign, or separate traces.

    Attributes:
        name: for display.
        folder: its name; "" for separate traces.
        spec, spec_text: campaign.toml as values and as text.
        results: the table, or None.
        summary, scene: JSON files, empty if absent.
        skills: skill documents by file name.
        runs: the traces that are shown.
        traces: number of all traces.
        demonstrations: by file name.
        robot: robot.toml as run, empty if absent.
        force_limit: of the robot as run [N], or None.
        taught: metadata of demonstrations by sha256, and of those in skills/ also by file name.
        edited: a sentence if results.csv was changed after the campaign.
        sections: from plug-ins.
        notes: sentences on missing or omitted parts.
        hashes: (file, sha256) of everything read.
        kind: of an enclosing folder with a first page, or None.
        content: content of that folder by `kind`, or None.
    """

    name: str
    folder: str = ""
    spec: dict[str, Any] = field(default_factory=dict)
    spec_text: str = ""
    results: Results | None = None
    summary: dict[str, Any] = field(default_factory=dict)
    scene: dict[str, Any] = field(default_factory=dict)
    skills: dict[str, dict[str, Any]] = field(default_factory=dict)
    runs: list[Run] = field(default_factory=list)
    traces: int = 0
    demonstrations: dict[str, Demonstration] = field(default_factory=dict)
    robot: dict[str, Any] = field(default_factory=dict)
    force_limit: float | None = None
    taught: dict[str, dict[str, Any]] = field(default_factory=dict)
    edited: str = ""
    sections: list[MadeSection] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    hashes: list[tuple[str, str]] = field(default_factory=list)
    kind: FolderType | None = None
    content: Any = None

    @property
    def planned(self) -> int:
        """Planned runs, or 0 if unknown."""
        trials, skills = self.spec.get("trials"), self.spec.get("skills")
        return trials * len(skills) if isinstance(trials, int) and isinstance(skills, list) else 0


def scenes(chapter: Chapter) -> list[tuple[str, str]]:
    """Return each known (robot, world) of a chapter once."""
    found = [(chapter.spec or chapter.summary)] + [run.trace.meta for run in chapter.runs]
    pairs = [(str(f.get("robot") or ""), str(f.get("world") or "")) for f in found]
    named = [(name_of(robot), world) for robot, world in pairs]
    return list(dict.fromkeys(pair for pair in named if all(pair)))


def read_chapters(inputs: Sequence[Path]) -> list[Chapter]:
    """Return chapters in the order of arguments. Separate traces share the last one.

    Raises:
        InputError: a missing path, a folder without results, or a file that is no trace.
    """
    chapters, loose = [], []
    for path in inputs:
        if path.is_dir():
            kind = _kind_of(path)
            if kind is None:
                chapters += [read_folder(folder) for folder in _folders(path)]
                continue
            asked = kind.read(path)
            chapter = read_folder(path / asked.evidence)
            chapter.folder, chapter.kind, chapter.content = f"{asked.folder}/{asked.evidence}", kind, asked
            chapter.hashes += asked.hashes
            chapters.append(chapter)
        else:
            loose.append(path)
    return [*chapters, read_traces(loose)] if loose else chapters


def _kind_of(folder: Path) -> FolderType | None:
    """The kind of a folder with its own first page, or None.

    Raises:
        UnknownName: a certificate's folder without the plug-in that reads it; names the plug-in.
    """
    found = next((kind for kind in registry().records("folder") if kind.holds(folder)), None)
    return registry().record("folder", "claim") if found is None and (folder / QUESTION).is_file() else found


def campaign_folders(inputs: Sequence[Path]) -> list[Path]:
    """Return the folders that get a chapter each.

    Raises:
        InputError: a folder without results.
    """
    kinds = [(path, _kind_of(path)) for path in inputs if path.is_dir()]
    return [place for path, kind in kinds for place in ([kind.live(path)] if kind else _folders(path))]


def _folders(path: Path) -> list[Path]:
    inner = sorted(f for f in path.iterdir() if f.is_dir())
    for parts in (CAMPAIGN, PARTS):
        if _holds(path, parts):
            return [path]
        if found := [folder for folder in inner if _holds(folder, parts)]:
            return found
    raise InputError(path, "holds no results", f"give a campaign's folder (with {', '.join(PARTS)}) or trace files")


def _holds(folder: Path, parts: Sequence[str]) -> bool:
    return any((folder / part).exists() for part in parts)


def read_traces(paths: Sequence[Path]) -> Chapter:
    """Return a chapter of trace files, all of which must be readable."""
    chapter = Chapter(name="Single runs", traces=len(paths))
    for path in paths:
        chapter.runs.append(Run(path.name, load_trace(path)))
        _remember(chapter, path, path.name)
    if len(paths) == 1:
        chapter.name = f"A run of {chapter.runs[0].trace.meta.get('skill') or paths[0].name}"
    names = [path.name for path in paths]
    _add_sections(chapter, lambda: {p.name if names.count(p.name) == 1 else str(p): p for p in paths})
    return chapter


def _add_sections(chapter: Chapter, named: Callable[[], Mapping[str, Path]]) -> None:
    if not has_sections():
        return
    files = named()
    given = ReportFiles(title=chapter.name, files=files)
    chapter.sections = made_sections(given)
    known = {name for name, _ in chapter.hashes}
    for name in sorted(set(given.used) - known):
        _remember(chapter, files[name], name)


def read_folder(folder: Path) -> Chapter:
    """Return a chapter from a campaign's folder."""
    chapter = Chapter(name=folder.resolve().name, folder=folder.name or folder.resolve().name)
    if (folder / "campaign.toml").is_file():
        chapter.spec = read_toml(folder / "campaign.toml")
        chapter.spec_text = read_text(folder / "campaign.toml")
        chapter.name = str(chapter.spec.get("name") or chapter.name)
        _remember(chapter, folder / "campaign.toml", "campaign.toml")
    stored = _read_table(chapter, folder)
    chapter.summary = _json_if_there(chapter, folder / "summary.json")
    chapter.edited = "" if stored else edited_results(folder, chapter.summary)
    chapter.notes += [chapter.edited] if chapter.edited else []
    for key in ("unwatched", "ran_again"):
        if isinstance(text := chapter.summary.get(key), str):
            chapter.notes.append(f"{text[:1].upper()}{text[1:]}.")
    chapter.scene = _json_if_there(chapter, folder / "scene.json")
    for path in sorted({*folder.glob("*.skill.json"), *folder.glob("skills/*.json")}):
        chapter.skills[path.name] = _json_if_there(chapter, path)
    chapter.robot = next((read_toml(path) for path in sorted(folder.glob("robots/*/robot.toml"))), {})
    chapter.force_limit = _force_limit(chapter)
    _read_folder_traces(chapter, folder)
    _read_demonstrations(chapter, folder)
    _add_sections(chapter, lambda: files_of(folder))
    return chapter


def _read_table(chapter: Chapter, folder: Path) -> bool:
    """Read the table. Return True if it comes from stored rows of an unfinished campaign."""
    skills = chapter.spec.get("skills")
    text = live_table(folder, skills if isinstance(skills, list) else [], chapter.spec)
    path = folder / ("results.csv" if text is None else "rows.jsonl")
    if not path.is_file():
        return False
    chapter.results = read_results(path, *_declared(chapter.spec), text)
    chapter.notes += chapter.results.notes
    chapter.notes += [f"{skill}{chapter.results.mark(skill)}: it was decidedly worse than another, and the campaign is "
                      "a race; its rate is of these trials alone." for skill in chapter.results.left_out]  # fmt: skip
    _remember(chapter, path, path.name)
    return text is not None


def _force_limit(chapter: Chapter) -> float | None:
    """The limit from the scene or robot.toml, or None."""
    for place in (chapter.scene.get("setup"), chapter.robot):
        limits = place.get("limits") if isinstance(place, dict) else None
        limit = limits.get("force_n") if isinstance(limits, dict) else None
        if isinstance(limit, int | float):
            return float(limit)
    return None


def _declared(spec: dict[str, Any]) -> tuple[list[str], Plan | None]:
    """Varied quantities, and the plan before the first trial, or None if unknown."""
    vary, stop, trials, skills = (spec.get(key) for key in ("vary", "stop", "trials", "skills"))
    vary = vary if isinstance(vary, dict) else {}
    may_stop = "race" in spec or (isinstance(stop, dict) and stop.get("interval_width") is not None)
    try:
        given = flatten(vary, "vary")
        axes = {name: parse_axis(value, name) for name, value in given.items()}
    except InputError:
        return list(vary), None
    if not isinstance(trials, int) or not isinstance(skills, list):
        return list(given), None
    return list(given), plan_of(axes, trials=trials, skills=len(skills), may_stop=may_stop)


def load_trace(path: Path) -> Trace:
    """Return a trace with consistent arrays.

    Raises:
        InputError: not a trace, missing or unequal arrays, or no samples.
    """
    try:
        trace = Trace.load(path)
    except TypeError as error:
        raise InputError(
            path, f"lacks an array of a trace ({error})", "give a .npz written by skillframe run"
        ) from None
    lengths = {
        name: len(getattr(trace, name)) for name in ("time", "position", "quaternion", "wrench", "desired_position")
    }
    if len(set(lengths.values())) != 1 or not lengths["time"]:
        raise InputError(path, f"has arrays of length {lengths}", "give a whole trace")
    return trace


def _json_if_there(chapter: Chapter, path: Path) -> dict[str, Any]:
    if not path.is_file():
        return {}
    values = read_json(path, REMOVE)
    if not isinstance(values, dict):
        raise InputError(path, "holds no JSON object", REMOVE)
    for key in TABLES:
        if values.get(key) is not None and not isinstance(values[key], dict) and path.name in SHOWN:
            raise InputError(f"{path}: {key}", f"is {values[key]!r:.60}, not an object", REMOVE)
    _remember(chapter, path, path.name)
    return values


def _read_folder_traces(chapter: Chapter, folder: Path) -> None:
    """Read the typical success and the first failure of each skill, then others, up to four runs."""
    found = []
    for path in sorted((folder / "traces").glob("*.npz")):
        trace = _readable(chapter, path, load_trace)
        if trace is not None:
            found.append((path, trace))
    chapter.traces = len(found)
    order = {skill: i for i, skill in enumerate(chapter.results.skills if chapter.results else ())}

    def rank(pair: tuple[Path, Trace]) -> tuple[int, bool]:
        meta = pair[1].meta
        return order.get(str(meta.get("skill", "")), len(order)), not meta.get("success")

    for path, trace in sorted(telling(found, chapter.results), key=rank):
        chapter.runs.append(Run(path.name, trace, why_typical(trace, chapter.results)))
        _remember(chapter, path, f"traces/{path.name}")


def _read_demonstrations(chapter: Chapter, folder: Path) -> None:
    told = [d.get("learned_from") for d in chapter.skills.values()]
    wanted = {str(s.get("sha256")) for given in told if isinstance(given, list) for s in given if isinstance(s, dict)}
    for place in ("demonstrations", "skills"):
        for path in sorted((folder / place).glob("*")):
            if path.suffix in (".npz", ".csv"):
                digest = _digest(path)
                if place == "skills" or digest in wanted:
                    with suppress(SkillframeError):  # an unreadable one is reported where it would be drawn
                        chapter.taught[digest] = dict(read_demonstration(path).meta)
                if place == "skills" and digest in chapter.taught:
                    chapter.taught[path.name] = chapter.taught[digest]
    places = [*sorted((folder / "demonstrations").glob("*")), *sorted((folder / "skills").glob("*"))]
    paths = sorted({_digest(p): p for p in reversed(places) if p.suffix in (".npz", ".csv")}.values())
    for path in paths[:4]:
        demonstration = _readable(chapter, path, read_demonstration)
        if demonstration is not None:
            chapter.demonstrations[path.name] = demonstration
            _remember(chapter, path, f"{path.parent.name}/{path.name}")
    if len(paths) > 4:
        chapter.notes.append(f"{len(paths) - 4} more demonstrations are not drawn.")


def read_demonstration(path: Path) -> Demonstration:
    """Return a demonstration by the reader for its file name.

    Raises:
        InputError: no reader, or the reader refuses it.
    """
    for record in registry().records("reader"):
        if path.name.endswith(tuple(record.suffixes)):
            demonstration: Demonstration = record.read(path, {})
            return demonstration
    raise InputError(path, "has no reader", "see skillframe plugins")


def _readable(chapter: Chapter, path: Path, read: Callable[[Path], Any]) -> Any:
    try:
        return read(path)
    except SkillframeError as error:
        chapter.notes.append(f"{path.name} is left out: {str(error).removeprefix(str(path)).lstrip(': ')}.")
        return None


def _remember(chapter: Chapter, path: Path, name: str) -> None:
    chapter.hashes.append((name, _digest(path)))


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()

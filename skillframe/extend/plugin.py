"""A plug-in as found, what it may provide, and what is wrong with what it gives."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from skillframe.errors import SkillframeError, UnknownName
from skillframe.extend.contract import GROUP
from skillframe.extend.records import (
    CoordinatorType,
    DriveType,
    ExporterType,
    ReaderType,
    RobotType,
    RowType,
    ScoreType,
    SectionType,
    SegmenterType,
    SkillType,
    WorldType,
)  # fmt: skip

KINDS: Mapping[str, str] = {
    "skill": "skillframe_skills",
    "segmenter": "skillframe_segmenters",
    "coordinator": "skillframe_coordinators",
    "world": "skillframe_worlds",
    "reader": "skillframe_readers",
    "row": "skillframe_rows",
    "exporter": "skillframe_exporters",
    "score": "skillframe_scores",
    "robot": "skillframe_robots",
    "drive": "skillframe_drives",
    "section": "skillframe_sections",
}
"""Hook by kind of record."""
RECORDS: Mapping[str, type[Any]] = {
    "skill": SkillType,
    "segmenter": SegmenterType,
    "coordinator": CoordinatorType,
    "world": WorldType,
    "reader": ReaderType,
    "row": RowType,
    "exporter": ExporterType,
    "score": ScoreType,
    "robot": RobotType,
    "drive": DriveType,
    "section": SectionType,
}


@dataclass(slots=True, kw_only=True)
class Plugin:
    """One plug-in as found: where it comes from, what it provides, and its error if it has one.

    Attributes:
        name: of the entry point.
        distribution, version: what it was installed as.
        requires: what the distribution depends on, as its metadata says.
        provides: "skill:slide" and so on.
        error: what went wrong, in words; None if nothing did.
    """

    name: str
    distribution: str
    version: str
    requires: tuple[str, ...] = ()
    provides: list[str] = field(default_factory=list)
    error: str | None = None

    def fail(self, error: BaseException) -> None:
        """Keep an error beside those it already has. With `SKILLFRAME_STRICT_PLUGINS=1` raise it instead."""
        if os.environ.get("SKILLFRAME_STRICT_PLUGINS") == "1":
            raise error
        text = str(error) if isinstance(error, SkillframeError) else f"{type(error).__name__}: {error}"
        self.error = f"{self.error}; {text}" if self.error else text


class BadPlugin(SkillframeError):
    """A plug-in's entry module breaks the rules of the hooks. Says which and how."""


class OtherContract(SkillframeError):
    """A plug-in, or one of its records, was written for another skillframe. Says which and what to do."""


class PluginConflict(SkillframeError):
    """Two plug-ins provide one name. Both are named."""

    def __init__(self, kind: str, name: str, first: Plugin, second: Plugin) -> None:
        super().__init__(
            f"{kind} {name!r} is provided by both {first.distribution} {first.version} and {second.distribution} "
            f"{second.version}; uninstall one, or select plug-ins with SKILLFRAME_PLUGINS"
        )


def hook_problems(module: object) -> Iterator[BadPlugin]:
    """Hooks that would silently never be called: misspelt names, and hooks without the marker."""
    for name in dir(module):
        function = getattr(module, name, None)
        marker = getattr(function, f"{GROUP}_impl", None)
        marked = isinstance(marker, dict)
        optional = isinstance(marker, dict) and marker["optionalhook"]  # a hook of a newer core, declared as such
        if name not in KINDS.values() and callable(function) and (marked or name.startswith("skillframe_")):
            if not optional:
                yield BadPlugin(str(UnknownName("hook", name, KINDS.values())))
        elif name in KINDS.values() and not marked:
            yield BadPlugin(
                f"{name} lacks @hookimpl and would never be called; add it (from skillframe import hookimpl)"
            )


def checked(kind: str, answer: object) -> list[Any]:
    """The records that a hook gave, or `BadPlugin` that says what is wrong with them."""
    hook, expected = KINDS[kind], RECORDS[kind]
    if not hasattr(answer, "__iter__"):
        raise BadPlugin(f"{hook} gave {answer!r} instead of yielding {expected.__name__} records")
    records: list[Any] = list(answer)
    for record in records:
        if not isinstance(record, expected):
            raise BadPlugin(f"{hook} yielded {record!r}, not a {expected.__name__}")
        if not (isinstance(record.name, str) and record.name):
            raise BadPlugin(f"{hook} yielded a {expected.__name__} with the name {record.name!r}; give it a word")
    names = [record.name for record in records]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise BadPlugin(f"{hook} yielded the name {', '.join(twice)} more than once")
    return records

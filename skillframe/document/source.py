"""Skills as they are named on the command line and in campaigns: a skill file, or a kind of skill and demonstrations.

"peg.skill.json" is a skill file. "replay:demo1.npz" learns the kind `replay` from that file in memory; more files and
the learner's settings follow after commas: "lmc:a.npz,b.npz", "replay:demo1.npz,mode=absolute".

A name may hold whatever a file's name may hold. The text is a skill file if a file of that name exists, if it has no
colon, or if what stands before the first colon cannot be a kind ("results/v1:peg.json", "C:\\peg.json"). After the
colon, the longest run of parts that is the name of a file is one demonstration ("a,b.npz", "speed=2.npz"). What is left
is a setting if its KEY is a name, else a demonstration that somebody will find missing. All of this is ours.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

from skillframe.config import parse_setting
from skillframe.demonstration.record import Demonstration
from skillframe.demonstration.together import refuse_unfit
from skillframe.errors import InputError
from skillframe.extend.records import Document, LearnOptions, SkillType

NO_KIND = re.compile(r"[^:]*[/\\][^:]*:|:|[A-Za-z]:\\")
"""A text whose part before the first colon is no kind: a path, nothing, or a drive of Windows."""
SETTING = re.compile(r"\s*[A-Za-z_][\w.-]*\s*=")


def learned(skill: SkillType, demonstrations: Sequence[Demonstration], options: LearnOptions | None = None) -> Document:
    """A whole skill document, learned from demonstrations.

    Raises:
        InputError: this kind of skill is not learned, the demonstrations are of different tools or hold a stall, or
            its learner refuses them.
    """
    from skillframe.document.file import new_document

    if skill.learn is None:
        raise InputError(
            f"skill type {skill.name}", "is not learned from demonstrations", "write its skill file by hand"
        )
    refuse_unfit(demonstrations)
    body = skill.learn(demonstrations, options or LearnOptions())
    return new_document(skill, body, demonstrations)


class SkillSource(NamedTuple):
    """A skill's text, taken apart.

    Attributes:
        kind: of a skill that is learned on the spot; "" for a skill file.
        files: the skill file, or the demonstrations.
        settings: "KEY=VALUE" for the learner.
    """

    kind: str
    files: tuple[str, ...]
    settings: tuple[str, ...] = ()

    @property
    def text(self) -> str:
        """As it is written."""
        parts = ",".join((*self.files, *self.settings))
        return f"{self.kind}:{parts}" if self.kind else parts

    @property
    def label(self) -> str:
        """What the skill is called in a campaign's results: the text with file names instead of paths."""
        return _label(self)

    @property
    def name(self) -> str:
        """What a single run calls it: the skill file's name without its ending, or the kind."""
        return self.kind or Path(self.files[0]).name.removesuffix(".json").removesuffix(".skill")

    def moved(self, place: Callable[[str], str]) -> SkillSource:
        """With every file replaced."""
        return self._replace(files=tuple(place(file) for file in self.files))


@lru_cache(maxsize=1024)
def _label(source: SkillSource) -> str:
    """Kept, because tables ask for it once a row."""
    return source.moved(lambda file: Path(file).name).text


def parse_source(text: str, folder: Path | None = None) -> SkillSource:
    """Take a skill's text apart. The files are looked for and not opened.

    Args:
        text: "FILE.skill.json" or "TYPE:DEMO[,DEMO...][,KEY=VALUE...]".
        folder: what relative paths are relative to; None for the working directory.

    Raises:
        InputError: a kind without a demonstration.
    """
    base = folder or Path()
    kind, colon, rest = text.partition(":")
    if not colon or NO_KIND.match(text) or _is_file(base, text):
        return SkillSource("", (text,))
    files, settings = _parts(rest, base)
    if not files:
        raise InputError(text, "names no demonstration", f"write for example {kind}:demo.npz")
    return SkillSource(kind, tuple(files), tuple(settings))


def _parts(rest: str, base: Path) -> tuple[list[str], list[str]]:
    """Demonstrations and settings of what stands after the kind."""
    files: list[str] = []
    settings: list[str] = []
    parts = rest.split(",")
    while parts:
        ends = (end for end in range(len(parts), 0, -1) if _is_file(base, ",".join(parts[:end])))
        if end := next(ends, 0):
            files.append(",".join(parts[:end]))
        elif parts[0]:
            (settings if SETTING.match(parts[0]) else files).append(parts[0])
        parts = parts[end or 1 :]
    return files, settings


def _is_file(base: Path, name: str) -> bool:
    """Whether there is such a file. Also for texts that are too long for a name, or hold what no name may hold."""
    return os.path.isfile(base / name)


def load_skill(text: str, folder: Path | None = None) -> tuple[str, Document]:
    """Name and document of a skill from "FILE.skill.json" or "TYPE:DEMO[,DEMO...][,KEY=VALUE...]".

    Args:
        text: as typed.
        folder: what relative paths are relative to; None for the working directory.

    Raises:
        InputError: a file cannot be used, or no demonstration is given.
        UnknownName: no such kind of skill.
    """
    from skillframe.document.file import load

    source, base = parse_source(text, folder), folder or Path()
    return source.name, _learn(source, base) if source.kind else load(base / source.files[0])


def _learn(source: SkillSource, base: Path) -> Document:
    from skillframe.extend.reading import read_demonstration
    from skillframe.extend.registry import registry

    skill = registry().skill(source.kind)
    settings: dict[str, Any] = dict(parse_setting(part) for part in source.settings)
    return learned(skill, [read_demonstration(base / file) for file in source.files], LearnOptions(settings=settings))

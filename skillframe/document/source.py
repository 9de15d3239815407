"""Skills as they are named on the command line and in campaigns: a skill file, or a kind of skill and demonstrations.

"peg.skill.json" is a skill file. "replay:demo1.npz" learns the kind `replay` from that file in memory; more files and
the learner's settings follow after commas: "lmc:a.npz,b.npz", "replay:demo1.npz,mode=absolute".
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from skillframe.config import parse_setting
from skillframe.demonstration.record import Demonstration
from skillframe.demonstration.together import refuse_unfit
from skillframe.errors import InputError
from skillframe.extend.records import Document, LearnOptions, SkillType


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

    base = folder or Path()
    kind, colon, rest = text.partition(":")
    if not colon or (base / text).exists():
        return skill_name(text), load(base / text)
    return kind, _learn(kind, rest, text, base)


def skill_name(text: str) -> str:
    """What a skill is called in tables: the file's name without its ending, or the kind of skill."""
    kind, colon, _ = text.partition(":")
    return kind if colon else Path(text).name.removesuffix(".json").removesuffix(".skill")


def _learn(kind: str, rest: str, text: str, base: Path) -> Document:
    from skillframe.extend.reading import read_demonstration
    from skillframe.extend.registry import registry

    skill = registry().skill(kind)
    parts = [part for part in rest.split(",") if part]
    files = [part for part in parts if "=" not in part]
    settings: dict[str, Any] = dict(parse_setting(part) for part in parts if "=" in part)
    if not files:
        raise InputError(text, "names no demonstration", f"write for example {kind}:demo.npz")
    return learned(skill, [read_demonstration(base / file) for file in files], LearnOptions(settings=settings))

"""Baselines to compare learned skills with; so far `replay`, the recorded motion played again."""

from __future__ import annotations

from collections.abc import Iterable

from skillframe import hookimpl
from skillframe.records import SkillType


@hookimpl
def skillframe_skills() -> Iterable[SkillType]:
    """The baselines' kinds of skill."""
    from skillframe_baselines import document, replay

    yield SkillType(
        name="replay",
        summary="Plays one demonstration again, from where the tool is now or at its recorded place.",
        build=replay.build,
        check=replay.check,
        learn=document.learn,
        describe=document.describe,
        example=document.example,
    )

"""Baselines to compare learned skills with: `replay`, and the motion learners `dmp`, `gmr` and `seds`."""

from __future__ import annotations

from collections.abc import Iterable

from skillframe import hookimpl
from skillframe.records import SkillType


@hookimpl
def skillframe_skills() -> Iterable[SkillType]:
    """The baselines' kinds of skill."""
    from skillframe_baselines import dmp, document, gmr, replay, seds

    yield SkillType(
        name="replay",
        summary="Plays one demonstration again, from where the tool is now or at its recorded place.",
        build=replay.build,
        check=replay.check,
        learn=document.learn,
        settings=lambda: document.ReplaySettings,
        describe=document.describe,
        example=document.example,
    )
    yield SkillType(
        name="dmp",
        summary="Dynamic movement primitive: a spring to the demonstrated goal with a learned forcing term.",
        build=dmp.build,
        check=dmp.check,
        learn=dmp.learn,
        settings=lambda: dmp.DmpSettings,
        describe=dmp.describe,
        example=dmp.example,
    )
    yield SkillType(
        name="gmr",
        summary="Gaussian mixture regression: the mean motion and wrench over time.",
        build=gmr.build,
        check=gmr.check,
        learn=gmr.learn,
        settings=lambda: gmr.GmrSettings,
        describe=gmr.describe,
    )
    yield SkillType(
        name="seds",
        summary="A stable dynamical system of the pose that ends at the demonstrated goal.",
        build=seds.build,
        check=seds.check,
        learn=seds.learn,
        settings=lambda: seds.SedsSettings,
        describe=seds.describe,
    )

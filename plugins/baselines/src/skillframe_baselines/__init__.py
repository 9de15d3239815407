"""Baselines to compare learned skills with: `replay`, the motion learners `dmp`, `gmr`, `seds`, and `acp`."""

from __future__ import annotations

from collections.abc import Iterable

from skillframe import hookimpl
from skillframe.extend.records import Lazy, SkillType

skillframe_contract = "0.2"


@hookimpl
def skillframe_skills() -> Iterable[SkillType]:
    """The baselines' kinds of skill."""
    yield SkillType(
        name="replay",
        summary="Plays one demonstration again, from where the tool is now or at its recorded place.",
        build=Lazy("skillframe_baselines.replay:build"),
        check=Lazy("skillframe_baselines.replay:check"),
        learn=Lazy("skillframe_baselines.document:learn"),
        settings=Lazy("skillframe_baselines.document:ReplaySettings").load,
        describe=Lazy("skillframe_baselines.document:describe"),
        example=Lazy("skillframe_baselines.document:example"),
    )
    yield SkillType(
        name="dmp",
        summary="Dynamic movement primitive: a spring to the demonstrated goal with a learned forcing term.",
        build=Lazy("skillframe_baselines.dmp:build"),
        check=Lazy("skillframe_baselines.dmp:check"),
        learn=Lazy("skillframe_baselines.dmp:learn"),
        settings=Lazy("skillframe_baselines.dmp:DmpSettings").load,
        describe=Lazy("skillframe_baselines.dmp:describe"),
        example=Lazy("skillframe_baselines.dmp:example"),
    )
    yield SkillType(
        name="gmr",
        summary="Gaussian mixture regression: the mean motion and wrench over time.",
        build=Lazy("skillframe_baselines.gmr:build"),
        check=Lazy("skillframe_baselines.gmr:check"),
        learn=Lazy("skillframe_baselines.gmr:learn"),
        settings=Lazy("skillframe_baselines.gmr:GmrSettings").load,
        describe=Lazy("skillframe_baselines.gmr:describe"),
    )
    yield SkillType(
        name="seds",
        summary="A stable dynamical system of the pose that ends at the demonstrated goal.",
        build=Lazy("skillframe_baselines.seds:build"),
        check=Lazy("skillframe_baselines.seds:check"),
        learn=Lazy("skillframe_baselines.seds:learn"),
        settings=Lazy("skillframe_baselines.seds:SedsSettings").load,
        describe=Lazy("skillframe_baselines.seds:describe"),
    )
    yield SkillType(
        name="acp",
        summary="Estimator of an adaptive compliance policy: soft along the demonstrated force, stiff across it.",
        build=Lazy("skillframe_baselines.acp:build"),
        check=Lazy("skillframe_baselines.acp:check"),
        learn=Lazy("skillframe_baselines.acp:learn"),
        settings=Lazy("skillframe_baselines.acp:AcpSettings").load,
        describe=Lazy("skillframe_baselines.acp:describe"),
    )

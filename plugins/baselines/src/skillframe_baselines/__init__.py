"""Baselines to compare learned skills with: `replay`, the motion learners `dmp`, `gmr`, `seds`, and `acp`."""

from __future__ import annotations

from collections.abc import Iterable

from skillframe import hookimpl
from skillframe.extend import Lazy, SkillType

skillframe_contract = "0.2"


@hookimpl
def skillframe_skills() -> Iterable[SkillType]:
    """The baselines' kinds of skill, each with the same functions in a module of its name."""
    for name, summary, has_example in (
        ("replay", "Plays one demonstration again, from where the tool is now or at its recorded place.", True),
        ("dmp", "Dynamic movement primitive: a spring to the demonstrated goal with a learned forcing term.", True),
        ("gmr", "Gaussian mixture regression: the mean motion and wrench over time.", False),
        ("seds", "A stable dynamical system of the pose that ends at the demonstrated goal.", False),
        ("acp", "Estimator of an adaptive compliance policy: soft along the demonstrated force, stiff across it.",
         False),
    ):  # fmt: skip
        module = f"skillframe_baselines.{name}"
        yield SkillType(
            name=name,
            summary=summary,
            build=Lazy(f"{module}:build"),
            check=Lazy(f"{module}:build"),
            learn=Lazy(f"{module}:learn"),
            settings=Lazy(f"{module}:{name.title()}Settings").load,
            describe=Lazy(f"{module}:describe"),
            example=Lazy(f"{module}:example") if has_example else None,
        )

"""Plug-in for Linear Motion with Compliance (LMC), one phase of a compliant assembly skill in six dimensions.

Reading order: `intervals`, `work`, `pieces`, `posterior`, `axes`, `gains`, `learner` (their flow), `runtime` (the
skill). Listing plug-ins imports this module only.
"""

from __future__ import annotations

from collections.abc import Iterable

from skillframe import hookimpl
from skillframe.extend import Lazy, SkillType

skillframe_contract = "0.2"


@hookimpl
def skillframe_skills() -> Iterable[SkillType]:
    """The kind of skill of this plug-in."""
    yield SkillType(
        name="lmc",
        summary="linear motion with compliance: push one way, compliant in others, learned from forces",
        build=Lazy("skillframe_lmc.runtime:build"),
        check=Lazy("skillframe_lmc.phase:read_phase"),
        learn=Lazy("skillframe_lmc.learner:learn"),
        settings=Lazy("skillframe_lmc.settings:Settings").load,
        describe=Lazy("skillframe_lmc.describe:describe"),
        advice=Lazy("skillframe_lmc.advice:advice"),
        explain=Lazy("skillframe_lmc.explain:explain"),
        speed=Lazy("skillframe_lmc.phase:speed"),
    )

"""skillframe plug-in: Linear Motion with Compliance (LMC), one phase of a compliant assembly skill in six dimensions.

Read in this order: `intervals` (what is measured), `work`, `sectors` and `directions`, `axes`, `gains` (the four
decisions), `learner` (their flow, Fig. 6 of the overview paper), `runtime` (the skill that runs). This module is all
that is imported when plug-ins are listed.
"""

from __future__ import annotations

from collections.abc import Iterable

from skillframe.extend.hookspecs import hookimpl
from skillframe.extend.records import Lazy, SkillType

skillframe_contract = "0.2"


@hookimpl
def skillframe_skills() -> Iterable[SkillType]:
    """The kind of skill that this plug-in provides."""
    yield SkillType(
        name="lmc",
        summary="linear motion with compliance: push one way, give way in others, learned from forces",
        build=Lazy("skillframe_lmc.runtime:build"),
        check=Lazy("skillframe_lmc.phase:read_phase"),
        learn=Lazy("skillframe_lmc.learner:learn"),
        settings=Lazy("skillframe_lmc.settings:Settings").load,
        describe=Lazy("skillframe_lmc.describe:describe"),
        advice=Lazy("skillframe_lmc.advice:advice"),
        explain=Lazy("skillframe_lmc.explain:explain"),
        speed=Lazy("skillframe_lmc.phase:speed"),
    )

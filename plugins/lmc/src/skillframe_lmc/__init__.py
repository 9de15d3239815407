"""skillframe plug-in: Linear Motion with Compliance (LMC), one phase of a compliant assembly skill in six dimensions.

Read in this order: `intervals` (what is measured), `work`, `sectors` and `directions`, `axes`, `gains` (the four
decisions), `learner` (their flow, Fig. 6 of the overview paper), `runtime` (the skill that runs). This module is all
that is imported when plug-ins are listed.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from skillframe.extend.hookspecs import hookimpl
from skillframe.extend.records import Document, Illustration, LearnOptions, RowType, SkillType

if TYPE_CHECKING:
    from skillframe.demonstration.record import Demonstration
    from skillframe.skill import Skill


def _learn(demonstrations: Sequence[Demonstration], options: LearnOptions) -> Document:
    from skillframe_lmc.learner import learn

    return learn(demonstrations, options)


def _settings() -> type:
    from skillframe_lmc.settings import Settings

    return Settings


def _check(document: Document) -> None:
    from skillframe_lmc.phase import read_phase

    read_phase(document)


def _build(document: Document) -> Skill:
    from skillframe_lmc.runtime import build

    return build(document)


def _describe(document: Document) -> list[str]:
    from skillframe_lmc.describe import describe

    return describe(document)


def _explain(document: Document) -> list[Illustration]:
    from skillframe_lmc.explain import explain

    return explain(document)


@hookimpl
def skillframe_skills() -> Iterable[SkillType]:
    """The kind of skill that this plug-in provides."""
    yield SkillType(
        name="lmc",
        summary="linear motion with compliance: push one way, give way in others, learned from forces",
        build=_build,
        check=_check,
        learn=_learn,
        settings=_settings,
        describe=_describe,
        explain=_explain,
    )


@hookimpl
def skillframe_rows() -> Iterable[RowType]:
    """Published results that this plug-in computes."""
    from skillframe_lmc.published import row_types

    return row_types()

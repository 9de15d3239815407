"""skillframe plug-in: search by feel, when vision and model are not good enough to find the hole.

Read in this order: `contact` (what a blind demonstration says), `exploration` and `forces` (what is learned), `tour`
and `ergodic` (where to go), `smoothing` (how fast), `plan` (all of it as one trajectory), `watch` (has it fallen in?),
`runtime` (the skill that runs). `simple` holds the baselines. This module is all that is imported when plug-ins are
listed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING

from skillframe.extend.hookspecs import hookimpl
from skillframe.extend.records import Document, Illustration, LearnOptions, RowType, SkillType

if TYPE_CHECKING:
    from skillframe.demonstration.record import Demonstration
    from skillframe.frames import Float
    from skillframe.skill import Skill

SUMMARIES = {
    "search": "looks where a blindfolded person looked, with the forces that were felt, until it falls in",
    "spiral": "searches along an Archimedean spiral around the start, a baseline",
    "random_walk": "searches by random steps around the start, a baseline",
}


def _learn(kind: str) -> Callable[[Sequence[Demonstration], LearnOptions], Document]:
    def learn(demonstrations: Sequence[Demonstration], options: LearnOptions) -> Document:
        from skillframe_search.learner import learn

        return learn(demonstrations, options, kind)

    return learn


def _settings() -> type:
    from skillframe_search.learner import Settings

    return Settings


def _check(document: Document) -> None:
    from skillframe_search.phase import read_phase

    read_phase(document)


def _build(document: Document) -> Skill:
    from skillframe_search.runtime import build

    return build(document)


def _area(document: Document) -> Float:
    from skillframe_search.plan import area

    return area(document)


def _describe(document: Document) -> list[str]:
    from skillframe_search.describe import describe

    return describe(document)


def _explain(document: Document) -> list[Illustration]:
    from skillframe_search.pictures import explain

    return explain(document)


def _example(kind: str) -> Callable[[], Document]:
    def example() -> Document:
        from skillframe_search.example import example

        return example(kind)

    return example


@hookimpl
def skillframe_skills() -> Iterable[SkillType]:
    """The kinds of search."""
    for kind, summary in SUMMARIES.items():
        yield SkillType(
            name=kind, summary=summary, build=_build, check=_check, learn=_learn(kind), settings=_settings,
            describe=_describe, explain=_explain, example=_example(kind), area=_area,
        )  # fmt: skip


@hookimpl
def skillframe_rows() -> Iterable[RowType]:
    """Published results that this plug-in computes."""
    from skillframe_search.published import row_types

    return row_types()

"""skillframe plug-in: the phases of a demonstration, and policies that run them in sequence.

Read in this order: `windows` and `features` (what is looked at), `emission` (how a phase moves), `chain`, `transitions`
and `em` (the model and its fit), `merge` (which phases are one motion), `segmentation` (their flow), `gate` and
`observer` (which phase it is, online), `policy` (the skill that runs them). This module is all that is imported when
plug-ins are listed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from skillframe.extend.hookspecs import hookimpl
from skillframe.extend.records import Document, Illustration, LearnOptions, RowType, SegmenterType, SkillType

if TYPE_CHECKING:
    from skillframe.demonstration.record import Demonstration
    from skillframe.skill import Skill

Fit = Callable[["Sequence[Demonstration]", "int | None", Mapping[str, Any]], Document]


def _hmm(kind: str) -> Fit:
    def fit(demonstrations: Sequence[Demonstration], phases: int | None, settings: Mapping[str, Any]) -> Document:
        from skillframe_segmenter.segmentation import segment

        return segment(demonstrations, phases, settings, kind)

    return fit


def _zvc(demonstrations: Sequence[Demonstration], phases: int | None, settings: Mapping[str, Any]) -> Document:
    from skillframe_segmenter.zvc import fit

    return fit(demonstrations, phases, settings)


@hookimpl
def skillframe_segmenters() -> Iterable[SegmenterType]:
    """The ways of cutting demonstrations into phases that this plug-in provides."""
    yield SegmenterType(
        name="wrench_hmm", summary="phases with linear motion each; the contact wrench drives the transitions",
        fit=_hmm("wrench_hmm"),
    )  # fmt: skip
    yield SegmenterType(
        name="pose_hmm", summary="baseline: the same phases; the pose drives the transitions (Kroemer et al. 2015)",
        fit=_hmm("pose_hmm"),
    )  # fmt: skip
    yield SegmenterType(name="zvc", summary="baseline: cuts where the tool stands still", fit=_zvc)


def _build(document: Document) -> Skill:
    from skillframe_segmenter.policy import build

    return build(document)


def _check(document: Document) -> None:
    from skillframe_segmenter.document import check

    check(document)


def _learn(demonstrations: Sequence[Demonstration], options: LearnOptions) -> Document:
    from skillframe_segmenter.learning import learn

    return learn(demonstrations, options)


def _settings() -> type:
    from skillframe_segmenter.settings import PolicySettings

    return PolicySettings


def _describe(document: Document) -> list[str]:
    from skillframe_segmenter.describe import describe

    return describe(document)


def _explain(document: Document) -> list[Illustration]:
    from skillframe_segmenter.describe import explain

    return explain(document)


@hookimpl
def skillframe_skills() -> Iterable[SkillType]:
    """The kind of skill that this plug-in provides."""
    yield SkillType(
        name="policy",
        summary="phases in sequence, found in whole demonstrations; the contact wrench switches between them",
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
    from skillframe_segmenter.published import row_types

    return row_types()

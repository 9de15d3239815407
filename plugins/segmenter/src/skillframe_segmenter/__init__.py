"""skillframe plug-in: the phases of a demonstration, and policies that run them in sequence.

Read in this order: `windows` and `features` (what is looked at), `emission` (how a phase moves), `chain`, `transitions`
and `em` (the model and its fit), `merge` (which phases are one motion), `segmentation` (their flow), `gate` and
`observer` (which phase it is, online), `policy` (the skill that runs them). This module is all that is imported when
plug-ins are listed.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial

from skillframe.extend.hookspecs import hookimpl
from skillframe.extend.records import Lazy, SegmenterType, SkillType

skillframe_contract = "0.2"


@hookimpl
def skillframe_segmenters() -> Iterable[SegmenterType]:
    """The ways of cutting demonstrations into phases that this plug-in provides."""
    segment = Lazy("skillframe_segmenter.segmentation:segment")
    yield SegmenterType(
        name="wrench_hmm", summary="phases with linear motion each; the contact wrench drives the transitions",
        fit=partial(segment, kind="wrench_hmm"),
    )  # fmt: skip
    yield SegmenterType(
        name="pose_hmm", summary="baseline: the same phases; the pose drives the transitions (Kroemer et al. 2015)",
        fit=partial(segment, kind="pose_hmm"),
    )  # fmt: skip
    yield SegmenterType(
        name="zvc", summary="baseline: cuts where the tool stands still", fit=Lazy("skillframe_segmenter.zvc:fit")
    )


@hookimpl
def skillframe_skills() -> Iterable[SkillType]:
    """The kind of skill that this plug-in provides."""
    yield SkillType(
        name="policy",
        summary="phases in sequence, found in whole demonstrations; the contact wrench switches between them",
        build=Lazy("skillframe_segmenter.policy:build"),
        check=Lazy("skillframe_segmenter.document:check"),
        learn=Lazy("skillframe_segmenter.learning:learn"),
        settings=Lazy("skillframe_segmenter.settings:PolicySettings").load,
        describe=Lazy("skillframe_segmenter.describe:describe"),
        explain=Lazy("skillframe_segmenter.describe:explain"),
    )

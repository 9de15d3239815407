"""Plug-in that cuts demonstrations into phases, and policies that run the phases in sequence.

Reading order: `windows`, `features`, `emission`, `chain`, `transitions`, `em` (the model and its fit), `merge`,
`segmentation` (the flow), `gate`, `observer` (online), `policy` (the skill). Listing plug-ins imports this module only.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial

from skillframe import hookimpl
from skillframe.extend import Lazy, SegmenterType, SkillType

skillframe_contract = "0.2"


@hookimpl
def skillframe_segmenters() -> Iterable[SegmenterType]:
    """The segmenters of this plug-in."""
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
    """The kind of skill of this plug-in."""
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

"""skillframe plug-in: two arms under one impedance law, the coordinator `dual_arm`, and the world `dual_peg`."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from skillframe import hookimpl
from skillframe.extend.records import CoordinatorType, Document, LearnOptions, RowType, WorldType

if TYPE_CHECKING:
    from skillframe.demonstration.record import Demonstration
    from skillframe.frames import Float
    from skillframe.skill import Skill


def _learn(demonstrations: Sequence[Demonstration], options: LearnOptions) -> Document:
    from skillframe_dualarm.learner import learn

    return learn(demonstrations, options)


def _settings() -> type:
    from skillframe_dualarm.learner import Settings

    return Settings


def _check(document: Document) -> None:
    from skillframe_dualarm.document import read_phase

    read_phase(document)


def _build(document: Document) -> Skill:
    from skillframe_dualarm.runtime import build

    return build(document)


def _centers(document: Document) -> Float:
    import numpy as np

    from skillframe_dualarm.document import read_phase

    return np.array([arm.center_of_compliance for arm in read_phase(document).arms])


def _describe(document: Document) -> list[str]:
    from skillframe_dualarm.describe import describe

    return describe(document)


@hookimpl
def skillframe_coordinators() -> Iterable[CoordinatorType]:
    """The coordinator that this plug-in provides."""
    yield CoordinatorType(
        name="dual_arm",
        summary="two arms push one way and give way in others, each for itself or as one relative task",
        build=_build,
        check=_check,
        learn=_learn,
        settings=_settings,
        describe=_describe,
        centers=_centers,
    )


@hookimpl
def skillframe_worlds() -> Iterable[WorldType]:
    """The world that this plug-in provides."""
    from skillframe_dualarm import dual_peg

    yield WorldType(
        name="dual_peg", summary="a peg with a hemispherical tip, and its hole in a second arm's hand",
        params=dual_peg.DualPegParams, build=dual_peg.build,
    )  # fmt: skip


@hookimpl
def skillframe_rows() -> Iterable[RowType]:
    """Published results that this plug-in computes."""
    from skillframe_dualarm.published import row_types

    return row_types()

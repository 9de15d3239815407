"""Plug-in for two arms: the coordinator `dual_arm` and the world `dual_peg`."""

from __future__ import annotations

from collections.abc import Iterable

from skillframe import hookimpl
from skillframe.extend import CoordinatorType, Lazy, WorldType

skillframe_contract = "0.2"


@hookimpl
def skillframe_coordinators() -> Iterable[CoordinatorType]:
    """The coordinator of this plug-in."""
    yield CoordinatorType(
        name="dual_arm",
        summary="two arms push one way and are compliant in others, each for itself or as one relative task",
        build=Lazy("skillframe_dualarm.runtime:build"),
        check=Lazy("skillframe_dualarm.document:read_phase"),
        learn=Lazy("skillframe_dualarm.learner:learn"),
        settings=Lazy("skillframe_dualarm.learner:Settings").load,
        describe=Lazy("skillframe_dualarm.document:describe"),
        centers=Lazy("skillframe_dualarm.document:centers"),
    )


@hookimpl
def skillframe_worlds() -> Iterable[WorldType]:
    """The world of this plug-in."""
    from skillframe_dualarm import dual_peg

    yield WorldType(
        name="dual_peg", summary="a peg with a hemispherical tip, and its hole in a second arm's hand",
        params=dual_peg.DualPegParams, build=dual_peg.build,
    )  # fmt: skip

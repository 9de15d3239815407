"""What skillframe-benchmarks registers. This module is all that is imported when plug-ins are listed."""

from __future__ import annotations

from collections.abc import Iterable

from skillframe.extend.hookspecs import hookimpl
from skillframe.extend.outputs import ScoreType
from skillframe.extend.records import Lazy

skillframe_contract = "0.2"


@hookimpl
def skillframe_scores() -> Iterable[ScoreType]:
    """The two figures that AutoMate's check of an assembly looks at."""
    yield ScoreType(
        name="automate_height", unit="m", compute=Lazy("skillframe_benchmarks.scores:height"),
        summary="height of the held part's origin above where it is when assembled, at the end",
    )  # fmt: skip
    yield ScoreType(
        name="automate_distance", unit="m", compute=Lazy("skillframe_benchmarks.scores:distance"),
        summary="mean distance of four key points on a line of 1 m from where they are when assembled, at the end",
    )  # fmt: skip

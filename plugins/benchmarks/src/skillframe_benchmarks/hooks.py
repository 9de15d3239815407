"""Hooks of skillframe-benchmarks, the only module that listing plug-ins imports."""

from __future__ import annotations

from collections.abc import Iterable

from skillframe import hookimpl
from skillframe.extend import Lazy, ScoreType

skillframe_contract = "0.2"
INSERTION = (
    ("insertion_points", "1", "points of the AI for Industry Challenge, of 100"),
    ("jerk", "m/s^3", "mean magnitude of the jerk while the tool moves"),
    ("force_time", "s", "longest time on end with a measured force above 20 N"),
    ("energy", "J", "mechanical work of the hand, given and taken alike"),
    ("path", "m", "length of the tip's way"),
)
"""Name, unit and summary of the scores of an insertion."""


@hookimpl
def skillframe_scores() -> Iterable[ScoreType]:
    """The two figures of AutoMate's check, and an insertion's points with their parts."""
    yield ScoreType(
        name="automate_height", unit="m", compute=Lazy("skillframe_benchmarks.scores:height"),
        summary="height of the held part's origin above where it is when assembled, at the end",
    )  # fmt: skip
    yield ScoreType(
        name="automate_distance", unit="m", compute=Lazy("skillframe_benchmarks.scores:distance"),
        summary="mean distance of four key points on a line of 1 m from where they are when assembled, at the end",
    )  # fmt: skip
    for name, unit, summary in INSERTION:
        yield ScoreType(
            name=name, unit=unit, compute=Lazy(f"skillframe_benchmarks.insertion:{name.removeprefix('insertion_')}"),
            summary=summary,
        )  # fmt: skip

"""Plug-in for search by feel, where vision and model are too inaccurate to find the hole.

Reading order: `contact`, `exploration`, `forces` (learning), `tour`, `ergodic`, `smoothing`, `plan` (trajectory),
`runtime` (skill), `seat_learner`, `seat` (seating). Listing plug-ins imports this module only.
"""

from __future__ import annotations

from collections.abc import Iterable

from skillframe import hookimpl
from skillframe.extend import Lazy, SkillType

skillframe_contract = "0.2"


@hookimpl
def skillframe_skills() -> Iterable[SkillType]:
    """A search, and a seating that uses one."""
    yield SkillType(
        name="search",
        summary="searches where a blindfolded teacher searched, with the demonstrated forces, until the part falls in",
        build=Lazy("skillframe_search.runtime:build"),
        check=Lazy("skillframe_search.phase:read_phase"),
        learn=Lazy("skillframe_search.learner:learn"),
        settings=Lazy("skillframe_search.learner:Settings").load,
        describe=Lazy("skillframe_search.describe:describe"),
        explain=Lazy("skillframe_search.pictures:explain"),
        example=Lazy("skillframe_search.example:example"),
        area=Lazy("skillframe_search.plan:area"),
        exception=Lazy("skillframe_search.fallback:strategy"),
    )
    yield SkillType(
        name="seat",
        summary="seats a part: approaches, pushes as learned, searches where the push stalls, and pushes on",
        build=Lazy("skillframe_search.seat:build"),
        check=Lazy("skillframe_search.seat_document:check"),
        learn=Lazy("skillframe_search.seat_learner:learn"),
        settings=Lazy("skillframe_search.seat_learner:SeatSettings").load,
        describe=Lazy("skillframe_search.seat_words:describe"),
        explain=Lazy("skillframe_search.seat_words:explain"),
        example=Lazy("skillframe_search.example:seating"),
    )

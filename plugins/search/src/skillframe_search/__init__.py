"""skillframe plug-in: search by feel, when vision and model are not good enough to find the hole.

Read in this order: `contact` (what a blind demonstration says), `exploration` and `forces` (what is learned), `tour`
and `ergodic` (where to go), `smoothing` (how fast), `plan` (all of it as one trajectory), `watch` (has it fallen in?),
`runtime` (the skill that runs). `simple` holds the baselines, `deadband` what friction does to them. Then the skill
that seats a part, and searches where it stalls: `seat_document`, `seat_learner`, `fallback` (the search where none was
shown), `reach`, `seat`. This module is all that is imported when plug-ins are listed.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial

from skillframe.extend.hookspecs import hookimpl
from skillframe.extend.records import Lazy, SkillType

skillframe_contract = "0.2"

SUMMARIES = {
    "search": "looks where a blindfolded person looked, with the forces that were felt, until it falls in",
    "spiral": "searches along an Archimedean spiral around the start, a baseline",
    "random_walk": "searches by random steps around the start, a baseline",
}
STRATEGIES = ("search", "spiral")
"""Those that can find the way on where another skill has stalled."""


@hookimpl
def skillframe_skills() -> Iterable[SkillType]:
    """The kinds of search."""
    for kind, summary in SUMMARIES.items():
        yield SkillType(
            name=kind,
            summary=summary,
            build=Lazy("skillframe_search.runtime:build"),
            check=Lazy("skillframe_search.phase:read_phase"),
            learn=partial(Lazy("skillframe_search.learner:learn"), kind=kind),
            settings=Lazy("skillframe_search.learner:Settings").load,
            describe=Lazy("skillframe_search.describe:describe"),
            explain=Lazy("skillframe_search.pictures:explain"),
            example=partial(Lazy("skillframe_search.example:example"), kind),
            area=Lazy("skillframe_search.plan:area"),
            exception=partial(Lazy("skillframe_search.fallback:strategy"), kind=kind) if kind in STRATEGIES else None,
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

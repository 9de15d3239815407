"""Row 37 of the papers' results: one demonstration of the valley, and one of the hose coupler.

Row 29 asks it of the peg. Each demonstration starts from one side; the skill runs from both. The null is the same
push without the compliance that the world needs.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import radians

import numpy as np

from skillframe.extend.records import Document, RowResult, RowRun
from skillframe_papers.bars import ahead, counted, judged, together
from skillframe_papers.rows.skills import (
    REACH_M,
    SHARE,
    SPREAD_DEG,
    STIFF_N_M,
    STIFF_TURN_NM_RAD,
    Ran,
    by_hand,
    run,
    skills_of,
    stiff,
)

SEED = 72_000
LEARNED, NULL, HAND = "learned from one demonstration", "the same push, stiff", "by hand: straight down"


def _valley(job: RowRun) -> dict[str, Ran]:
    starts = {"start.offset_x": np.linspace(-REACH_M, REACH_M, job.count(13, 3)).tolist()}
    given = skills_of(job, "valley", 1, SEED)
    ways = {LEARNED: given, NULL: [stiff(s, "translation", STIFF_N_M) for s in given]}
    ways |= {} if job.quick else {HAND: [by_hand()]}
    return run(job, "valley", ways, starts, "free_tool")


def _coupler(job: RowRun, given: Sequence[Document]) -> dict[str, Ran]:
    starts = {"start.tilt_y": np.linspace(-radians(SPREAD_DEG), radians(SPREAD_DEG), job.count(4, 2)).tolist()}
    rigid = [stiff(s, "rotation", STIFF_TURN_NM_RAD) for s in given]
    ways = {LEARNED: given, NULL: rigid} | ({} if job.quick else {HAND: [by_hand(turn="y")]})
    return run(job, "hose_coupler", ways, starts, "free_tool", "tip")


def one(job: RowRun) -> RowResult:
    """Row 37: both worlds, each from one demonstration."""
    couplers = skills_of(job, "hose_coupler", 1, SEED)
    turns = sum(each["phases"][0]["rotation"]["desired_direction"] is not None for each in couplers)
    said = f" Of {len(couplers)} sets of the coupler {turns} learn a direction of turning, as if it had to be turned."
    return _told(job, {"valley": _valley(job), "hose coupler": _coupler(job, couplers)}, said)


def _told(job: RowRun, found: Mapping[str, Mapping[str, Ran]], said: str) -> RowResult:
    """The row, from successes by world and skill, and what is said of the coupler's turn."""
    ours = {world: each[LEARNED] for world, each in found.items()}
    shares = [judged(each.hits, each.trials, SHARE, quick=job.quick) for each in ours.values()]
    beside = all(ahead(ours[w].hits, each[NULL].hits, ours[w].trials, quick=job.quick) for w, each in found.items())
    return RowResult(
        ours="; ".join(f"{w} {counted(e.hits, e.trials)}, stiff {found[w][NULL].hits}" for w, e in ours.items()),
        verdict=together(shares, beside),
        values={world.replace(" ", "_"): each.hits / each.trials for world, each in ours.items()},
        head=("world", "skill", "trials", "sets without a failure"),
        rows=[
            (world, name, counted(each.hits, each.trials), each.sets)
            for world, runs in found.items() for name, each in runs.items()
        ],
        difference="Every demonstration starts 40 mm to one side, or tilted by +8 degrees. The coupler is steered at "
        "its tip, and stiff is stiff in rotation there. Pushes by hand show what compliance alone does."
        + said,
    )  # fmt: skip

"""Row 38: several demonstrations are concatenated, as in the papers.

skillframe weights demonstrations equally, by a posterior over pushes; `concatenated` is the papers' way. The
two demonstrations of a set start anywhere on either side, with unequal lengths. Null: the first alone.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import radians
from typing import Any, NamedTuple

import numpy as np

from skillframe.extend import RowResult, RowRun
from skillframe_papers.rows.harness import (
    DOWN,
    Ran,
    X,
    Y,
    compared,
    leads,
    lmc_if_any,
    one_axis,
    seeds,
    shown,
    teacher,
    world,
)
from skillframe_papers.rows.uneven_demonstrations import aimed

LITERAL, NULL, OURS = "concatenated (as published)", "the first demonstration alone", "ours"


class Task(NamedTuple):
    """A world, its varied start quantity with range, and the published result."""

    world: str
    quantity: str
    least: float
    most: float
    right: Callable[[Mapping[str, Any], Mapping[str, Any], float], bool]


def _valley(push: Mapping[str, Any], turn: Mapping[str, Any], friction: float) -> bool:
    """A push down both slopes of 45 degrees, not along them, and one axis across."""
    found = push["desired_direction"]
    if found is None or not one_axis(push, X):
        return False
    tilt, sideways = abs(np.arctan2(found[0], -found[2])), abs(found[1])
    return bool(tilt < radians(45.0) - np.arctan(friction) and sideways < np.sin(np.arctan(friction)))


def _coupler(push: Mapping[str, Any], turn: Mapping[str, Any], friction: float) -> bool:
    """A push with one compliant axis, and no turning direction but compliance about y."""
    turns_about_y = turn["desired_direction"] is None and not turn["fully_compliant"] and one_axis(turn, Y)
    return turns_about_y and push["desired_direction"] is not None and len(push["compliant_axes"]) == 1


def _peg(push: Mapping[str, Any], turn: Mapping[str, Any], friction: float) -> bool:
    """The same, with the push within 10 degrees of the hole's axis and compliant along x."""
    if not _coupler(push, turn, friction) or not one_axis(push, X):
        return False
    return bool(np.dot(push["desired_direction"], DOWN) > np.cos(radians(10.0)))


TASKS = {
    "valley": Task("valley", "start.offset_x", 0.01, 0.06, _valley),
    "peg": Task("peg_in_hole", "start.tilt_y", radians(3.0), radians(8.0), _peg),
    "hose coupler": Task("hose_coupler", "start.tilt_y", radians(3.0), radians(8.0), _coupler),
}


def concatenated(job: RowRun) -> RowResult:
    """Row 38: sets that teach the published result, by way of concatenation."""
    sets, friction = job.count(20, 1), float(job.settings["world.friction"])
    found: dict[str, dict[str, int]] = {}
    for name, task in TASKS.items():
        hits = dict.fromkeys((LITERAL, NULL, OURS), 0)
        for seed in seeds(job, 73_000, sets):
            rng = np.random.default_rng([seed, 0])
            first = rng.choice([-1.0, 1.0])
            starts = [{task.quantity: float(side * rng.uniform(task.least, task.most))} for side in (first, -first)]
            scene = world(job, task.world)
            given = shown(aimed(scene, np.array(scene.task.direction), starts), teacher(job), count=2, seed=seed)
            documents = {
                LITERAL: lmc_if_any(given, settings={"concatenated": True}),
                NULL: lmc_if_any(given[:1], settings={"concatenated": True}), OURS: lmc_if_any(given),
            }  # fmt: skip
            for way, document in documents.items():
                phase = document and document["phases"][0]
                hits[way] += bool(phase and task.right(phase["translation"], phase["rotation"], friction))
        found[name] = hits
        job.tell(f"{name}: {', '.join(f'{way} {n}' for way, n in hits.items())} of {sets}")
    return result(job, found, sets)


def result(job: RowRun, found: Mapping[str, Mapping[str, int]], sets: int) -> RowResult:
    """Row 38 of sets that teach the published result, by world and way."""
    ours = {name: Ran.of(hits[LITERAL], sets) for name, hits in found.items()}
    total = {way: Ran.of(sum(h[way] for h in found.values()), sets * len(found)) for way in (LITERAL, NULL, OURS)}
    literal, null, other = total.values()
    better = "ours is ahead" if leads(job, other, literal) else "it is ahead" if leads(job, literal, other) else ""
    return RowResult(
        ours=f"as published from concatenation: {'; '.join(f'{name} {each}' for name, each in ours.items())}; null: "
        f"{NULL}, {null.hits} of {null.trials}; ours {other.hits}",
        verdict=compared(job, ours.values(), leads(job, literal, null)),
        values={"share": literal.share, "ours": other.share}, head=("sets of two", *found, "all"),
        rows=[
            (way, *(str(Ran.of(hits[way], sets)) for hits in found.values()), str(each)) for way, each in total.items()
        ],
        difference=f"Of concatenation and ours, {better or 'neither is ahead'} by 95 % intervals. Starts are drawn at "
        "random on either side, which is ours. The papers do not print how a direction is chosen among those that are "
        "left: as for ours, the one that lies deepest.",
    )  # fmt: skip

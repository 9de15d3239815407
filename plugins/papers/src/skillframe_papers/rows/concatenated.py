"""Row 38 of the papers' results: several demonstrations are concatenated, as the papers print it.

Ours lets each demonstration count as much, looks at contact modes and at where the demonstrations headed; the papers
put all intervals one behind another. `concatenated` of the learner's settings is the papers' way. Two demonstrations a
set start anywhere on either side, so that one may be much longer than the other. Null: the first of them alone. Beside
it stands ours, on the same sets.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import radians
from typing import Any, NamedTuple

import numpy as np

from skillframe.demonstration.record import Demonstration
from skillframe.document.source import learned
from skillframe.errors import InputError
from skillframe.execution.prepare import load_robot_model, load_world
from skillframe.extend.records import Document, LearnOptions, RowResult, RowRun
from skillframe.extend.registry import registry
from skillframe.frames import Float
from skillframe.teaching.sessions import record
from skillframe.teaching.teacher import TeacherSettings
from skillframe_papers.bars import ahead, counted, judged, together
from skillframe_papers.rows.uneven import aimed

SEED = 73_000
SETS, QUICK_SETS = 20, 1
SHARE = 0.9
DOWN, X, Y = np.array([0.0, 0.0, -1.0]), np.eye(3)[0], np.eye(3)[1]
WITHIN_DEG, AXIS_DEG = 10.0, 20.0
LITERAL, NULL, OURS = "concatenated (as published)", "the first demonstration alone", "ours"


class Task(NamedTuple):
    """A world, the quantity in which its starts differ, how far off they are, and what is published of it."""

    world: str
    quantity: str
    least: float
    most: float
    right: Callable[[Mapping[str, Any], Mapping[str, Any], float], bool]


def near(direction: Any, wanted: Float, within_deg: float) -> bool:
    """Whether a direction is there and within some degrees of another one."""
    return direction is not None and bool(np.dot(direction, wanted) > np.cos(radians(within_deg)))


def one_axis(part: Mapping[str, Any], wanted: Float) -> bool:
    """Exactly one compliant axis, within 20 degrees of one (3,), whichever way it points."""
    axes = part["compliant_axes"]
    return len(axes) == 1 and bool(abs(np.dot(axes[0], wanted)) > np.cos(radians(AXIS_DEG)))


def _valley(push: Mapping[str, Any], turn: Mapping[str, Any], friction: float) -> bool:
    """A push that slides down both slopes of 45 degrees, and not along them, and one axis across."""
    found = push["desired_direction"]
    if found is None or not one_axis(push, X):
        return False
    tilt, sideways = abs(np.arctan2(found[0], -found[2])), abs(found[1])
    return bool(tilt < radians(45.0) - np.arctan(friction) and sideways < np.sin(np.arctan(friction)))


def _peg(push: Mapping[str, Any], turn: Mapping[str, Any], friction: float) -> bool:
    """A push within 10 degrees of the hole's axis, no direction of turning, free along x and about y."""
    return near(push["desired_direction"], DOWN, WITHIN_DEG) and _turns_about_y(turn) and one_axis(push, X)


def _coupler(push: Mapping[str, Any], turn: Mapping[str, Any], friction: float) -> bool:
    """A push, no direction of turning, one axis each."""
    return push["desired_direction"] is not None and _turns_about_y(turn) and len(push["compliant_axes"]) == 1


def _turns_about_y(turn: Mapping[str, Any]) -> bool:
    return turn["desired_direction"] is None and not turn["fully_compliant"] and one_axis(turn, Y)


TASKS = {
    "valley": Task("valley", "start.offset_x", 0.01, 0.06, _valley),
    "peg": Task("peg_in_hole", "start.tilt_y", radians(3.0), radians(8.0), _peg),
    "hose coupler": Task("hose_coupler", "start.tilt_y", radians(3.0), radians(8.0), _coupler),
}


def shown(job: RowRun, task: Task, index: int) -> list[Demonstration]:
    """Two demonstrations, one from either side, from anywhere there."""
    seed = SEED + 1000 * job.seed + index
    rng = np.random.default_rng([seed, 0])
    first = rng.choice([-1.0, 1.0])
    starts = [{task.quantity: float(side * rng.uniform(task.least, task.most))} for side in (first, -first)]
    scene = load_world(task.world, {"friction": job.settings["world.friction"]})
    person = TeacherSettings(aim_noise=radians(job.settings["teacher.aim_noise_deg"]))
    given = record(
        load_robot_model("free_tool"), aimed(scene, np.array(scene.task.direction), starts), person, count=2, seed=seed
    )
    return list(given.demonstrations)


def learn(given: Sequence[Demonstration], **settings: bool) -> Document | None:
    """The one phase that is learned, or None where the learner refuses."""
    try:
        document = learned(registry().skill("lmc"), list(given), LearnOptions(settings=settings))
    except InputError:  # a refusal teaches nothing
        return None
    phase: Document = document["phases"][0]
    return phase


def concatenated(job: RowRun) -> RowResult:
    """Row 38: sets that teach what is published, by the way they are taken together."""
    sets, friction = job.count(SETS, QUICK_SETS), float(job.settings["world.friction"])
    found: dict[str, dict[str, int]] = {}
    for name, task in TASKS.items():
        hits = dict.fromkeys((LITERAL, NULL, OURS), 0)
        for i in range(sets):
            given = shown(job, task, i)
            phases = {
                LITERAL: learn(given, concatenated=True), NULL: learn(given[:1], concatenated=True), OURS: learn(given)
            }  # fmt: skip
            for way, phase in phases.items():
                hits[way] += phase is not None and task.right(phase["translation"], phase["rotation"], friction)
        found[name] = hits
        job.tell(f"{name}: {', '.join(f'{way} {n}' for way, n in hits.items())} of {sets}")
    return _told(job, found, sets)


def _told(job: RowRun, found: Mapping[str, Mapping[str, int]], sets: int) -> RowResult:
    """The row, from how many sets teach what is published, by world and way."""
    shares = [judged(hits[LITERAL], sets, SHARE, quick=job.quick) for hits in found.values()]
    total = {way: sum(hits[way] for hits in found.values()) for way in (LITERAL, NULL, OURS)}
    count = sets * len(found)
    beside = ahead(total[LITERAL], total[NULL], count, quick=job.quick)
    told = "; ".join(f"{name} {counted(hits[LITERAL], sets)}" for name, hits in found.items())
    lead = {(a, b): ahead(total[a], total[b], count, quick=job.quick) for a, b in ((OURS, LITERAL), (LITERAL, OURS))}
    better = "ours is ahead" if lead[OURS, LITERAL] else "it is ahead" if lead[LITERAL, OURS] else "neither is ahead"
    return RowResult(
        ours=f"as published from concatenation: {told}; null: {NULL}, {total[NULL]} of {count}; ours {total[OURS]}",
        verdict=together(shares, beside), values={"share": total[LITERAL] / count, "ours": total[OURS] / count},
        head=("sets of two", *found, "all"),
        rows=[
            (way, *(counted(hits[way], sets) for hits in found.values()), counted(total[way], count)) for way in total
        ],
        difference=f"Of concatenation and ours, {better} by 95 % intervals. Starts are drawn at random on either side, "
        "which is ours. The papers do not print how a direction is chosen among those that are left: as for ours, the "
        "one that lies deepest.",
    )  # fmt: skip

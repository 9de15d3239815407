"""Rows 32 and 33: whole demonstrations are cut into phases, and an arm does the whole task.

Three demonstrations with a free tool, cut without a given number of phases, become a policy for a Panda; the fixture
moves in every run. Nulls: one phase, and the first demonstration replayed, shifted or in place. Beside them: cut in the
middle.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict
from math import radians
from typing import NamedTuple

import numpy as np
from skillframe_baselines.replay import ReplaySettings

from skillframe.demonstration import Demonstration
from skillframe.document import learned
from skillframe.errors import InputError
from skillframe.execution import Setup, load_robot_model, prepare
from skillframe.extend import Document, LearnOptions, RowResult, RowRun, registry
from skillframe.frames import Float
from skillframe.sequence import Part, Sequence
from skillframe.skill import Skill
from skillframe.world import Scene
from skillframe_papers.rows.harness import (
    HEAD,
    Ran,
    TaughtSet,
    compared,
    executed,
    leads,
    lines,
    lmc,
    not_behind,
    seeds,
    shown,
    successes,
    teacher,
    world,
)

ONE, SHIFTED, PLACED, HALVES = "one phase", "replay, shifted", "replay, in its place", "cut in the middle"
NULLS = (ONE, SHIFTED, PLACED)


class Whole(NamedTuple):
    """A task of two stages.

    Attributes:
        world, params: of the task.
        moved: largest errors of the fixture, even both ways [m, rad].
        center: of compliance of runs; None: where it was learned.
        lift: of all starts, against collision with the moved fixture [m].
    """

    world: str
    params: Mapping[str, float]
    moved: Mapping[str, float]
    center: str | None
    lift: float = 0.0


TASKS = {
    "hose coupler": Whole(
        "hose_coupler", {"interlock": 0.7}, {"fixture.tilt_y": radians(3.0), "fixture.offset_z": 0.005}, "tip", 0.006
    ),
    "corner": Whole("corner", {}, {"fixture.offset_x": 0.01, "fixture.offset_y": 0.01}, None),
}


def _learned(given: list[Demonstration], way: str) -> tuple[Document, ...]:
    if way == "policy":
        return (learned(registry().skill("policy"), given, LearnOptions()),)
    if way == ONE:
        return (lmc(given),)
    if way == HALVES:
        middle = [(d, 0.5 * float(d.time[0] + d.time[-1])) for d in given]
        return lmc([d.between(stop=at) for d, at in middle]), lmc([d.between(start=at) for d, at in middle])
    settings = asdict(ReplaySettings(mode="absolute" if way == PLACED else "shifted"))
    return (learned(registry().skill("replay"), given[:1], LearnOptions(settings=settings)),)


def _ways(
    given: list[Demonstration], task: Whole, scene: Scene, names: Iterable[str]
) -> dict[str, tuple[Skill, Setup] | None]:
    found = dict[str, tuple[Skill, Setup] | None]()
    for name in names:
        try:
            documents = _learned(given, name)
        except InputError:  # a refusal teaches nothing
            found[name] = None
            continue
        (first, setup), *others = (_ready(scene, each, task.center) for each in documents)
        parts = [Part(f"part {i + 1}", each) for i, each in enumerate((first, *(skill for skill, _ in others)))]
        found[name] = (Sequence(parts) if others else first(), setup)
    return found


def _ready(scene: Scene, document: Document, center: str | None) -> tuple[Callable[[], Skill], Setup]:
    """How to build a document's skill for a Panda, as often as it is needed, and its setup."""
    robot = load_robot_model("panda")
    return lambda: prepare(robot, scene, document, center)[0], prepare(robot, scene, document, center)[1]


def draws(task: Whole, scene: Scene, count: int, seed: int) -> dict[str, Float]:
    """Starts as they were shown, in turn, and places of the fixture."""
    rng, starts = np.random.default_rng([seed, 1]), scene.task.starts
    sampled = {key: rng.uniform(-by, by, count) for key, by in task.moved.items()}
    for i in range(count):
        for key, value in starts[i % len(starts)].items():
            sampled.setdefault(key, np.zeros(count))[i] += value
    if task.lift:
        sampled["start.offset_z"] = sampled.get("start.offset_z", np.zeros(count)) + task.lift
    return sampled


def _run(job: RowRun, name: str) -> RowResult:
    task, names = TASKS[name], ("policy", ONE, SHIFTED) if job.quick else ("policy", *NULLS, HALVES)
    scene, sets = world(job, task.world, **task.params), list[TaughtSet]()
    for seed in seeds(job, 67_000, job.count(4, 1)):
        given = shown(scene, teacher(job), count=3, seed=seed, duration_s=20.0)
        where = draws(task, scene, job.count(6, 2), seed)
        sets.append(TaughtSet(_ways(given, task, scene, names), where, (seed, 2)))
    return result(job, successes(executed(job, scene, sets, duration_s=20.0)))


def result(job: RowRun, found: Mapping[str, Ran]) -> RowResult:
    """Rows 32 and 33 of runs by way."""
    ours, nulls = found["policy"], {name: found[name] for name in NULLS if name in found}
    halves = ""
    if HALVES in found:
        fewer = "fewer" if leads(job, ours, found[HALVES]) else "not fewer"
        halves = f"; without a segmenter, {HALVES}, {found[HALVES]}, by 95 % intervals {fewer}"
    return RowResult(
        ours=f"{ours} runs of a Panda do the whole task; nulls: "
        + ", ".join(f"{name} {each.hits}" for name, each in nulls.items())
        + halves,
        verdict=compared(job, [ours], not not_behind(job, ours, nulls)), values={"share": ours.share}, head=HEAD,
        rows=lines(found), difference="Shown with a free tool. A replay is of a set's first demonstration.",
    )  # fmt: skip


def coupler(job: RowRun) -> RowResult:
    """Row 32: lower, then interlock."""
    return _run(job, "hose coupler")


def corner(job: RowRun) -> RowResult:
    """Row 33: set the box down, then push it into the corner."""
    return _run(job, "corner")

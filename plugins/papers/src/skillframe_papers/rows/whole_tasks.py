"""Rows 32 and 33 of the papers' results: whole demonstrations are cut into phases, and an arm does the whole task.

Three demonstrations a set, shown with a free tool and cut without being told how many phases there are, become a policy
that a Panda runs. The fixture stands elsewhere in every run. Nulls: the same demonstrations learned as one phase, and
the first of them played again, from where the tool is or at its recorded place. Cut in the middle stands beside them:
it has phases, too, and no segmenter.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict
from math import radians
from typing import Any, NamedTuple

import numpy as np
from skillframe_baselines.document import ReplaySettings

from skillframe.demonstration.record import Demonstration
from skillframe.document.source import learned
from skillframe.errors import InputError
from skillframe.execution.executor import Setup
from skillframe.execution.prepare import load_robot_model, load_world, prepare
from skillframe.extend.records import LearnOptions, RowResult, RowRun, Verdict
from skillframe.extend.registry import registry
from skillframe.frames import Float
from skillframe.sequence import Part, Sequence
from skillframe.skill import Skill
from skillframe.teaching.sessions import record
from skillframe.teaching.teacher import TeacherSettings
from skillframe.world.scene import Scene
from skillframe_papers.bars import ahead, counted, judged, together
from skillframe_papers.rows.blocks import ran_made
from skillframe_papers.rows.skills import Ran

SEED, EACH = 67_000, 3
SETS, QUICK_SETS = 4, 1
STARTS, QUICK_STARTS = 6, 2
SHARE, LONGEST_S = 0.9, 20.0
ONE, SHIFTED, PLACED, HALVES = "one phase", "replay, shifted", "replay, in its place", "cut in the middle"
NULLS = (ONE, SHIFTED, PLACED)
QUICK_ONLY = ("policy", ONE, SHIFTED)


class Whole(NamedTuple):
    """A task of two stages.

    Attributes:
        world, params: where it is done.
        moved: the fixture stands off by so much, evenly both ways [m, rad].
        center: of compliance when it runs. None: where it was learned.
    """

    world: str
    params: Mapping[str, float]
    moved: Mapping[str, float]
    center: str | None


TASKS = {
    "hose coupler": Whole(
        "hose_coupler", {"interlock": 0.7}, {"fixture.tilt_y": radians(3.0), "fixture.offset_z": 0.005}, "tip"
    ),
    "corner": Whole("corner", {}, {"fixture.offset_x": 0.01, "fixture.offset_y": 0.01}, None),
}

Made = Callable[[], tuple[Skill, Setup]]
Rngs = list[np.random.Generator]


def _methods(shown: list[Demonstration], task: Whole, scene: Scene, names: Iterable[str]) -> dict[str, Made]:
    """By name: a method's skill and how it runs. What refuses the demonstrations is not among them."""
    robot = load_robot_model("panda")

    def made(kind: str, given: list[Demonstration], **settings: Any) -> Made:
        document = learned(registry().skill(kind), given, LearnOptions(settings=settings))
        return lambda: prepare(robot, scene, document, task.center)

    def halves() -> Made:
        middle = [(d, 0.5 * float(d.time[0] + d.time[-1])) for d in shown]
        first = made("lmc", [d.between(stop=at) for d, at in middle])
        second = made("lmc", [d.between(start=at) for d, at in middle])
        parts = [Part("first half", lambda: first()[0]), Part("second half", lambda: second()[0])]
        return lambda: (Sequence(parts), first()[1])

    ways: dict[str, Callable[[], Made]] = {
        "policy": lambda: made("policy", shown), ONE: lambda: made("lmc", shown),
        SHIFTED: lambda: made("replay", shown[:1], **asdict(ReplaySettings())),
        PLACED: lambda: made("replay", shown[:1], **asdict(ReplaySettings(mode="absolute"))),
        HALVES: halves,
    }  # fmt: skip
    found = {}
    for name in names:
        try:
            found[name] = ways[name]()
        except InputError:  # a refusal teaches nothing
            continue
    return found


def _draws(task: Whole, scene: Scene, count: int, seed: int) -> dict[str, Float]:
    """Starts that were shown, in turn, and fixtures that stand elsewhere."""
    rng, shown = np.random.default_rng([seed, 1]), scene.task.starts
    draws = {key: rng.uniform(-by, by, count) for key, by in task.moved.items()}
    for i in range(count):
        for key, value in shown[i % len(shown)].items():
            draws.setdefault(key, np.zeros(count))[i] += value
    return draws


def _rngs(count: int, seed: int) -> Rngs:
    return [np.random.default_rng([seed, 2, k]) for k in range(count)]


def _executed(job: RowRun, name: str) -> dict[str, Ran]:
    """Successes by method, set and start."""
    task, person = TASKS[name], TeacherSettings(aim_noise=radians(job.settings["teacher.aim_noise_deg"]))
    scene = load_world(task.world, {**task.params, "friction": job.settings["world.friction"]})
    sets, count = job.count(SETS, QUICK_SETS), job.count(STARTS, QUICK_STARTS)
    won: dict[str, list[list[bool]]] = {way: [] for way in (QUICK_ONLY if job.quick else ("policy", *NULLS, HALVES))}
    methods, made = list[dict[str, Made]](), list[tuple[Skill, Setup]]()
    given = list[tuple[Mapping[str, Float], Rngs]]()
    for i in range(sets):
        seed = SEED + 1000 * job.seed + i
        shown = record(load_robot_model("free_tool"), scene, person, count=EACH, seed=seed, duration_s=20.0)
        methods.append(_methods(list(shown.demonstrations), task, scene, won))
        made += [each() for each in methods[-1].values()]
        given += [(_draws(task, scene, count, seed), _rngs(count, seed)) for _ in methods[-1]]
    done = iter(ran_made(made, given, duration_s=LONGEST_S))
    for i, ways in enumerate(methods):
        ended = {way: next(done) for way in ways}
        for way, hits in won.items():
            hits.append(ended[way].success.tolist() if way in ended else [False] * count)
        job.tell(f"{name}, set {i}: {', '.join(f'{way} {sum(hits[-1])}' for way, hits in won.items())} of {count}")
    return {way: Ran(np.array(hits)) for way, hits in won.items()}


def _told(job: RowRun, found: Mapping[str, Ran]) -> RowResult:
    """The row, from successes by method."""
    ours, nulls = found["policy"], [name for name in NULLS if name in found]
    share: Verdict = judged(ours.hits, ours.trials, SHARE, quick=job.quick)
    beside = all(ahead(ours.hits, found[name].hits, ours.trials, quick=job.quick) for name in nulls)
    said = ""
    if HALVES in found:
        behind = ahead(ours.hits, found[HALVES].hits, ours.trials, quick=job.quick)
        said = f" Demonstrations {HALVES}, without a segmenter, are {'' if behind else 'not '}behind by 95 % intervals."
    return RowResult(
        ours=f"{counted(ours.hits, ours.trials)} runs of a Panda do the whole task; nulls: "
        + ", ".join(f"{name} {found[name].hits}" for name in nulls)
        + (f"; {HALVES} {found[HALVES].hits}" if HALVES in found else ""),
        verdict=together([share], beside), values={"share": ours.hits / ours.trials},
        head=("skill", "trials", "sets without a failure"),
        rows=[(name, counted(each.hits, each.trials), each.sets) for name, each in found.items()],
        difference=f"Shown with a free tool. A replay is of a set's first demonstration.{said}",
    )  # fmt: skip


def coupler(job: RowRun) -> RowResult:
    """Row 32: lower, then interlock."""
    return _told(job, _executed(job, "hose coupler"))


def corner(job: RowRun) -> RowResult:
    """Row 33: set the box down, then push it into the corner."""
    return _told(job, _executed(job, "corner"))

"""Row 40 of the papers' results: a skill is learned where nobody measures the wrench.

The two-arm paper takes the wrench from what the arm's own controller commands. So does this row: people teach by
teleoperation, and the learner gets the law's wrench, reversed. What accelerates the tool and what rubs in the joints is
in it, too: a Panda with friction in its joints in the valley, and a tool without joints on the hump, where every mean
of the motion is a push that does not pass. Nulls: the same demonstrations without a wrench, and with the mean motion
for a push, which the hump tells apart. Beside them stands what is learned with a sensor, on the same seeds.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

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
from skillframe_papers.rows import nulls
from skillframe_papers.rows.blocks import Trials, successes
from skillframe_papers.rows.skills import Ran

SEED, EACH = 75_000, 2
SETS, QUICK_SETS = 8, 1
SHARE, LONGEST_S = 0.9, 12.0
OURS, SENSED = "what the controller commands", "a sensor"
NONE, MOTION = "no wrench", "the same, pushed along the mean motion"


class Task(NamedTuple):
    """A world, its friction, who is taught and runs there, and from where along x [m].

    Attributes:
        world, friction: of the parts.
        robot: taught and run.
        rubs: whether there are joints with friction.
        offsets: where runs start along x [m].
        motion: whether the mean motion is a push that does not pass.
    """

    world: str
    friction: float
    robot: str
    rubs: bool
    offsets: tuple[float, ...]
    motion: bool


TASKS = {
    "valley, Panda": Task("valley", 0.2, "panda", True, (-0.04, -0.025, -0.01, 0.01, 0.025, 0.04), False),
    "hump, free tool": Task("hump", 0.1, "free_tool", False, (-0.025, -0.01, 0.0, 0.018), True),
}

QUICK_TASKS = ("hump, free tool",)


def _taught(given: Sequence[Demonstration]) -> Document | None:
    """What is learned, or None where the learner refuses."""
    try:
        return learned(registry().skill("lmc"), list(given), LearnOptions())
    except InputError:  # a refusal teaches nothing
        return None


def along(document: Document, push: Float) -> Document:
    """The document with another push (3,) in base, at the same speed or the learner's largest, stiff along it."""
    made = copy.deepcopy(dict(document))
    part = made["phases"][0]["translation"]
    across = np.eye(3) - np.outer(push, push)
    free = [across @ np.array(axis) for axis in part["compliant_axes"]]
    axes = [axis / np.linalg.norm(axis) for axis in free if np.linalg.norm(axis) > 0.5]
    stiffness = 1000.0 * (np.eye(3) - sum((np.outer(axis, axis) for axis in axes), np.zeros((3, 3))))
    part |= {"desired_direction": push.tolist(), "speed": part["speed"] or 0.02, "fully_compliant": False,
             "compliant_axes": [axis.tolist() for axis in axes], "stiffness": stiffness.tolist()}  # fmt: skip
    return made


def _documents(job: RowRun, task: Task, index: int) -> dict[str, Document | None]:
    """By where the wrench came from, what one person's demonstrations teach."""
    scene, seed = load_world(task.world, {"friction": task.friction}), SEED + 1000 * job.seed + index
    person = TeacherSettings(kind="teleoperation", delay_s=job.settings["teacher.delay_s"])

    def shown(sensed: bool) -> list[Demonstration]:
        return record(
            load_robot_model(task.robot), scene, person, count=EACH, seed=seed, draws=_friction(job, task),
            duration_s=20.0, sensed=sensed,
        ).demonstrations  # fmt: skip

    felt = shown(False)
    blind = [replace(each, wrench=np.zeros_like(each.wrench)) for each in felt]
    ours, without = _taught(felt), _taught(blind)
    motion = None if ours is None else along(ours, nulls.pushes(felt)["mean motion"])
    given = {OURS: ours, NONE: without, MOTION: motion}
    return given if job.quick else {**given, SENSED: _taught(shown(True))}


def _friction(job: RowRun, task: Task) -> dict[str, float]:
    return {"robot.joint_friction": float(job.settings["robot.joint_friction"])} if task.rubs else {}


def _executed(job: RowRun, name: str) -> dict[str, Ran]:
    """Successes by where the wrench came from, set and start."""
    task, sets = TASKS[name], range(job.count(SETS, QUICK_SETS))
    scene, count = load_world(task.world, {"friction": task.friction}), len(task.offsets)
    draws = {"start.offset_x": np.array(task.offsets)}
    draws |= {key: np.full(count, value) for key, value in _friction(job, task).items()}
    found = {(way, i): each for i in sets for way, each in _documents(job, task, i).items()}
    runs = {
        key: Trials(each, draws, [np.random.default_rng([SEED, k]) for k in range(count)])
        for key, each in found.items() if each is not None
    }  # fmt: skip
    done = successes(load_robot_model(task.robot), scene, list(runs.values()), duration_s=LONGEST_S)
    won = dict(zip(runs, done, strict=True))
    lost = np.zeros(count, dtype=bool)
    ways = dict.fromkeys(way for way, _ in found)
    result = {way: Ran(np.array([won.get((way, i), lost) for i in sets])) for way in ways}
    job.tell(f"{name}: {', '.join(f'{way} {each.hits} of {each.trials}' for way, each in result.items())}")
    return result


def commanded(job: RowRun) -> RowResult:
    """Row 40: skills learned from the wrench that the arm's own law commands, run where they were taught."""
    return _told(job, {name: _executed(job, name) for name in (QUICK_TASKS if job.quick else TASKS)})


def _told(job: RowRun, found: Mapping[str, Mapping[str, Ran]]) -> RowResult:
    """The row, from successes by world and by where the wrench came from."""
    ours = {name: each[OURS] for name, each in found.items()}
    shares = [judged(each.hits, each.trials, SHARE, quick=job.quick) for each in ours.values()]
    pairs = [
        (ours[name], each[null])
        for name, each in found.items() for null in ((NONE, MOTION) if TASKS[name].motion else (NONE,))
    ]  # fmt: skip
    beside = all(ahead(a.hits, b.hits, a.trials, quick=job.quick) for a, b in pairs)
    return RowResult(
        ours="; ".join(
            f"{name} {counted(each.hits, each.trials)}, without a wrench {found[name][NONE].hits}"
            + (f", with a sensor {found[name][SENSED].hits}" if SENSED in found[name] else "")
            for name, each in ours.items()
        ),
        verdict=together(shares, beside),
        values={name.split(",")[0]: each.hits / each.trials for name, each in ours.items()},
        head=("world", "wrench from", "runs", "sets without a failure"),
        rows=[
            (name, way, counted(each.hits, each.trials), each.sets)
            for name, ways in found.items() for way, each in ways.items()
        ],
        difference="The paper teaches two arms a peg, which leads the motion: its mean needs no wrench (row 5). "
        "In the valley the mean motion passes, too. The free tool has no joints that rub.",
    )  # fmt: skip

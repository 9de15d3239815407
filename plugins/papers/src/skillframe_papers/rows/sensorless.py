"""Row 40: a skill learned without a force sensor.

As in the two-arm paper, the wrench is the controller's command, reversed, with inertia and joint friction in it: a
Panda with joint friction in the valley, and a tool without joints on the hump, where no mean of the motion is a push
that passes. Nulls: no wrench, and the mean motion as push. Beside them: a sensor, on the same seeds.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from skillframe_teaching.teacher import TeacherSettings

from skillframe.execution import load_world
from skillframe.extend import Document, RowResult, RowRun
from skillframe.frames import Float
from skillframe_papers.rows import nulls
from skillframe_papers.rows.harness import (
    HEAD,
    Ran,
    TaughtSet,
    changed,
    compared,
    executed,
    leads,
    lines,
    lmc_if_any,
    seeds,
    shown,
    successes,
)

OURS, SENSED = "what the controller commands", "a sensor"
NONE, MOTION = "no wrench", "the same, pushed along the mean motion"


class Task(NamedTuple):
    """A world with its friction, robot and starts.

    Attributes:
        world, friction: of the parts.
        robot: taught and run.
        rubs: whether there are joints with friction.
        offsets: starts of runs along x [m].
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


def along(document: Document, push: Float) -> Document:
    """The document with another push (3,) in base, stiff along it, at the same or the largest speed."""
    part = document["phases"][0]["translation"]
    across = np.eye(3) - np.outer(push, push)
    free = [across @ np.array(axis) for axis in part["compliant_axes"]]
    axes = [axis / np.linalg.norm(axis) for axis in free if np.linalg.norm(axis) > 0.5]
    stiffness = 1000.0 * (np.eye(3) - sum((np.outer(axis, axis) for axis in axes), np.zeros((3, 3))))
    return changed(document, translation={
        "desired_direction": push.tolist(), "speed": part["speed"] or 0.02, "fully_compliant": False,
        "compliant_axes": [axis.tolist() for axis in axes], "stiffness": stiffness.tolist(),
    })  # fmt: skip


def _taught(job: RowRun, task: Task, seed: int) -> TaughtSet:
    """Two demonstrations, learned from in all ways."""
    friction = {"robot.joint_friction": float(job.settings["robot.joint_friction"])} if task.rubs else {}
    scene = load_world(task.world, {"friction": task.friction})
    person = TeacherSettings(kind="teleoperation", delay_s=job.settings["teacher.delay_s"])
    felt, *sensed = (
        shown(scene, person, count=2, seed=seed, robot=task.robot, draws=friction, duration_s=20.0, sensed=sensed)
        for sensed in ((False,) if job.quick else (False, True))
    )
    ours = lmc_if_any(felt)
    ways = {
        OURS: ours, NONE: lmc_if_any([replace(each, wrench=np.zeros_like(each.wrench)) for each in felt]),
        MOTION: None if ours is None else along(ours, nulls.pushes(felt)["mean motion"]),
    }  # fmt: skip
    if sensed:
        ways[SENSED] = lmc_if_any(sensed[0])
    draws = {"start.offset_x": np.array(task.offsets)}
    draws |= {key: np.full(len(task.offsets), value) for key, value in friction.items()}
    return TaughtSet(ways, draws, (75_000,))


def commanded(job: RowRun) -> RowResult:
    """Row 40: skills learned from the wrench that the arm's own controller commands, run where they were taught."""
    found = {}
    for name in ("hump, free tool",) if job.quick else TASKS:
        task, scene = TASKS[name], load_world(TASKS[name].world, {"friction": TASKS[name].friction})
        sets = [_taught(job, task, seed) for seed in seeds(job, 75_000, job.count(8, 1))]
        found[name] = successes(executed(job, scene, sets, robot=task.robot, duration_s=12.0))
    return result(job, found)


def result(job: RowRun, found: Mapping[str, Mapping[str, Ran]]) -> RowResult:
    """Row 40 of runs by task and source of the wrench."""
    nulls = [(each[OURS], each[NONE]) for each in found.values()]
    nulls += [(each[OURS], each[MOTION]) for name, each in found.items() if TASKS[name].motion]
    return RowResult(
        ours="; ".join(
            f"{name} {each[OURS]}, without a wrench {each[NONE].hits}"
            + (f", with a sensor {each[SENSED].hits}" if SENSED in each else "")
            for name, each in found.items()
        ),
        verdict=compared(job, [each[OURS] for each in found.values()], all(leads(job, *pair) for pair in nulls)),
        values={name.split(",")[0]: each[OURS].share for name, each in found.items()},
        head=("world", "wrench from", "runs", HEAD[-1]),
        rows=[(name, *line) for name, ways in found.items() for line in lines(ways)],
        difference="The paper teaches two arms a peg, which leads the motion: its mean needs no wrench (row 5). "
        "In the valley the mean motion passes, too. The free tool has no joints that rub.",
    )  # fmt: skip

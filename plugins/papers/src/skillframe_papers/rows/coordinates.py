"""Row 39: a skill learned in the tool's axes works in any orientation.

Demonstrations are learned in base axes (null) and in the tool's axes at the start. Then the fixture and the start are
turned by 40 to 80 degrees; in place both work.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from math import radians
from typing import NamedTuple

import numpy as np

from skillframe.execution import load_robot_model
from skillframe.extend import RowResult, RowRun
from skillframe.frames import quaternion_from_matrix, rotation_matrix, unit
from skillframe.robot import RobotModel
from skillframe_papers.rows.blocks import Trials, ran
from skillframe_papers.rows.harness import Ran, compared, generators, leads, lmc, seeds, shown, teacher, world

LEAST_DEG, MOST_DEG = 40.0, 80.0
WORLDS = {"valley": ("valley", None), "peg": ("peg_in_hole", "tip")}
"""World and centre of compliance (None: where it was learned), by name."""
TOOL, BASE = "phase_start", "base"
NAMES = {TOOL: "the tool's axes at the start", BASE: "base axes"}


class Case(NamedTuple):
    """Place of a run, and axes of the learned skill."""

    world: str
    axes: str
    turned: bool


def turned(seed: int) -> RobotModel:
    """The free tool with fixture and starts turned by 40 to 80 degrees, about any axis."""
    rng, robot = np.random.default_rng([seed, 1]), load_robot_model("free_tool")
    by = radians(rng.uniform(LEAST_DEG, MOST_DEG))
    x, y, z, w = quaternion_from_matrix(rotation_matrix(by * unit(rng.standard_normal(3))))
    place = replace(robot.spec.workspace, orientation=(float(x), float(y), float(z), float(w)))
    return replace(robot, spec=replace(robot.spec, workspace=place))


def _executed(job: RowRun, name: str) -> dict[Case, Ran]:
    scene, sets = world(job, WORLDS[name][0]), seeds(job, 74_000, job.count(4, 1))
    given = [shown(scene, teacher(job), count=2, seed=seed) for seed in sets]
    documents = [lmc(each, axes=axes) for axes in NAMES for each in given]
    starts, found = scene.task.starts, dict[Case, Ran]()
    draws = {key: np.array([start.get(key, 0.0) for start in starts]) for key in starts[0]}
    turns = [turned(sets[0] + k) for k in range(job.count(4, 1))]
    for is_turned, robots in ((False, [load_robot_model("free_tool")]), (True, turns)):
        won = []
        for robot in robots:
            trials = [Trials(each, draws, generators(len(starts), 74_000)) for each in documents]
            longest = 6.0 if job.quick else 10.0
            ends = ran(robot, scene, trials, duration_s=longest, center=WORLDS[name][1])
            won.append([each.success for each in ends])
        for axes, each in zip(NAMES, np.split(np.concatenate(won, axis=1), len(NAMES)), strict=True):
            found[Case(name, axes, is_turned)] = Ran(each)
    said = [f"{NAMES[c.axes]}{', turned' * c.turned} {each.hits} of {each.trials}" for c, each in found.items()]
    job.tell(f"{name}: {'; '.join(said)}")
    return found


def frames(job: RowRun) -> RowResult:
    """Row 39: runs in place and turned, by the axes of learning."""
    names = ("peg",) if job.quick else WORLDS
    return result(job, {case: each for name in names for case, each in _executed(job, name).items()})


def result(job: RowRun, found: Mapping[Case, Ran]) -> RowResult:
    """Row 39 of runs by case."""
    worlds = list(dict.fromkeys(case.world for case in found))
    ours, null = ({name: found[Case(name, axes, True)] for name in worlds} for axes in (TOOL, BASE))
    still = [each for case, each in found.items() if not case.turned]
    return RowResult(
        ours="turned, in the tool's axes: "
        + "; ".join(f"{name} {each}, base axes {null[name].hits}" for name, each in ours.items())
        + f"; in place {sum(each.hits for each in still)} of {sum(each.trials for each in still)}",
        verdict=compared(job, [*ours.values(), *still], all(leads(job, ours[name], null[name]) for name in worlds)),
        values={name: each.share for name, each in ours.items()},
        head=("world", "learned in", "in place", "turned", "turned: sets without a failure"),
        rows=[
            (name, NAMES[axes], str(before), str(after), after.sets)
            for name in worlds for axes in NAMES
            for before, after in [(found[Case(name, axes, False)], found[Case(name, axes, True)])]
        ],
        difference=f"Fixture and starts are turned together by {LEAST_DEG:g} to {MOST_DEG:g} degrees, so that the tool "
        "meets the fixture as it did when it was shown. A fixture that is turned alone is what compliance is for, and "
        "no axes can know of it.",
    )  # fmt: skip

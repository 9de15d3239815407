"""Row 39 of the papers' results: a skill learned in the tool's axes goes wherever the tool is turned to.

The same demonstrations are learned twice, in base axes and in those of the tool at the start of the phase. Then the
whole fixture is turned in space at random by 40 to 80 degrees, and with it where the tool starts. In place both do the
task. Turned, the skill in base axes is the null.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import radians
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.document.source import learned
from skillframe.execution.prepare import load_robot_model, load_world
from skillframe.extend.records import Document, LearnOptions, RowResult, RowRun
from skillframe.extend.registry import registry
from skillframe.frames import quaternion_from_matrix, rotation_matrix, unit
from skillframe.robot.model import RobotModel
from skillframe.teaching.sessions import record
from skillframe.teaching.teacher import TeacherSettings
from skillframe.world.scene import Scene
from skillframe_papers.bars import ahead, counted, judged, together
from skillframe_papers.rows.blocks import Trials, successes
from skillframe_papers.rows.skills import Ran

SEED, EACH = 74_000, 2
SETS, QUICK_SETS = 4, 1
TURNS, QUICK_TURNS = 4, 1
SHARE, LONGEST_S, QUICK_LONGEST_S = 0.9, 10.0, 6.0
LEAST_DEG, MOST_DEG = 40.0, 80.0
QUICK_WORLDS = ("peg",)
WORLDS = {"valley": ("valley", None), "peg": ("peg_in_hole", "tip")}
"""World and centre of compliance (None: where it was learned), by name."""
TOOL, BASE = "phase_start", "base"
NAMES = {TOOL: "the tool's axes at the start", BASE: "base axes"}


class Case(NamedTuple):
    """Where a skill ran and in which axes it was learned."""

    world: str
    axes: str
    turned: bool


def turned(seed: int) -> RobotModel:
    """The free tool with the fixture and every start turned by 40 to 80 degrees, about any axis."""
    rng, robot = np.random.default_rng([seed, 1]), load_robot_model("free_tool")
    by = radians(rng.uniform(LEAST_DEG, MOST_DEG))
    x, y, z, w = quaternion_from_matrix(rotation_matrix(by * unit(rng.standard_normal(3))))
    place = replace(robot.spec.workspace, attitude=(float(x), float(y), float(z), float(w)))
    return replace(robot, spec=replace(robot.spec, workspace=place))


def _run(
    robot: RobotModel, scene: Scene, documents: Sequence[Document], centre: str | None, quick: bool
) -> list[NDArray[np.bool_]]:  # fmt: skip
    """Whether skills do the task, each from every start that was shown."""
    starts = scene.task.starts
    draws = {key: np.array([start.get(key, 0.0) for start in starts]) for key in starts[0]}
    trials = [Trials(each, draws, [np.random.default_rng([SEED, k]) for k in range(len(starts))]) for each in documents]
    longest = QUICK_LONGEST_S if quick else LONGEST_S
    return successes(robot, scene, trials, duration_s=longest, center=centre)


def _executed(job: RowRun, name: str) -> dict[Case, Ran]:
    """A world's successes, by set and start, in place and for each way in which all was turned."""
    (world, centre), plain = WORLDS[name], load_robot_model("free_tool")
    person = TeacherSettings(aim_noise=radians(job.settings["teacher.aim_noise_deg"]))
    scene, first = load_world(world, {"friction": job.settings["world.friction"]}), SEED + 1000 * job.seed
    sets = range(job.count(SETS, QUICK_SETS))
    shown = [record(plain, scene, person, count=EACH, seed=first + i).demonstrations for i in sets]
    options = [LearnOptions(axes=axes) for axes in NAMES]
    documents = [learned(registry().skill("lmc"), list(each), option) for option in options for each in shown]
    still = np.array(_run(plain, scene, documents, centre, job.quick))
    turns = range(job.count(TURNS, QUICK_TURNS))
    moved = np.concatenate([_run(turned(first + k), scene, documents, centre, job.quick) for k in turns], axis=1)
    found = dict[Case, Ran]()
    for axes, before, after in zip(NAMES, *(np.split(won, len(NAMES)) for won in (still, moved)), strict=True):
        found |= {Case(name, axes, False): Ran(before), Case(name, axes, True): Ran(after)}
    return found


def frames(job: RowRun) -> RowResult:
    """Row 39: runs in place, and where all is turned, by the axes in which the skill was learned."""
    found = dict[Case, Ran]()
    for name in QUICK_WORLDS if job.quick else WORLDS:
        here = _executed(job, name)
        found |= here
        said = [f"{NAMES[c.axes]}{', turned' * c.turned} {ran.hits} of {ran.trials}" for c, ran in here.items()]
        job.tell(f"{name}: {'; '.join(said)}")
    return _told(job, found)


def _told(job: RowRun, found: Mapping[Case, Ran]) -> RowResult:
    """The row, from successes by case."""
    worlds = list(dict.fromkeys(case.world for case in found))
    ours = {world: found[Case(world, TOOL, True)] for world in worlds}
    null = {world: found[Case(world, BASE, True)] for world in worlds}
    still = [each for case, each in found.items() if not case.turned]
    shares = [judged(each.hits, each.trials, SHARE, quick=job.quick) for each in (*ours.values(), *still)]
    beside = all(ahead(ours[w].hits, null[w].hits, ours[w].trials, quick=job.quick) for w in worlds)
    return RowResult(
        ours="turned, in the tool's axes: "
        + "; ".join(f"{world} {counted(each.hits, each.trials)}, base axes {null[world].hits}"
                    for world, each in ours.items())
        + f"; in place {sum(each.hits for each in still)} of {sum(each.trials for each in still)}",
        verdict=together(shares, beside),
        values={world: each.hits / each.trials for world, each in ours.items()},
        head=("world", "learned in", "in place", "turned", "turned: sets without a failure"),
        rows=[
            (world, NAMES[axes], counted(before.hits, before.trials), counted(after.hits, after.trials), after.sets)
            for world in worlds for axes in NAMES
            for before, after in [(found[Case(world, axes, False)], found[Case(world, axes, True)])]
        ],
        difference=f"Fixture and starts are turned together by {LEAST_DEG:g} to {MOST_DEG:g} degrees, so that the tool "
        "meets the fixture as it did when it was shown. A fixture that is turned alone is what compliance is for, and "
        "no axes can know of it.",
    )  # fmt: skip

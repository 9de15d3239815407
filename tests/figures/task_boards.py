"""Task boards that moved between demonstrations: phases in the frames of their places, and the same in base.

Three boards of five places; for each three policies of three demonstrations of their own, every one of them on a board
that stands elsewhere (50 mm, 34 degrees about its normal, 9 degrees of tilt, each way), and each policy run on six
boards that stand elsewhere again, from starts up to 10 mm away. Boards are moved by `fixture.*`, so that trials run
side by side, and policies are told where the places are. A run counts if all five were done, in order, and it ended
well.

    python -m tests.figures.task_boards [places|base|pooled ...] [policies=3] [boards=6]

`base` learns from the same demonstrations with every place's pose written down as if the board had stood still, that
is, in the base frame, with the same cuts; `pooled` is `segment --set places=false`.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np
from scipy.stats import binomtest
from skillframe_segmenter.document import read
from skillframe_segmenter.placed import Placed, placement_of
from skillframe_segmenter.policy import Policy

from skillframe.demonstration.places import KEY, as_plain
from skillframe.demonstration.record import Demonstration
from skillframe.document.source import learned
from skillframe.errors import SkillframeError
from skillframe.execution.executor import simulate
from skillframe.execution.prepare import load_robot_model, load_world, prepare
from skillframe.execution.trace import Trace
from skillframe.extend.records import Document, LearnOptions
from skillframe.extend.registry import registry
from skillframe.frames import Float, Pose, matrix_from_quaternion, move_wrench, rotate, rotate_spatial
from skillframe.sequence import Part
from skillframe.skill import Skill
from skillframe.teaching.sessions import record
from skillframe.teaching.teacher import TeacherSettings
from skillframe.world.placement import fixture_poses, places_in_base
from skillframe.world.scene import Scene
from skillframe.world.worlds.task_board import done_in_order

LAYOUTS, EACH, SEED = (1, 2, 3), 3, 9100
COUNTS = {"policies": 3, "boards": 6}  # of a layout, and of a policy
MOVES = {"offset_x": 0.05, "offset_y": 0.05, "tilt_x": 0.15, "tilt_z": 0.6}  # m, rad, each way
AWAY, LONGEST_S, PLACES = 0.01, 80.0, 5


class Outcome(NamedTuple):
    """One run: whether it ended well with all places done, how many were, its largest force [N], and how it ended."""

    success: bool
    done: int
    peak: float
    ended: str


def moves(layout: int, use: int, count: int) -> dict[str, Float]:
    """Where boards stand: quantities (N,). `use` tells demonstrations from runs."""
    rng = np.random.default_rng([SEED, layout, use])
    return {f"fixture.{key}": rng.uniform(-by, by, count) for key, by in MOVES.items()}


def places_at(scene: Scene, fixture: Pose) -> dict[str, Pose]:
    """Places in base of a scene whose fixture stands at (N, 3), (N, 3, 3)."""
    poses = {name: (np.array(p), matrix_from_quaternion(q)) for name, (p, q) in scene.places.items()}
    return {name: Pose(fixture.at(p).position, fixture.rotation @ turn) for name, (p, turn) in poses.items()}


def shown(layout: int) -> list[Demonstration]:
    """Demonstrations for all policies of a board, each on one that stands elsewhere, as its metadata say."""
    robot, scene, count = (
        load_robot_model("free_tool"),
        load_world("task_board", {"layout": layout}),
        COUNTS["policies"] * EACH,
    )
    columns = moves(layout, 0, count)
    starts = tuple({key: float(values[i]) for key, values in columns.items()} for i in range(count))
    there = replace(scene, task=replace(scene.task, starts=starts))
    recording = record(robot, there, TeacherSettings(), count=count, seed=SEED + layout, duration_s=60.0)
    places = places_at(scene, fixture_poses(robot, columns, count))
    return [
        replace(d, meta={**d.meta, KEY: as_plain({n: Pose(p.position[i], p.rotation[i]) for n, p in places.items()})})
        for i, d in enumerate(recording)
    ]


def policy(demonstrations: list[Demonstration], how: str, layout: int) -> Document:
    """A policy that is learned in the frames of places, in base with the same cuts, or in base from the whole."""
    if how == "base":
        still = as_plain(places_in_base(load_robot_model("free_tool"), load_world("task_board", {"layout": layout})))
        demonstrations = [replace(d, meta={**d.meta, KEY: still}) for d in demonstrations]
    options = LearnOptions(settings={"places": False} if how == "pooled" else {})
    return learned(registry().skill("policy"), demonstrations, options)


def told(document: Document, places: Mapping[str, Pose]) -> Skill:
    """The policy, told where the places are in each trial: (N, 3), (N, 3, 3)."""
    known, parts = read(document), []
    for i, sub in enumerate(known.skills):
        placement = placement_of(document, i)
        placement = placement._replace(pose=places.get(placement.name, placement.pose))
        make = partial(registry().skill(sub["type"]).build, sub)
        parts.append(Part(f"phase {i + 1}", partial(Placed, placement, make)))
    return Policy(parts, known, None)


def runs(document: Document, layout: int, how: str, number: int) -> list[Outcome]:
    """A policy on boards that stand elsewhere again."""
    robot, scene = load_robot_model("free_tool"), load_world("task_board", {"layout": layout})
    count = COUNTS["boards"]
    draws = moves(layout, 1 + number, count)
    fixture = fixture_poses(robot, draws, count)
    rng = np.random.default_rng([SEED, layout, number, 3])
    draws |= {f"start.offset_{axis}": rng.uniform(-AWAY, AWAY, count) for axis in "xy"}
    still = places_in_base(robot, scene)
    skill, setup = prepare(robot, scene, document, places=still)
    skill = told(document, places_at(scene, fixture)) if how == "places" else skill
    rngs = [np.random.default_rng([SEED, layout, number, 4, i]) for i in range(count)]
    result = simulate(skill, setup, draws, rngs, duration_s=LONGEST_S, trace_hz=200.0)
    assert result.traces is not None
    outcomes = []
    for i, trace in enumerate(result.traces):
        done = places_done(trace, scene, Pose(fixture.position[i], fixture.rotation[i]))
        well = bool(result.success[i]) and done == PLACES
        outcomes.append(Outcome(well, done, float(result.peak_force_n[i]), str(result.failure[i])))
    return outcomes


def places_done(trace: Trace, scene: Scene, fixture: Pose) -> int:
    """How many places a run did, in order."""
    base = fixture.inverse()
    tool = Pose(trace.position, matrix_from_quaternion(trace.quaternion))
    shift = np.array(scene.tool.frames["tip"]) - np.array(trace.meta["center_of_compliance"])
    tip = tool.at(shift)
    there = Pose(rotate(base.rotation, tip.position) + base.position, base.rotation @ tip.rotation)
    wrench = move_wrench(trace.wrench, rotate(tool.rotation, shift))
    return done_in_order(scene, there, rotate_spatial(base.rotation, wrench))


def row(layout: int, how: str, demonstrations: list[Demonstration]) -> list[Outcome]:
    """All runs on one board."""
    outcomes: list[Outcome] = []
    for number in range(COUNTS["policies"]):
        try:
            document = policy(demonstrations[EACH * number : EACH * (number + 1)], how, layout)
        except SkillframeError as error:
            outcomes += [Outcome(False, 0, 0.0, f"not learned: {error}")] * COUNTS["boards"]
            continue
        outcomes += runs(document, layout, how, number)
    return outcomes


def main(names: list[str]) -> None:
    """Print a row for each board and way of learning."""
    COUNTS.update({key: int(value) for key, _, value in (name.partition("=") for name in names) if value})
    taught = {layout: shown(layout) for layout in LAYOUTS}
    for how in [name for name in names if "=" not in name] or ["places", "base", "pooled"]:
        every = []
        for layout in LAYOUTS:
            outcomes = row(layout, how, taught[layout])
            every += outcomes
            print(f"{how:<8} board {layout}: {_told(outcomes)}", flush=True)
            for text in sorted({o.ended for o in outcomes if not o.success}):
                print(f"    {sum(o.ended == text for o in outcomes if not o.success)} x {text}", flush=True)
        low, high = binomtest(sum(o.success for o in every), len(every)).proportion_ci(method="exact")
        print(f"{how:<8} all: {_told(every)}; 95 % {low:.3f} to {high:.3f}", flush=True)


def _told(outcomes: list[Outcome]) -> str:
    done, peak = sum(o.done for o in outcomes), np.median([o.peak for o in outcomes])
    wins = sum(o.success for o in outcomes)
    return f"{wins} of {len(outcomes)}, {done} of {PLACES * len(outcomes)} places, median peak {peak:.0f} N"


if __name__ == "__main__":
    main(sys.argv[1:])

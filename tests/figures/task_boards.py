"""Task boards that moved between demonstrations: phases in the frames of their places, and the same in base.

Three boards of five places; for each three policies of three demonstrations of their own, every one of them on a board
that stands elsewhere (50 mm, 34 degrees about its normal, 9 degrees of tilt, each way), and each policy run on six
boards that stand elsewhere again, from starts up to 10 mm away. Boards are moved by `fixture.*`, so that trials run
side by side, and policies are told where the places are. A run counts if all five were done, in order, and it ended
well. Of the others the first place that was not done is told: what its phases said, the largest force there, and how
near the pin came to where the place ends.

    python -m tests.figures.task_boards [places|base|pooled ...] [policies=3] [boards=6] [seed=9100]

`base` learns from the same demonstrations with every place's pose written down as if the board had stood still, that
is, in the base frame. It is refused, since what was touched then lies at other places in each demonstration. `pooled`
is `segment --set places=false`.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np
from scipy.stats import binomtest
from skillframe_segmenter.document import read
from skillframe_segmenter.placed import WORK, Placed, Placement, placement_of
from skillframe_segmenter.policy import Policy
from skillframe_teaching.sessions import record
from skillframe_teaching.teacher import TeacherSettings
from skillframe_worlds.task_board import PLACES as BOARD
from skillframe_worlds.task_board import done_in_order

from skillframe.demonstration.record import Demonstration
from skillframe.document.file import learned
from skillframe.document.frame import PLACES as KEY
from skillframe.document.frame import as_plain
from skillframe.errors import SkillframeError
from skillframe.execution.executor import simulate
from skillframe.execution.prepare import load_robot_model, load_world, prepare
from skillframe.execution.trace import Trace
from skillframe.extend import Document, LearnOptions
from skillframe.extend.registry import registry
from skillframe.frames import Float, Pose, matrix_from_quaternion, move_wrench, norm, rotate, rotate_spatial
from skillframe.sequence import Moved, Part
from skillframe.skill import Skill
from skillframe.world.placement import fixture_poses, places_in_base
from skillframe.world.scene import Scene

LAYOUTS, EACH = (1, 2, 3), 3
COUNTS = {"policies": 3, "boards": 6, "seed": 9100}  # of a layout, of a policy, and what all is drawn from
MOVES = {"offset_x": 0.05, "offset_y": 0.05, "tilt_x": 0.15, "tilt_z": 0.6}  # m, rad, each way
AWAY, LONGEST_S, PLACES = 0.01, 80.0, 5
LAST = 4  # words of a phase that are told


class Outcome(NamedTuple):
    """One run: whether it ended well with all places done, how many were, its largest force [N], what went wrong."""

    success: bool
    done: int
    peak: float
    wrong: str


def moves(layout: int, use: int, count: int) -> dict[str, Float]:
    """Where boards stand: quantities (N,). `use` tells demonstrations from runs."""
    rng = np.random.default_rng([COUNTS["seed"], layout, use])
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
    recording = record(robot, there, TeacherSettings(), count=count, seed=COUNTS["seed"] + layout, duration_s=60.0)
    places = places_at(scene, fixture_poses(robot, columns, count))
    return [
        replace(d, meta={**d.meta, KEY: as_plain({n: Pose(p.position[i], p.rotation[i]) for n, p in places.items()})})
        for i, d in enumerate(recording)
    ]


def policy(demonstrations: list[Demonstration], how: str, layout: int) -> Document:
    """A policy that is learned in the frames of places, as if these had stood still, or in base from the whole."""
    if how == "base":
        still = as_plain(places_in_base(load_robot_model("free_tool"), load_world("task_board", {"layout": layout})))
        demonstrations = [replace(d, meta={**d.meta, KEY: still}) for d in demonstrations]
    options = LearnOptions(settings={"places": False} if how == "pooled" else {})
    return learned(registry().skill("policy"), demonstrations, options)


class Watched(Placed):
    """A phase at its place, which tells what its work said."""

    def said(self, trial: int) -> list[tuple[float, str]]:
        """Journal of the work, of its last beginning."""
        work = self._children[WORK]
        return [] if work is None else work.journal(trial)


class Told(NamedTuple):
    """A policy that is told where the places are, and its phases as far as they were begun."""

    policy: Skill
    phases: dict[int, Watched]


def told(document: Document, places: Mapping[str, Pose]) -> Told:
    """The policy, told where the places are in each trial: (N, 3), (N, 3, 3)."""
    known, phases = read(document), dict[int, Watched]()

    def watched(i: int, placement: Placement, make: Callable[[], Skill]) -> Skill:
        return Moved(lambda: phases.setdefault(i, Watched(placement, make)), placement.pose)

    parts = []
    for i, sub in enumerate(known.skills):
        placement = placement_of(document, i)
        placement = placement._replace(pose=places.get(placement.name, placement.pose))
        make = partial(registry().skill(sub["type"]).build, sub)
        parts.append(Part(f"phase {i + 1}", partial(watched, i, placement, make)))
    return Told(Policy(parts, known, None), phases)


def runs(document: Document, layout: int, how: str, number: int) -> list[Outcome]:
    """A policy on boards that stand elsewhere again."""
    robot, scene = load_robot_model("free_tool"), load_world("task_board", {"layout": layout})
    count, seed = COUNTS["boards"], COUNTS["seed"]
    draws = moves(layout, 1 + number, count)
    fixture = fixture_poses(robot, draws, count)
    rng = np.random.default_rng([seed, layout, number, 3])
    draws |= {f"start.offset_{axis}": rng.uniform(-AWAY, AWAY, count) for axis in "xy"}
    still = places_in_base(robot, scene)
    skill, setup = prepare(robot, scene, document, places=still)
    mine = None if how == "pooled" else told(document, places_at(scene, fixture) if how == "places" else still)
    rngs = [np.random.default_rng([seed, layout, number, 4, i]) for i in range(count)]
    result = simulate(skill if mine is None else mine.policy, setup, draws, rngs, duration_s=LONGEST_S, trace_hz=200.0)
    assert result.traces is not None
    outcomes = []
    for i, trace in enumerate(result.traces):
        tip = tip_of(trace, scene, Pose(fixture.position[i], fixture.rotation[i]))
        done = done_in_order(scene, *tip)
        well = bool(result.success[i]) and done == PLACES
        wrong = (
            "" if well else f"policy {number + 1}, board {i + 1}: {cause(scene, document, mine, i, trace, tip, done)}"
        )
        outcomes.append(Outcome(well, done, float(result.peak_force_n[i]), wrong))
    return outcomes


def cause(
    scene: Scene, document: Document, mine: Told | None, trial: int, trace: Trace, tip: tuple[Pose, Float], done: int
) -> str:  # fmt: skip
    """Why a run does not count: the first place that it did not do, or what it said at the last, and how it ended."""
    name = list(scene.places)[min(done, PLACES - 1)]
    said = [] if mine is None else words(document, mine, trial, name)
    how = f"{name}: {'; '.join(text for _, text in said[-LAST:]) or 'was not begun by a phase of its own'}"
    where = "was done" if done == PLACES else missed(scene, name, trace, tip, [time for time, _ in said])
    return f"{how}; {where}; {trace.meta['failure'] or 'ended well'}"


def words(document: Document, mine: Told, trial: int, place: str) -> list[tuple[float, str]]:
    """The journal of the phase that belongs to a place: what its work said, or else how far it came."""
    phase = next((i for i, each in enumerate(document["phases"]) if each["place"] == place), -1)
    name = f"phase {phase + 1}"
    if phase not in mine.phases or not any(text.startswith(f"{name}:") for _, text in mine.policy.journal(trial)):
        return []
    return mine.phases[phase].said(trial) or mine.phases[phase].journal(trial)


def missed(scene: Scene, name: str, trace: Trace, tip: tuple[Pose, Float], times: Sequence[float]) -> str:
    """The largest force [N] between times, or in the whole run, and how near the pin came to a place's end [mm]."""
    position, quaternion = scene.places[name]
    end = Pose(np.array(position), matrix_from_quaternion(quaternion)).at(np.array(BOARD[name].end)).position
    first, last = (min(times), max(times)) if times else (0.0, np.inf)
    there = (trace.time >= first) & (trace.time <= last)
    force, near = norm(trace.wrench[there, :3]).max(), 1e3 * norm(tip[0].position[there] - end).min()
    return f"at most {force:.0f} N, {near:.1f} mm from its end"


def tip_of(trace: Trace, scene: Scene, fixture: Pose) -> tuple[Pose, Float]:
    """The pin's tip over a run, (T, 3), (T, 3, 3), and the wrench on it, (T, 6), in the fixture frame."""
    base = fixture.inverse()
    tool = Pose(trace.position, matrix_from_quaternion(trace.quaternion))
    shift = np.array(scene.tool.frames["tip"]) - np.array(trace.meta["center_of_compliance"])
    tip = tool.at(shift)
    there = Pose(rotate(base.rotation, tip.position) + base.position, base.rotation @ tip.rotation)
    wrench = move_wrench(trace.wrench, rotate(tool.rotation, shift))
    return there, rotate_spatial(base.rotation, wrench)


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
            for text, times in Counter(o.wrong for o in outcomes if not o.success).items():
                print(f"    {times} x {text}", flush=True)
        low, high = binomtest(sum(o.success for o in every), len(every)).proportion_ci(method="exact")
        print(f"{how:<8} all: {_told(every)}; 95 % {low:.3f} to {high:.3f}", flush=True)


def _told(outcomes: list[Outcome]) -> str:
    done, peak = sum(o.done for o in outcomes), np.median([o.peak for o in outcomes])
    wins = sum(o.success for o in outcomes)
    return f"{wins} of {len(outcomes)}, {done} of {PLACES * len(outcomes)} places, median peak {peak:.0f} N"


if __name__ == "__main__":
    main(sys.argv[1:])

"""Tasks in which averages of a demonstration do not work: LMC by contact modes beside its nulls, set by set.

    python -m tests.figures.worth hump_low --sets 20 --first 5000

A set is an instance of a task (geometry, friction and the whole fixture's attitude are drawn) with three uneven
demonstrations of one simulated person, and two executions from drawn starts, with the fixture moved by up to 2 mm and
turned by up to 2 degrees about each axis and friction off by up to 20 %. All methods run on the same draws. A set
passes if both executions do. Sets are the unit of the intervals, because the draws of a set share their push.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Sequence
from math import radians
from typing import Any

import numpy as np

from skillframe.campaign.statistics import clopper_pearson
from skillframe.demonstration.record import Demonstration
from skillframe.execution.executor import Setup, simulate
from skillframe.execution.prepare import load_robot_model, load_world
from skillframe.frames import Float, rotation_matrix, unit
from skillframe.teaching.people import People, Person, off_by
from skillframe.teaching.sessions import demonstration_from
from skillframe.teaching.teacher import TeacherSettings
from skillframe.world.placement import fixture_poses
from skillframe.world.scene import Scene
from tests.figures.teaching import learned
from tests.figures.worth_skills import Row, Rows, averages, push_along, replay

KINDS = ("noise 8", "noise 15", "bias 10", "hesitating", "wrong first")
EACH, DRAWS, ATTEMPTS = 3, 2, 12
HANDWRITTEN = {"plate normal": (0.0, 0.0, -1.0), "along floor": (1.0, 0.0, 0.0)}


def _hump(rng: np.random.Generator, slope: tuple[float, float], friction: tuple[float, float], **more: Any) -> Any:
    return "hump", {"slope": radians(rng.uniform(*slope)), "friction": rng.uniform(*friction), **more}


def _steps(rng: np.random.Generator) -> Any:
    world, params = _hump(rng, (46, 51), (0.16, 0.24), steps=radians(rng.uniform(15, 22)))
    return world, {**params, "height": float(rng.uniform(0.010, 0.013) * np.sin(params["slope"]))}


def _pit(rng: np.random.Generator, faces: Sequence[tuple[float, float]], friction: tuple[float, float]) -> Any:
    apart = rng.uniform(105.0, 135.0)
    azimuths = (0.0, radians(apart), radians(0.5 * apart + 180.0)) if len(faces) == 3 else (0.0, np.pi, 0.0)
    slopes = [radians(rng.uniform(*face)) for face in faces] + [-0.01] * (3 - len(faces))
    return "pit", {"slopes": tuple(slopes), "azimuths": azimuths, "friction": rng.uniform(*friction)}


def _slide(rng: np.random.Generator) -> Any:
    push = tuple(unit(np.array([0.75, rng.uniform(0.30, 0.45), -rng.uniform(0.40, 0.55)])).tolist())
    return "pit", {
        "slopes": (0.0, radians(90.0), radians(90.0)), "azimuths": (radians(225.0), radians(90.0), 0.0),
        "push": push, "friction": rng.uniform(0.2, 0.3),
    }  # fmt: skip


FAMILIES: dict[str, Callable[[np.random.Generator], Any]] = {
    "hump_low": lambda rng: _hump(rng, (51, 55), (0.08, 0.12)),
    "hump": lambda rng: _hump(rng, (46, 51), (0.16, 0.24)),
    "steps": _steps,
    "skew": lambda rng: _hump(rng, (45, 50), (0.12, 0.20), skew=radians(rng.uniform(12, 20))),
    "slide": _slide,
    "corner": lambda rng: _pit(rng, [(18, 24), (35, 45), (55, 63)], (0.12, 0.18)),
    "valley": lambda rng: _pit(rng, [(22, 28), (55, 63)], (0.18, 0.25)),
}


def drawn(family: str, seed: int) -> tuple[Scene, Float, np.random.Generator]:
    """An instance: its scene, how the whole fixture is turned (3, 3), and what draws the rest of the set."""
    rng = np.random.default_rng([seed, sorted(FAMILIES).index(family)])
    world, params = FAMILIES[family](rng)
    turn = unit(rng.standard_normal(3)) * rng.uniform(0.0, np.pi)
    return load_world(world, {**params, "turn": tuple(turn.tolist())}), rotation_matrix(turn), rng


def _starts(scene: Scene, turn: Float, rng: np.random.Generator, count: int, lift: float) -> Float:
    """Offsets (count, 3) of starts, in the turned fixture's axes."""
    if scene.name == "hump":
        before = rng.choice([0.012, 0.030, 0.040, 0.055], count) if not lift else rng.uniform(0.012, 0.055, count)
        return np.column_stack([0.03 - before, np.zeros(count), np.full(count, lift)]) @ turn.T
    if not scene.params["slopes"][0]:  # a slide
        along, aside = rng.uniform(0.03, 0.06, count), rng.uniform(0.004, 0.025, count)
        return np.column_stack([-along, -aside, np.full(count, lift)]) @ turn.T
    nominal = np.array([[s.get(f"start.offset_{a}", 0.0) for a in "xyz"] for s in scene.task.starts])
    up = -lift * np.array(scene.task.direction)
    return nominal[rng.integers(len(nominal), size=count)] * rng.uniform(0.5, 1.2, (count, 1)) + up


def _person(kind: str, scene: Scene, turn: Float, rng: np.random.Generator) -> Person:
    push = scene.task.direction
    assert push is not None
    if kind == "bias 10":
        return Person(push=off_by(push, radians(10.0), rng.uniform(0.0, 2.0 * np.pi)))
    if kind == "wrong first":
        x, y, z = turn.T @ np.array(push)
        return Person(wrong=tuple((turn @ np.array([-x, -y, z])).tolist()))
    noise = {"noise 15": 15.0}.get(kind, 8.0)
    return Person(push=off_by(push, radians(rng.uniform(0.0, 3.0)), rng.uniform(0.0, 2.0 * np.pi)),
                  aim_noise=radians(noise), hesitates=kind == "hesitating")  # fmt: skip


def demonstrations(
    scene: Scene, turn: Float, rng: np.random.Generator, kinds: Sequence[str], count: int
) -> tuple[dict[str, list[Demonstration]], int]:  # fmt: skip
    """`count` demonstrations of a person of each kind, and how many failed. A person whose all fail is left out."""
    people = {kind: _person(kind, scene, turn, rng) for kind in kinds}
    starts = {kind: _starts(scene, turn, rng, count, 0.0) for kind in kinds}
    got: dict[tuple[str, int], Demonstration] = {}
    failed = 0
    for attempt in range(ATTEMPTS):
        slots = [(kind, i) for kind in kinds for i in range(count) if (kind, i) not in got]
        if not slots:
            break
        if attempt == ATTEMPTS // 2:
            people |= {kind: _person(kind, scene, turn, rng) for kind, _ in slots}
        traces, good = _attempt(scene, [people[kind] for kind, _ in slots], [starts[k][i] for k, i in slots], rng)
        failed += int((~good).sum())
        for slot, trace, fine in zip(slots, traces, good, strict=True):
            if fine:
                got[slot] = demonstration_from(trace, scene, TeacherSettings())
    full = [kind for kind in kinds if all((kind, i) in got for i in range(count))]
    return {kind: [got[kind, i] for i in range(count)] for kind in full}, failed


def _attempt(scene: Scene, people: list[Person], starts: list[Float], rng: np.random.Generator) -> Any:
    robot = load_robot_model("free_tool")
    draws = {f"start.offset_{a}": np.array(starts)[:, i] for i, a in enumerate("xyz")}
    setup = Setup(
        robot=robot.guided(), scene=scene, center_of_compliance=np.array(scene.tool.frames["grip"]),
        filter_wrench=False, stop_when=scene.goal,
    )  # fmt: skip
    hands = People(scene.task, fixture_poses(robot, draws, len(people)), people)
    result = simulate(hands, setup, draws, rng.spawn(len(people)), duration_s=12.0, trace_hz=500.0)
    return result.traces, result.success


def methods(shown: Sequence[Demonstration], turn: Float) -> dict[str, Row]:
    """Every method's row for one set."""
    rows: dict[str, Row] = {}
    for name, settings in (("LMC", {}), ("LMC, old rule", {"contact_modes": False})):
        phase = learned(list(shown), at="tip", settings=settings)["phases"][0]
        part, lead = phase["translation"], phase["stop"]["lead_force_n"]
        direction = np.zeros(3) if part["desired_direction"] is None else np.array(part["desired_direction"])
        rows[name] = Row(direction, np.array(part["stiffness"]), part["speed"], lead)
    like = Row(np.zeros(3), np.eye(3), 0.02, 20.0)
    rows["LMC's push, free across"] = push_along(rows["LMC"].direction, like)
    nulls = averages(shown) | {name: turn @ np.array(given) for name, given in HANDWRITTEN.items()}
    nulls["base -z"] = np.array([0.0, 0.0, -1.0])
    return rows | {name: push_along(given, like) for name, given in nulls.items()} | {"replay": replay(shown[0])}


def run_set(family: str, seed: int, kinds: Sequence[str], count: int = EACH) -> dict[str, Any]:
    """One instance: for each kind of person and each method, whether each execution reached the goal."""
    scene, turn, rng = drawn(family, seed)
    shown, failed = demonstrations(scene, turn, rng, kinds, count)
    table = {(kind, name): row for kind, given in shown.items() for name, row in methods(given, turn).items()}
    assert scene.task.direction is not None
    table["", "true push"] = push_along(np.array(scene.task.direction), Row(np.zeros(3), np.eye(3)))
    starts = _starts(scene, turn, rng, DRAWS, 0.003)
    draws = {f"start.offset_{a}": starts[:, i] for i, a in enumerate("xyz")}
    draws |= {f"fixture.offset_{a}": rng.uniform(-0.002, 0.002, DRAWS) for a in "xyz"}
    draws |= {f"fixture.tilt_{a}": np.radians(rng.uniform(-2.0, 2.0, DRAWS)) for a in "xyz"}
    draws["world.friction"] = scene.friction * rng.uniform(0.8, 1.2, DRAWS)
    rows = [row for row in table.values() for _ in range(DRAWS)]
    setup = Setup(robot=load_robot_model("free_tool"), scene=scene,
                  center_of_compliance=np.array(scene.tool.frames["tip"]))  # fmt: skip
    noise = [g for _ in table for g in np.random.default_rng([seed, 1]).spawn(DRAWS)]
    tiled = {key: np.tile(values, len(table)) for key, values in draws.items()}
    good = simulate(Rows(rows), setup, tiled, noise, duration_s=10.0).success.reshape(-1, DRAWS)
    results = {"|".join(key): each.tolist() for key, each in zip(table, good, strict=True)}
    return {"family": family, "seed": seed, "demonstrations": count, "failed": failed, "results": results}


def directions(seed: int, family: str, kinds: Sequence[str], count: int = EACH) -> list[str]:
    """How far below a hump's floor each learned push points, beside the pushes that pass (no execution)."""
    scene, turn, rng = drawn(family, seed)
    low = np.degrees(np.arctan(scene.friction))
    high, lines = 90.0 - low - np.degrees(scene.params["slope"]), []
    for kind, shown in demonstrations(scene, turn, rng, kinds, count)[0].items():
        for name, row in list(methods(shown, turn).items())[:2]:
            x, _, z = turn.T @ row.direction
            below = np.degrees(np.arctan2(-z, x)) if row.direction.any() else np.nan
            said = "passes" if low < below < high else "does not"
            lines.append(f"{seed} {kind:12} {name:14} {below:5.1f} in {low:.1f} to {high:.1f}: {said}")
    return lines


def table(runs: Sequence[dict[str, Any]]) -> list[str]:
    """Lines of a table: executions, and sets with their exact interval, by person and method."""
    keys = dict.fromkeys(key for run in runs for key in run["results"])
    lines = []
    for key in keys:
        sets = [run["results"][key] for run in runs if key in run["results"]]
        whole = sum(all(each) for each in sets)
        low, high = clopper_pearson(whole, len(sets))
        counted = f"{sum(map(sum, sets))} of {sum(map(len, sets))}"
        kind, name = key.split("|")
        bounds = f"{100 * low:.0f}-{100 * high:.0f} %"
        lines.append(f"{kind:12} {name:24} {counted:>10}   sets {whole} of {len(sets)}  {bounds}")
    return lines


def main(given: Sequence[str]) -> None:
    """Run the sets of a family and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("family", choices=sorted(FAMILIES))
    parser.add_argument("--sets", type=int, default=20)
    parser.add_argument("--first", type=int, default=5000, help="seed of the first set")
    parser.add_argument("--demonstrations", type=int, default=EACH)
    parser.add_argument("--kinds", nargs="+", default=["noise 8", "bias 10", "hesitating", "wrong first"])
    parser.add_argument("--directions", action="store_true", help="of humps: only what is learned, nothing executed")
    args = parser.parse_args(given)
    runs = []
    for seed in range(args.first, args.first + args.sets):
        if args.directions:
            print("\n".join(directions(seed, args.family, args.kinds, args.demonstrations)), flush=True)
            continue
        runs.append(run_set(args.family, seed, args.kinds, args.demonstrations))
        print(json.dumps(runs[-1]), file=sys.stderr, flush=True)
    print("\n".join(table(runs) if runs else []))


if __name__ == "__main__":
    main(sys.argv[1:])

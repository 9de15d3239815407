"""Tasks in which averages of a demonstration do not work: LMC by contact modes beside its nulls, set by set.

    python -m tests.figures.worth hump_low --sets 20 --first 9000

A set is an instance of a task (geometry, friction and the whole fixture's attitude are drawn) with three uneven
demonstrations by one simulated person of each kind. Every method is run from five drawn starts with the fixture moved
by up to 2 mm and turned by up to 2 degrees about each axis and friction off by up to 20 %, and from one with nothing
moved ("in place"). All methods run on the same draws, in one simulation. A set passes if four of five moved runs do.
Sets are the unit of the intervals, because the draws of a set share their push.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from typing import Any

import numpy as np

from skillframe.campaign.statistics import clopper_pearson
from skillframe.demonstration.record import Demonstration
from skillframe.execution.executor import Setup, simulate
from skillframe.execution.prepare import load_robot_model
from skillframe.frames import Float
from skillframe.world.scene import Scene
from tests.figures.worth_families import FAMILIES, KINDS, demonstrations, drawn, starts
from tests.figures.worth_methods import document_of, hand_written, lmc_row, played, pushes
from tests.figures.worth_skills import LONGEST, Row, Rows

EACH, MOVED, ENOUGH = 3, 5, 4
PEOPLE = ("noise 8", "bias 10", "hesitating", "wrong first")
PLAYED = ("replay", "mean path", "dmp", "gmr", "seds", "acp")
FEW = "noise 8"  # the kind of person whose one and two demonstrations are learned as well
TUNING = [(k, with_force) for k in (500.0, 1000.0, 2000.0, 4000.0) for with_force in (True, False)]


def rows_of_set(
    shown: dict[str, list[Demonstration]], turn: Float, scene: Scene, learners: Sequence[str]
) -> dict[str, Row]:  # fmt: skip
    """Every method by "person|method"."""
    rows: dict[str, Row] = {f"|{name}": row for name, row in hand_written(turn, scene.task).items()}
    for kind, given in shown.items():
        rows |= {f"{kind}|{name}": row for name, row in pushes(given).items()}
        if kind in learners:
            rows |= {f"{kind}|{n}": r for n, r in played(given, PLAYED, rows[f"{kind}|LMC"].stiffness).items()}
        for count in (1, 2) if kind == FEW else ():
            few = pushes(given[:count])
            rows |= {f"{kind}, {count} shown|{name}": few[name] for name in ("LMC", "bisector", "bisector, unit force")}
    return rows


def tuning_rows(shown: dict[str, list[Demonstration]]) -> dict[str, Row]:
    """The played methods with every stiffness, with and without their wrench."""
    rows: dict[str, Row] = {}
    for kind, given in shown.items():
        for name in ("replay", "dmp", "gmr", "seds", "acp"):
            learnt = document_of(name, given)
            for k, with_force in TUNING:
                phase = {**learnt["phases"][0], "feedforward": with_force}
                phase["stiffness"] = {**phase["stiffness"], "translation": k}
                said = f"{name} {k:g} N/m{', wrench' if with_force else ''}"
                rows[f"{kind}|{said}"] = Row(document={**learnt, "phases": [phase]})
    return rows


def executed(
    scene: Scene, rows: dict[str, Row], turn: Float, rng: np.random.Generator, seed: int, longest: float = LONGEST
) -> Any:  # fmt: skip
    """Whether each method's moved runs, and its run in place, reached the goal: lists by key."""
    count = MOVED + 1
    moved = np.arange(count) < MOVED
    offsets = starts(scene, turn, rng, count, 0.003)
    draws = {f"start.offset_{a}": offsets[:, i] for i, a in enumerate("xyz")}
    draws |= {f"fixture.offset_{a}": moved * rng.uniform(-0.002, 0.002, count) for a in "xyz"}
    draws |= {f"fixture.tilt_{a}": moved * np.radians(rng.uniform(-2.0, 2.0, count)) for a in "xyz"}
    draws["world.friction"] = scene.friction * np.where(moved, rng.uniform(0.8, 1.2, count), 1.0)
    setup = Setup(robot=load_robot_model("free_tool"), scene=scene,
                  center_of_compliance=np.array(scene.tool.frames["tip"]))  # fmt: skip
    noise = [g for _ in rows for g in np.random.default_rng([seed, 1]).spawn(count)]
    tiled = {key: np.tile(values, len(rows)) for key, values in draws.items()}
    each = [row for row in rows.values() for _ in range(count)]
    good = simulate(Rows(each), setup, tiled, noise, duration_s=longest).success.reshape(-1, count)
    return {key: done.tolist() for key, done in zip(rows, good, strict=True)}


def run_set(family: str, seed: int, kinds: Sequence[str], learners: Sequence[str], tune: bool = False) -> Any:
    """One instance: for each person and method, whether each run reached the goal, the run in place last."""
    scene, turn, rng = drawn(family, seed)
    shown, failed = demonstrations(scene, turn, rng, kinds, EACH)
    rows = tuning_rows(shown) if tune else rows_of_set(shown, turn, scene, learners)
    return {"family": family, "seed": seed, "failed": failed, "results": executed(scene, rows, turn, rng, seed)}


def directions(seed: int, family: str, kinds: Sequence[str]) -> list[str]:
    """How far below a hump's floor each learned push points, beside the pushes that pass (no execution)."""
    scene, turn, rng = drawn(family, seed)
    low = np.degrees(np.arctan(scene.friction))
    high, lines = 90.0 - low - np.degrees(scene.params["slope"]), []
    for kind, shown in demonstrations(scene, turn, rng, kinds, EACH)[0].items():
        for name, row in (("LMC", lmc_row(shown)), ("LMC, old rule", lmc_row(shown, contact_modes=False))):
            x, _, z = turn.T @ row.push
            below = np.degrees(np.arctan2(-z, x)) if row.push.any() else np.nan
            said = "passes" if low < below < high else "does not"
            lines.append(f"{seed} {kind:12} {name:14} {below:5.1f} in {low:.1f} to {high:.1f}: {said}")
    return lines


def table(runs: Sequence[dict[str, Any]]) -> list[str]:
    """Lines of a table: moved runs, sets with their exact interval, and runs in place, by person and method."""
    lines = []
    for key in dict.fromkeys(key for run in runs for key in run["results"]):
        sets = [run["results"][key] for run in runs if key in run["results"]]
        whole = sum(sum(each[:MOVED]) >= ENOUGH for each in sets)
        low, high = clopper_pearson(whole, len(sets))
        counted = f"{sum(sum(each[:MOVED]) for each in sets)} of {MOVED * len(sets)}"
        kind, name = key.split("|")
        bounds = f"{100 * low:.0f}-{100 * high:.0f} %"
        in_place = f"in place {sum(each[MOVED] for each in sets)} of {len(sets)}"
        lines.append(f"{kind:16} {name:36} {counted:>10}   sets {whole:2} of {len(sets)} {bounds:>9}   {in_place}")
    return lines


def main(given: Sequence[str]) -> None:
    """Run the sets of a family and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("family", choices=sorted(set(FAMILIES) - {"bayonet"}))
    parser.add_argument("--sets", type=int, default=20)
    parser.add_argument("--first", type=int, default=9000, help="seed of the first set")
    parser.add_argument("--kinds", nargs="+", default=PEOPLE, choices=KINDS)
    parser.add_argument("--learners", nargs="*", default=[FEW], help="kinds of people whom learners of motions see")
    parser.add_argument("--directions", action="store_true", help="of humps: only what is learned, nothing executed")
    parser.add_argument("--tune", action="store_true", help="only played methods, with every stiffness")
    args = parser.parse_args(given)
    runs = []
    for seed in range(args.first, args.first + args.sets):
        if args.directions:
            print("\n".join(directions(seed, args.family, args.kinds)), flush=True)
            continue
        runs.append(run_set(args.family, seed, args.kinds, args.learners, args.tune))
        print(json.dumps(runs[-1]), file=sys.stderr, flush=True)
    print("\n".join(table(runs) if runs else []))


if __name__ == "__main__":
    main(sys.argv[1:])

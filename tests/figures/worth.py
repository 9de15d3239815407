"""Tasks in which averages of a demonstration do not work: LMC beside its nulls, set by set.

    python -m tests.figures.worth hump_low --sets 20 --first 9000
    python -m tests.figures.worth all --sets 20 --first 9600 --workers 2 --out sets.jsonl
    python -m tests.figures.worth all --kinds "noise 8" "noise 15" --learners --methods LMC bisector "true push"

A set is an instance of a task (geometry, friction and the whole fixture's attitude are drawn) with three uneven
demonstrations by one simulated person of each kind. Every method is run from five drawn starts with the fixture moved
by up to 2 mm and turned by up to 2 degrees about each axis and friction off by up to 20 %, and from one with nothing
moved ("in place"). All methods run on the same draws, in one simulation. A set passes if four of five moved runs do.
Sets are the unit of the intervals, because the draws of a set share their push.

"all" runs every task, the bayonet's own methods among them. Sets that are in FILE already are not run again.
`--methods` runs rows of these names alone, and `--learners` without a kind leaves the played methods out. People of 15
degrees of noise are asked for by name, teach LMC and three averages alone, and are nobody of "whoever shows it".
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import Any

import numpy as np

from skillframe.demonstration.record import Demonstration
from skillframe.frames import Float
from skillframe.world.scene import Scene
from tests.figures import bayonets
from tests.figures.worth_ablations import ablated
from tests.figures.worth_families import FAMILIES, FLOORS, KINDS, LONGER_S, SHORT, demonstrations, drawn
from tests.figures.worth_methods import document_of, hand_written, lmc_row, played, pushes
from tests.figures.worth_runs import EACH, executed, side_by_side, table
from tests.figures.worth_skills import LONGEST, Row

PEOPLE = ("noise 8", "bias 10", "hesitating", "wrong first")
PLAYED = ("replay", "mean path", "dmp", "gmr", "seds", "acp")
SHAKY, OF_SHAKY = "noise 15", ("LMC", "bisector", "mean motion", "mean force")
FEW = "noise 8"  # the kind of person whose one and two demonstrations are learned as well
TUNING = [(k, with_force) for k in (500.0, 1000.0, 2000.0, 4000.0) for with_force in (True, False)]


def rows_of_set(
    shown: dict[str, list[Demonstration]], turn: Float, scene: Scene, learners: Sequence[str], ablations: bool = False
) -> dict[str, Row]:  # fmt: skip
    """Every method by "person|method"."""
    rows: dict[str, Row] = {f"|{name}": row for name, row in hand_written(turn, scene.task).items()}
    for kind, given in shown.items():
        taught = pushes(given)
        rows |= {f"{kind}|{name}": taught[name] for name in (OF_SHAKY if kind == SHAKY else taught)}
        if ablations:
            rows |= {f"{kind}|{name}": row for name, row in ablated(given, taught["LMC"]).items()}
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


def run_set(
    family: str, seed: int, kinds: Sequence[str], learners: Sequence[str], tune: bool = False,
    methods: Sequence[str] | None = None, ablations: bool = False,
) -> Any:  # fmt: skip
    """One instance: for each person and method, whether each run reached the goal, the run in place last."""
    scene, turn, rng = drawn(family, seed)
    floors = FLOORS.get(family, SHORT)
    shown, failed = demonstrations(scene, turn, rng, kinds, EACH, floors)
    rows = tuning_rows(shown) if tune else rows_of_set(shown, turn, scene, learners, ablations)
    if methods:
        rows = {k: row for k, row in rows.items() if (name := k.split("|")[1]) in methods or name.startswith("without")}
    unlike = {key: row for key, row in rows.items() if next(k for k in rows if rows[k] is row) == key}
    done = executed(scene, unlike, turn, rng, seed, LONGER_S.get(family, LONGEST), floors)
    results = {key: done[next(k for k in unlike if rows[k] is row)] for key, row in rows.items()}
    return {"family": family, "seed": seed, "failed": failed, "results": results}


def directions(seed: int, family: str, kinds: Sequence[str], ablations: bool = False) -> list[tuple[str, str, float]]:
    """Person, rule left out ("" for none), and angle between learned and true push [deg] (no execution)."""
    scene, turn, rng = drawn(family, seed)
    found, true = [], np.array(scene.task.direction)
    for kind, shown in demonstrations(scene, turn, rng, kinds, EACH, FLOORS.get(family, SHORT))[0].items():
        whole = lmc_row(shown)
        for name, row in {"": whole, **(ablated(shown, whole) if ablations else {})}.items():
            off = np.degrees(np.arccos(np.clip(row.push @ true, -1.0, 1.0))) if row.push.any() else np.nan
            found.append((kind, name, float(off)))
    return found


def off_true(family: str, args: argparse.Namespace) -> list[str]:
    """A line for each rule left out: pushes learned, and the root mean square and largest of their angles."""
    each: dict[str, list[float]] = {}
    for seed in range(args.first, args.first + args.sets):
        for _, name, off in directions(seed, family, args.kinds, args.ablations):
            each.setdefault(name, []).append(off)
    lines = []
    for name, given in each.items():
        off = np.array(given)[np.isfinite(given)]
        spread = f"{np.sqrt(np.mean(off**2)):5.1f} degrees (rms) off the true push, {off.max():5.1f} at most"
        lines.append(f"{family:10} {name or 'LMC':36} {len(off)} of {len(given)} pushes, {spread}")
    return lines


def one(family: str, seed: int, args: argparse.Namespace) -> dict[str, Any]:
    """A set of any family, as `run_set`."""
    if family == "bayonet":
        return bayonets.run_set(seed)
    return run_set(family, seed, args.kinds, args.learners, args.tune, args.methods, args.ablations)


def sets_of(families: Sequence[str], args: argparse.Namespace) -> list[dict[str, Any]]:
    """The sets asked for: those that the file holds, and the rest run, written as they come."""
    done = {(run["family"], run["seed"]): run for run in map(json.loads, _lines(args.out))}
    asked = [(family, seed) for seed in range(args.first, args.first + args.sets) for family in families]
    with ProcessPoolExecutor(args.workers) as pool:
        todo = [pool.submit(one, family, seed, args) for family, seed in asked if (family, seed) not in done]
        for each in as_completed(todo):
            run = each.result()
            done[run["family"], run["seed"]] = run
            print(json.dumps(run), file=sys.stderr, flush=True)
            if args.out:
                with args.out.open("a") as out:
                    out.write(json.dumps(run) + "\n")
    return [done[each] for each in asked]


def _lines(path: Path | None) -> list[str]:
    return path.read_text().splitlines() if path and path.exists() else []


def main(given: Sequence[str]) -> None:
    """Run the sets of a family, or of all, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("families", nargs="+", choices=["all", *sorted(FAMILIES)], help="several make one table")
    parser.add_argument("--sets", type=int, default=20)
    parser.add_argument("--first", type=int, default=9000, help="seed of the first set")
    parser.add_argument("--kinds", nargs="+", default=PEOPLE, choices=KINDS)
    parser.add_argument("--learners", nargs="*", default=[FEW], help="kinds of people whom learners of motions see")
    parser.add_argument("--methods", nargs="+", help="names of the rows to run; all if left out")
    parser.add_argument("--ablations", action="store_true", help="LMC without each of its rules as well")
    parser.add_argument("--directions", action="store_true", help="only what is learned, nothing executed")
    parser.add_argument("--tune", action="store_true", help="only played methods, with every stiffness")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--out", type=Path, help="file of the sets, a JSON line each")
    args = parser.parse_args(given)
    families = list(FAMILIES) if "all" in args.families else args.families
    if args.directions:
        for family in families:
            print("\n".join(off_true(family, args)), flush=True)
        return
    runs = sets_of(families, args)
    whole = [kind for kind in args.kinds if kind != SHAKY]
    print("\n".join(side_by_side(runs, whole) if len(families) > 1 else table(runs)))


if __name__ == "__main__":
    main(sys.argv[1:])

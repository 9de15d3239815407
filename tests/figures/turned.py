"""What a learned push adds where nobody tells how a fixture is turned: AutoMate's assemblies in drawn orientations.

    python -m tests.figures.turned AUTOMATE --out FOLDER [--assemblies 20] [--trials 10] [--seed 40000]

An orientation, up to 30 degrees about each axis, is drawn for each assembly, and nobody knows it. A demonstrated skill
is learned in it. A push that was written for an upright fixture goes down all the same. The fixture stays as it is, and
the written direction is turned by the inverse orientation in its place: where the arm carries its own weight, as here,
both are the same but for the arm's posture. Four methods on the same draws of 2 mm and 5 degrees, at friction 0.5:

    LMC + search               `learn --skill seat`
    written push + search      the push down; the approach, the plane of the search and what seats are demonstrated
    all written + search       the plane of the search and the way in are the written ones, too
    upright: push + search     the written push along the orientation, as if it were known
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import numpy as np
from skillframe_benchmarks import assembly, methods
from skillframe_benchmarks.assembly import AssemblyJob, Plan, by_level
from skillframe_benchmarks.assets import DEVELOPED, pairs

from skillframe import LearnedSkill
from skillframe.campaign.statistics import clopper_pearson
from skillframe.demonstration.record import Demonstration
from skillframe.frames import Float, rotation_matrix

MOST_RAD, LEVEL = np.radians(30.0), "2mm-5deg-0.5"


def written(shown: Sequence[Demonstration], turn: Float, *, whole: bool) -> LearnedSkill:
    """The push down, with search, as a fixture in the orientation `turn` (3, 3) sees it."""
    document = methods.push_search(shown).document
    push, search = document["phases"]
    back = turn.T
    parts = {key: _seen(push[key], back) for key in ("translation", "rotation")}
    document = {**document, "phases": [{**push, **parts}, search]}
    if whole:
        along = (back @ [0.0, 0.0, -1.0]).tolist()
        searched = {**search, "push": {**search["push"], "direction": along}}
        document |= {"phases": [document["phases"][0], searched], "seat": {**document["seat"], "way": along}}
    return LearnedSkill(document=document, name="written")


def _seen(part: dict[str, Any], back: Float) -> dict[str, Any]:
    turned = {key: (back @ part[key] @ back.T).tolist() for key in ("stiffness", "damping")}
    turned["compliant_axes"] = [(back @ axis).tolist() for axis in part["compliant_axes"]]
    if part["desired_direction"] is not None:
        turned["desired_direction"] = (back @ part["desired_direction"]).tolist()
    return {**part, **turned}


def main(given: Sequence[str]) -> None:
    """Run every assembly's campaign, and print a row for each and the sums."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("automate", type=Path)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--assemblies", type=int, default=20)
    parser.add_argument("--trials", type=int, default=10)
    parser.add_argument("--seed", type=int, default=40000)
    args = parser.parse_args(given)
    rng = np.random.default_rng(args.seed)
    untouched = [pair for pair in pairs(args.automate) if pair.name not in DEVELOPED]
    out = args.out or Path(tempfile.mkdtemp())
    names = ("lmc_search", "written_push", "all_written", "push_search")
    plan = replace(Plan(), trials=args.trials, seed=args.seed, levels=(LEVEL,), methods=names)
    sums, trials = dict.fromkeys(names, 0), 0
    print("| assembly | turned [deg] | " + " | ".join(names) + " |", flush=True)
    for index in rng.permutation(len(untouched))[: args.assemblies]:
        pair, turn = untouched[index], rotation_matrix(rng.uniform(-MOST_RAD, MOST_RAD, 3))
        cast(dict[str, methods.Method], methods.METHODS).update(
            written_push=lambda shown, turn=turn: written(shown, turn, whole=False),
            all_written=lambda shown, turn=turn: written(shown, turn, whole=True),
        )
        job = AssemblyJob(pair=pair, folder=out / pair.name, plan=plan)
        assembly.run(job, lambda line: print(line, file=sys.stderr, flush=True))
        off = np.degrees(np.arccos(turn[2, 2]))
        if not (job.folder / assembly.TRIALS).exists():
            print(f"| {pair.name} | {off:.0f} | not run |", flush=True)
            continue
        rows = by_level(job.folder / assembly.TRIALS, (LEVEL,), args.trials)[LEVEL]
        good = {name: sum(row["success"] and row["skill"] == f"{name}.skill.json" for row in rows) for name in names}
        trials += args.trials
        for name in names:
            sums[name] += good[name]
        print(f"| {pair.name} | {off:.0f} | " + " | ".join(str(good[name]) for name in names) + " |", flush=True)
    for name in names:
        low, high = clopper_pearson(sums[name], trials)
        print(f"{name}: {sums[name]} of {trials} ({100 * low:.0f} to {100 * high:.0f} %)")


if __name__ == "__main__":
    main(sys.argv[1:])

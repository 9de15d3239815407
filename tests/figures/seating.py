"""Seating at the hard levels: hand-written push, push and spiral, LMC, LMC and search, on the same draws.

    python -m tests.figures.seating peg plug --trials 40 --seed 1

Two demonstrations of a simulated person on the Panda teach all that is learned. Each cell has its own draws of the
fixture, shifted and tilted uniformly up to its level about both axes across the way, and turned about it by up to half
of the tilt, the same for every method. Seated is what the world calls its goal; the judge ends a trial there.
Methods with `-` leave one part of the whole out.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from collections.abc import Callable, Sequence
from copy import deepcopy
from dataclasses import replace
from math import radians
from pathlib import Path
from typing import Any

import numpy as np
from skillframe_search.handling import HANDLING, Handling
from skillframe_search.seat import build

from skillframe import learn, record
from skillframe.campaign.statistics import clopper_pearson
from skillframe.demonstration.record import Demonstration
from skillframe.document.frame import with_center
from skillframe.execution.executor import simulate
from skillframe.execution.prepare import load_robot_model, load_world, prepare
from tests import part_meshes
from tests.system.test_parts_how_to import plug_and_socket

ROBOT, DURATION_S = "panda", 15.0
ADDED = {
    "- catch": {"catch_ns_m": 0.0},
    "- upright": {"upright_nm_rad": 0.0},
    "- rock": {"rock_nm": 0.0, "slow_nm": 0.0},
    "- centre": {"centre_n": 0.0},
}
"""What a seating adds to its push, left out of the whole."""
LEVELS = {"1 mm, 2 deg": (0.001, radians(2.0)), "2 mm, 5 deg": (0.002, radians(5.0))}
FRICTIONS = (0.2, 0.5)
DOWN = [0.0, 0.0, -1.0]
Document = dict[str, Any]


def world_of(name: str, folder: Path) -> str:
    """The shipped peg, or the page's keyed plug as a fixture file of pieces."""
    return "peg_in_hole" if name == "peg" else str(part_meshes.write(folder / "plug", *plug_and_socket()))


def documents(shown: Sequence[Demonstration]) -> dict[str, Document]:
    """Every method's skill document."""
    alone = learn(shown).document
    whole = learn(shown, "seat").document
    made: dict[str, Document] = {
        "push": _pushed(alone, alone["phases"][0]),
        "push + spiral": _shipped(whole, alone),
        "LMC": alone,
        "LMC + search": whole,
        "- search": _with_seat(whole, tries=0),
        "- direction": _edited(whole, _straight_down),
        "- compliance": _edited(whole, _stiff),
        "- learned push": _edited(whole, _by_hand),
        "- approach": _with_seat(whole, approach=False),
    }
    return made


def _with_seat(document: Document, **changes: Any) -> Document:
    return {**document, "seat": {**document["seat"], **changes}}


def _edited(document: Document, edit: Callable[[Document], None]) -> Document:
    result = deepcopy(document)
    edit(result["phases"][0])
    return result


def _straight_down(phase: Document) -> None:
    phase["translation"]["desired_direction"] = DOWN


def _stiff(phase: Document) -> None:
    for part, value in (("translation", 1000.0), ("rotation", 20.0)):
        phase[part] |= {"stiffness": (value * np.eye(3)).tolist(), "compliant_axes": [], "fully_compliant": False}


def _by_hand(phase: Document) -> None:
    """Straight down at 12 N, free sideways, 3 Nm/rad: prototype's push."""
    _straight_down(phase)
    phase["translation"] |= {"stiffness": np.diag([0.0, 0.0, 1000.0]).tolist(), "speed": 0.02}
    phase["rotation"] |= {"stiffness": (3.0 * np.eye(3)).tolist(), "desired_direction": None, "speed": 0.0}
    phase["stop"] |= {"lead_force_n": 12.0}


def _pushed(document: Document, phase: Document) -> Document:
    changed = deepcopy(phase)
    _by_hand(changed)
    return {**document, "phases": [changed]}


def _shipped(whole: Document, alone: Document) -> Document:
    """The hand-written push, and on a stall the spiral that shipped before: 10 N, 2000 N/m, pitch 1.6 mm."""
    result = deepcopy(_with_seat(whole, approach=False, settle_s=0.0))
    _by_hand(result["phases"][0])
    spiral = result["phases"][1]
    spiral["push"]["force"] = 10.0
    spiral["path"] |= {"speed": 0.015, "acceleration": 0.3, "pitch": 0.0016, "radius": 0.0, "passes": 1}
    spiral["stiffness"] = {"translation": 2000.0, "rotation": 60.0, "turn": None}
    spiral["dither"] = {}
    spiral["stop"] = {"time_s": 20.0}
    return result


def draws_of(level: str, friction: float, count: int, seed: int) -> dict[str, Any]:
    """Where the fixture is, (count,) each."""
    shift, tilt = LEVELS[level]
    rng = np.random.default_rng([seed, list(LEVELS).index(level), round(10 * friction)])
    drawn = {f"fixture.offset_{axis}": rng.uniform(-shift, shift, count) for axis in "xy"}
    drawn |= {f"fixture.tilt_{axis}": rng.uniform(-tilt, tilt, count) for axis in "xy"}
    drawn["fixture.tilt_z"] = rng.uniform(-0.5 * tilt, 0.5 * tilt, count)
    return drawn | {"world.friction": np.full(count, friction)}


def cell(
    world: str, document: Document, how: Handling, level: str, friction: float, count: int, seed: int
) -> dict[str, Any]:
    """What became of each trial of one method at one level and friction."""
    scene = load_world(world, {})
    skill, setup = prepare(load_robot_model(ROBOT), scene, document, "tip")
    if document["type"] == "seat":
        skill = build(with_center(document, setup.center_of_compliance.tolist()), how)
    setup = replace(setup, stop_when=scene.goal)
    rngs = [np.random.default_rng([seed, 7, i]) for i in range(count)]
    result = simulate(skill, setup, draws_of(level, friction, count, seed), rngs, duration_s=DURATION_S)
    return {
        "good": [bool(v) for v in result.success], "seconds": [float(v) for v in result.duration_s],
        "peak": [float(v) for v in result.peak_force_n], "reason": [str(r) for r in result.reason],
    }  # fmt: skip


def line(name: str, found: dict[str, Any]) -> str:
    """A row of the table."""
    good = np.array(found["good"])
    low, high = clopper_pearson(int(good.sum()), len(good))
    seconds = np.array(found["seconds"])[good]
    peak = np.array(found["peak"])
    time = f"{np.median(seconds):.1f} / {np.quantile(seconds, 0.9):.1f} s" if len(seconds) else "-"
    return (
        f"| {name} | {good.sum()} of {len(good)} | {100 * low:.0f}-{100 * high:.0f} % | {time} | "
        f"{np.median(peak):.0f} / {np.quantile(peak, 0.95):.0f} / {peak.max():.0f} N |"
    )


def main(given: Sequence[str]) -> None:
    """Print a table for each world, level and friction."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("worlds", nargs="+", choices=["peg", "plug"])
    parser.add_argument("--trials", type=int, default=40)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--methods", nargs="*")
    parser.add_argument("--levels", nargs="*", default=list(LEVELS))
    parser.add_argument("--frictions", nargs="*", type=float, default=FRICTIONS)
    args = parser.parse_args(given)
    with tempfile.TemporaryDirectory() as folder:
        for name in args.worlds:
            world = world_of(name, Path(folder))
            made = documents(record(world, robot=ROBOT, count=2, seed=1).demonstrations)
            for level in args.levels:
                for friction in args.frictions:
                    print(f"\n{name}, {level}, friction {friction:g}", flush=True)
                    for method in args.methods or [*made, *ADDED]:
                        document = made["LMC + search" if method in ADDED else method]
                        how = replace(HANDLING, **ADDED.get(method, {}))
                        found = cell(world, document, how, level, friction, args.trials, args.seed)
                        print(line(method, found), flush=True)
                        print(json.dumps([name, level, friction, method, found]), file=sys.stderr, flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])

"""Worlds with second parts and two connectors, drawn here, taught twice on the Panda, learned, run on two robots.

    python -m tests.figures.second_parts gear latch connector usb --trials 40 --seed 1

Skills: LMC alone, and LMC with the search on a stall. Draws: the fixture shifted by up to 0.3 mm and tilted by up to 1
degree about x and y, the same for every skill and robot.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from collections import Counter
from math import radians
from pathlib import Path

import numpy as np

from skillframe import learn, record
from skillframe.campaign.statistics import clopper_pearson
from skillframe.errors import SkillframeError
from skillframe.execution.executor import simulate
from skillframe.execution.prepare import load_robot_model, load_world, prepare
from tests.second_meshes import made

SHIFT, TILT, DURATION_S = 3e-4, radians(1.0), 15.0


def drawn(count: int, seed: int) -> dict[str, np.ndarray]:
    """Where the fixture is, (count,) each."""
    rng = np.random.default_rng([seed, 14])
    found = {f"fixture.offset_{axis}": rng.uniform(-SHIFT, SHIFT, count) for axis in "xy"}
    return found | {f"fixture.tilt_{axis}": rng.uniform(-TILT, TILT, count) for axis in "xy"}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("worlds", nargs="+")
    parser.add_argument("--robots", nargs="+", default=["panda", "fr3"])
    parser.add_argument("--trials", type=int, default=40)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        for name in given.worlds:
            _world(name, str(made(name, Path(folder))), given)


def _world(name: str, path: str, given: argparse.Namespace) -> None:
    try:
        shown = record(path, robot="panda", count=2, seed=given.seed).demonstrations
    except SkillframeError as error:
        print(json.dumps({"world": name, "refused": str(error)}), flush=True)
        return
    skills = {}
    for label, kind in (("LMC", "lmc"), ("LMC + search", "seat")):
        try:
            skills[label] = learn(shown, kind).document
        except SkillframeError as error:
            print(json.dumps({"world": name, "skill": label, "refused": str(error)}), flush=True)
    scene = load_world(path, {})
    for robot in given.robots:
        for label, document in skills.items():
            skill, setup = prepare(load_robot_model(robot), scene, document, "tip")
            rngs = [np.random.default_rng([given.seed, i]) for i in range(given.trials)]
            begin = time.process_time()
            result = simulate(skill, setup, drawn(given.trials, given.seed), rngs, duration_s=DURATION_S)
            cost, good = time.process_time() - begin, int(result.success.sum())
            row = {"world": name, "robot": robot, "skill": label, "success": good, "of": given.trials}
            row["interval"] = [round(x, 3) for x in clopper_pearson(good, given.trials)]
            row["seconds"] = round(float(np.median(result.duration_s)), 2)
            row["peak_n"] = round(float(np.median(result.peak_force_n)), 1)
            row["second"] = {key: [round(float(f(v)), 5) for f in (np.min, np.max)] for key, v in result.second.items()}
            row["times_real_time"] = round(float(result.duration_s.sum()) / cost, 1)
            row["failed"] = Counter(str(f)[:70] for f in result.failure if f).most_common(3)
            print(json.dumps(row), flush=True)


if __name__ == "__main__":
    main()

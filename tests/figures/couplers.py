"""Couplers shown by pairs of demonstrations: the learned push and one written by hand.

    python -m tests.figures.couplers --pairs 20 --seed 8888

It, and one straight down written by hand, then run on the same draws with the fixture moved, as in
plugins/baselines/comparison/hose_coupler.toml, at the tip. All runs are one simulation.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

import numpy as np

from skillframe.campaign.statistics import clopper_pearson
from skillframe.demonstration.record import Demonstration
from skillframe.execution.executor import Setup, simulate
from skillframe.execution.prepare import load_robot_model, load_world
from skillframe.frames import Float
from tests.figures.teaching import DOWN, taught
from tests.figures.worth_methods import lmc_row
from tests.figures.worth_skills import Row, Rows, push_along

WORLD, DRAWS = "hose_coupler", 4


def pushes(pairs: Sequence[Sequence[Demonstration]]) -> dict[str, list[Row]]:
    """A row a pair: as learned, and straight down with free turns."""
    rows = {"LMC": [lmc_row(pair, at=None) for pair in pairs]}
    straight = push_along(DOWN)
    straight.stiffness[3:, 3:] = 0.0
    return rows | {"straight down": [straight] * len(pairs)}


def run(rows: Sequence[Row], seed: int) -> Float:
    """Whether each row's `DRAWS` runs ended flush, (n, DRAWS). Equal seeds give equal draws."""
    n, rng = len(rows) * DRAWS, np.random.default_rng(seed)
    draws = {
        "start.tilt_y": rng.choice([-0.14, 0.14], n), "fixture.offset_z": rng.uniform(-0.01, 0.01, n),
        "fixture.tilt_y": rng.uniform(-0.07, 0.07, n), "start.offset_z": np.full(n, 0.02),
    }  # fmt: skip
    scene = load_world(WORLD, {})
    setup = Setup(robot=load_robot_model("free_tool"), scene=scene,
                  center_of_compliance=np.array(scene.tool.frames["tip"]))  # fmt: skip
    each = [row for row in rows for _ in range(DRAWS)]
    result = simulate(Rows(each), setup, draws, np.random.default_rng([seed, 1]).spawn(n), duration_s=10.0)
    return result.success.reshape(-1, DRAWS)


def main(given: Sequence[str]) -> None:
    """Record, learn, run and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pairs", type=int, default=20)
    parser.add_argument("--seed", type=int, default=8888)
    args = parser.parse_args(given)
    pairs, _ = taught(WORLD, {}, 8.0, pairs=args.pairs, seed=args.seed)
    for name, rows in pushes(pairs).items():
        way = np.array([row.push for row in rows])
        off = np.degrees(np.arctan2(way[:, :2], -way[:, 2:]))
        good = run(rows, args.seed)
        low, high = clopper_pearson(int(good.all(axis=1).sum()), len(rows))
        rms, most = np.sqrt((off**2).mean(axis=0)), np.abs(off).max(axis=0)
        print(
            f"{name:18} off in the plane of the tilt {rms[0]:.1f} (most {most[0]:.1f}), across {rms[1]:.1f} "
            f"({most[1]:.1f}) degrees; {good.sum()} of {good.size} flush, "
            f"all {DRAWS} of a pair {good.all(axis=1).sum()} of {len(rows)} ({100 * low:.0f}-{100 * high:.0f} %)"
        )


if __name__ == "__main__":
    main(sys.argv[1:])

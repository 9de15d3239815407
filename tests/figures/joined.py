"""How many real trials simulated ones are worth, with another physics in the place of the robot.

    python -m tests.figures.joined [--trials 2000] [--seed 1] [--repeats 500]

A push that is learned in the valley runs on a tool with position noise, from starts 70 mm to either side. "Real" trials
have twice the friction, a sensor with four times the noise, and another noise. Each has a simulated pair of the same
samples, and a campaign of its own tells the simulation's rate. Of these, pairs are drawn again and again. Printed: how
often the interval misses the real rate at any of three looks (10, 30 and all pairs), and the real trials saved, against
the interval of real trials alone that is valid at every look.
"""

from __future__ import annotations

import argparse
import tempfile
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from skillframe_certify.joined import joined

from skillframe import Campaign, learn, record

REACH_M = 0.07
DURATION_S = 3.0  # so that friction and noise decide whether a run from afar ends in time
REAL = {"world.friction": (0.2, 0.6), "sensor.force_noise": 1.2}
SIMULATED = {"world.friction": (0.1, 0.3), "sensor.force_noise": 0.3}


def outcomes(folder: Path, offsets: list[float] | None, physics: dict[str, Any], trials: int, seed: int) -> Any:
    """Offsets (n,) and successes (n,) of a campaign; offsets None: drawn evenly."""
    low, high = physics["world.friction"]
    start = {"uniform": [-REACH_M, REACH_M]} if offsets is None else {"values": offsets}
    done = Campaign(
        world="valley", robot="free_tool", skills=[str(folder / "push.skill.json")], trials=trials, seed=seed,
        duration_s=DURATION_S, vary={"start.offset_x": start, "world.friction": {"uniform": [low, high]}},
        set={"sensor.force_noise": physics["sensor.force_noise"]},
    ).run(folder / f"results{seed}")  # fmt: skip
    rows = sorted(done.rows, key=lambda row: row["trial"])
    return np.array([row["start.offset_x"] for row in rows]), np.array([bool(row["success"]) for row in rows])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--trials", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--repeats", type=int, default=500)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        learn(record("valley", robot="free_tool", count=2, seed=given.seed).demonstrations).save(
            folder / "push.skill.json"
        )
        offsets, real = outcomes(folder, None, REAL, given.trials, given.seed)
        _, pairs = outcomes(folder, offsets.tolist(), SIMULATED, given.trials, given.seed + 1)
        _, own = outcomes(folder, None, SIMULATED, given.trials, given.seed + 2)
    rate = real.mean()
    print(f"real {rate:.3f}, simulated {own.mean():.3f}, pairs that differ {np.mean(real != pairs):.3f}")
    rng = np.random.default_rng(given.seed)
    for count in (30, 60, 100):
        missed, saved, widths = 0, [], []
        for _ in range(given.repeats):
            chosen = rng.choice(given.trials, count, replace=False)
            pool = int(rng.choice(own, 1000, replace=False).sum())
            found = [_joined(real[chosen[:n]], pairs[chosen[:n]], (pool, 1000)) for n in (10, 30, count)]
            missed += any(not each.interval.low <= rate <= each.interval.high for each in found)
            saved.append(1.0 - count / found[-1].worth)
            widths.append((found[-1].interval.width, found[-1].alone.width))
        width, alone = np.mean(widths, axis=0)
        print(f"{count} real trials: width {width:.3f}, alone {alone:.3f}; real trials saved {np.mean(saved):.0%}; "
              f"the rate is outside at some look in {missed} of {given.repeats}", flush=True)  # fmt: skip


def _joined(y: Any, f: Any, simulated: tuple[int, int]) -> Any:
    counts = [int(np.sum((y == a) & (f == b))) for a, b in product((True, False), repeat=2)]
    return joined((counts[0], counts[1], counts[2], counts[3]), simulated)


if __name__ == "__main__":
    main()

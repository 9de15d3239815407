"""Bayonets in any attitude, to push and turn in one phase: LMC beside pushes alone, turns alone, averages and replays.

    python -m tests.figures.bayonets --sets 10 --first 9200

Sets, draws and counting are those of `tests.figures.worth`. The people press with 5 N at most, and every push does.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from typing import Any

import numpy as np
from skillframe_lmc.intervals import rotation, track
from skillframe_lmc.settings import Settings

from skillframe.demonstration.record import Demonstration
from skillframe.frames import Float, unit
from tests.figures.worth_families import GENTLE_N, demonstrations, drawn
from tests.figures.worth_methods import averages, lmc_row, played
from tests.figures.worth_runs import EACH, executed, table
from tests.figures.worth_skills import STIFF_NM_RAD, Row, push_along

PERSON, LONGEST, LIKE = "noise 8", 14.0, Row(lead=GENTLE_N["bayonet"], twist=2.0)


def mean_turn(shown: Sequence[Demonstration]) -> Float:
    """The mean unit direction of turning (3,) of all intervals."""
    parts = [rotation(track(d, np.zeros(3), np.zeros(3), "base"), Settings()) for d in shown]
    return unit(np.concatenate([unit(part.displacement) for part in parts]).mean(axis=0))


def turn_about(axis: Float) -> Row:
    """A turn alone: free in translation, upright otherwise."""
    stiffness = np.zeros((6, 6))
    stiffness[3:, 3:] = STIFF_NM_RAD * np.eye(3)
    return Row(turn=unit(axis), turning=0.087, stiffness=stiffness)


def rows_of(shown: Sequence[Demonstration], turn: Float) -> dict[str, Row]:
    """Every method by "person|method"."""
    normal, down, about = turn @ np.array([0.0, 0.0, -1.0]), np.array([0.0, 0.0, -1.0]), mean_turn(shown)
    lmc = lmc_row(shown, lead_force_n=LIKE.lead)
    rows = {
        "|axis, push alone": push_along(normal, None, LIKE), "|axis, turn alone": turn_about(-normal),
        "|base z, push and turn": push_along(down, -down, LIKE),
        "|axis, push and turn": push_along(normal, -normal, LIKE), f"{PERSON}|LMC": lmc,
    }  # fmt: skip
    for name, given in averages(shown).items():
        rows |= {f"{PERSON}|{name}, and mean turn": push_along(given, about, LIKE)}
    rows[f"{PERSON}|mean motion alone"] = push_along(averages(shown)["mean motion"], None, LIKE)
    rows[f"{PERSON}|mean turn alone"] = turn_about(about)
    kinds = ("replay", "mean path", "dmp", "acp")
    return rows | {f"{PERSON}|{name}": row for name, row in played(shown, kinds, lmc.stiffness).items()}


def run_set(seed: int) -> dict[str, Any]:
    """One instance, as `worth.run_set`. Without three demonstrations it has no results."""
    scene, turn, rng = drawn("bayonet", seed)
    shown, failed = demonstrations(scene, turn, rng, [PERSON], EACH)
    rows = {key: row for given in shown.values() for key, row in rows_of(given, turn).items()}
    results = executed(scene, rows, turn, rng, seed, LONGEST) if rows else {}
    return {"family": "bayonet", "seed": seed, "failed": failed, "results": results}


def main(given: Sequence[str]) -> None:
    """Run the sets and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sets", type=int, default=10)
    parser.add_argument("--first", type=int, default=9200, help="seed of the first set")
    args = parser.parse_args(given)
    runs = []
    for seed in range(args.first, args.first + args.sets):
        runs.append(run_set(seed))
        print(json.dumps(runs[-1]), file=sys.stderr, flush=True)
    print("\n".join(table(runs)))


if __name__ == "__main__":
    main(sys.argv[1:])

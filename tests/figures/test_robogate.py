"""RoboGate's public failure dictionary (MIT): its border from a tenth of the rows, and its robots compared.

The files are not kept here. Put ur5e_failure_dictionary.json and ur3e_failure_dictionary.json of
github.com/liveplex-cpu/robogate-failure-dictionary into a folder and name it in SKILLFRAME_ROBOGATE.
"""

import json
import os
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import rankdata
from skillframe_certify.compare import compare
from skillframe_certify.surrogate import Surrogate
from skillframe_certify.trials import read_trials

FOLDER = os.environ.get("SKILLFRAME_ROBOGATE")
OUTCOMES = ("sample_idx", "success", "cycle_time", "dist_to_target")
SEEDS, TENTH = 20, 1000

pytestmark = [
    pytest.mark.figures,
    pytest.mark.skipif(not FOLDER, reason="SKILLFRAME_ROBOGATE names no folder with RoboGate's files"),
]


def rows_of(robot):
    """The experiments of a robot: quantities scaled to -1 to 1 (n, d), their names, and successes (n,)."""
    rows = json.loads((Path(FOLDER) / f"{robot}_failure_dictionary.json").read_text())["experiments"]
    names = [name for name, value in rows[0].items() if isinstance(value, int | float) and name not in OUTCOMES]
    points = np.array([[row[name] for name in names] for row in rows], dtype=float)
    low, high = points.min(axis=0), points.max(axis=0)
    return 2.0 * (points - low) / (high - low) - 1.0, names, np.array([row["success"] for row in rows], dtype=bool)


def area_under_curve(scores, works):
    """Chance that a success scores above a failure (Mann and Whitney's U over the number of pairs)."""
    won = int(works.sum())
    return (rankdata(scores)[works].sum() - won * (won + 1) / 2) / (won * (len(works) - won))


@pytest.mark.parametrize("robot", ["ur5e", "ur3e"])
def test_the_border_from_a_tenth_of_the_rows_ranks_the_others_where_the_quantities_tell(robot):
    points, names, works = rows_of(robot)
    areas, right = [], []
    for seed in range(SEEDS):
        order = np.random.default_rng(seed).permutation(len(works))
        known, held = order[:TENTH], order[TENTH:]
        scores = Surrogate(points[known], works[known]).mean(points[held])
        areas.append(area_under_curve(scores, works[held]))
        right.append(float(np.mean((scores > 0.0) == works[held])))
    told = {name: round(float(np.corrcoef(points[:, i], works)[0, 1]), 2) for i, name in enumerate(names)}
    common = max(works.mean(), 1.0 - works.mean())
    print(f"{robot}: AUC median {np.median(areas):.3f}, {min(areas):.3f} to {max(areas):.3f}")
    print(f"  right label {np.median(right):.3f}, the commoner label alone {common:.3f}; correlations {told}")
    if max(map(abs, told.values())) > 0.1:  # where some quantity tells the outcome; chance gives 0.03 in 10,000 rows
        assert np.median(areas) > 0.777  # what its authors state for their risk model, of another robot
    else:
        assert abs(np.median(areas) - 0.5) < 0.03  # nothing to learn: 900 successes give the AUC 0.01 of deviation


def test_compare_reads_the_dictionary(tmp_path):
    lines = ["trial,policy,success"]
    for robot in ("ur5e", "ur3e"):  # other draws for each, so other numbers
        lines += [f"{robot}-{i},{robot},{int(won)}" for i, won in enumerate(rows_of(robot)[2])]
    (tmp_path / "trials.csv").write_text("\n".join(lines) + "\n")
    found = compare(read_trials(tmp_path / "trials.csv"))
    print([(r.policy, r.trials, r.successes, round(r.low, 3), round(r.high, 3)) for r in found.standings])
    assert found.pairs[0].better == "ur5e"

"""LMC beside replay and DMP, on the same draws.

The same demonstrations teach three kinds of skill: replay of the motion, dynamic movement primitives, and linear motion
with compliance (LMC), which is learned from the forces as well. Each meets the same shifted and tilted holes, so that
they can be compared in pairs, with a test that knows how many comparisons were made.
"""

from argparse import ArgumentParser
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from skillframe import Campaign, learn, record

ABOVE = {"start.offset_z": "2mm"}  # the most tilted hole: a start inside the fixture is no trial
VARY = {"fixture.offset_x": {"uniform": [-0.008, 0.008]}, "fixture.tilt_y": {"uniform": [-0.12, 0.12]}}


def main(out: Path, quick: bool) -> None:
    """Learn three skills, run them side by side, draw rates and forces."""
    demonstrations = record("peg_in_hole", "free_tool", count=2, seed=2)
    skills = {
        "LMC": learn(demonstrations),
        "replay": learn(demonstrations[0], "replay"),
        "DMP": learn(demonstrations, "dmp"),
    }
    campaign = Campaign(
        world="peg_in_hole", robot="free_tool", coc="tip", duration_s=8.0, skills=skills, vary=VARY, set=ABOVE,
        trials=8 if quick else 100, seed=5,
    )  # fmt: skip
    results = campaign.run(traces=0)
    print(results)
    for pair in results.comparisons:
        if pair["p_value"] is not None:
            print(f"{pair['first']} against {pair['second']}: p = {pair['p_value']:.2g}, {pair['correction']}")

    figure, (left, right) = plt.subplots(1, 2, figsize=(9.6, 4.2), layout="constrained")
    rates = [results.skills[f"{name}.skill.json"] for name in skills]
    heights = np.array([rate.rate for rate in rates])
    bounds = np.array([rate.interval_95 for rate in rates])
    spread = np.abs(bounds.T - heights)
    left.bar(list(skills), heights, yerr=spread, capsize=6, color=["#1f77b4", "#b0b8c2", "#b0b8c2"])
    left.set(
        ylabel="success rate, 95 % interval", ylim=(0.0, 1.05), title=f"{rates[0].trials} shifted and tilted holes"
    )
    forces = [results.table(name)["peak_force_n"] for name in skills]
    right.boxplot(forces, tick_labels=list(skills), showfliers=False)
    right.set(ylabel="peak contact force in simulation [N]", title="how hard they push")
    for ax in (left, right):
        ax.spines[["top", "right"]].set_visible(False)
    figure.savefig(out / "compare.png", dpi=110)


if __name__ == "__main__":
    parser = ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path(), help="folder of the picture")
    parser.add_argument("--quick", action="store_true", help="few trials")
    main(**vars(parser.parse_args()))

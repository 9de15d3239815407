"""A campaign with its map: where does the skill work?

One run says little. Here the hole is shifted and tilted, nobody tells the robot, and every trial is one dot. The
campaign gives the success rate with an exact interval, and the report draws the same map with the border within which
theory predicts success.
"""

from argparse import ArgumentParser
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from skillframe import Campaign, learn, record, report

ABOVE = {"start.offset_z": "10mm"}  # the most tilted hole: a start inside the fixture is no trial
VARY = {"fixture.offset_x": {"sobol": [-0.012, 0.012]}, "fixture.tilt_y": {"sobol": [-0.25, 0.25]}}


def main(out: Path, quick: bool) -> None:
    """Learn, try many times, draw the map, and write the report."""
    skill = learn(record("peg_in_hole", "free_tool", count=2, seed=2))
    campaign = Campaign(
        name="Peg in hole: shifted and tilted", world="peg_in_hole", robot="free_tool", coc="tip", duration_s=8.0,
        skills={"peg": skill}, vary=VARY, set=ABOVE, trials=16 if quick else 256, seed=12,
    )  # fmt: skip
    results = campaign.run(traces=0 if quick else 4)
    print(results)
    table = results.table()
    for cause, count in zip(*np.unique(table["ended_by"][~table["success"]], return_counts=True), strict=True):
        print(f"{count} failures ended by: {cause}")

    x, y = 1000.0 * table["fixture.offset_x"], np.degrees(table["fixture.tilt_y"])
    figure, ax = plt.subplots(figsize=(6.4, 4.8), layout="constrained")
    good = table["success"]
    ax.scatter(x[good], y[good], color="#1f77b4", s=22, label=f"success ({good.sum()})")
    ax.scatter(x[~good], y[~good], color="#cc3c2e", marker="x", s=22, label=f"failure ({(~good).sum()})")
    low, high = results.skills["peg.skill.json"].interval_95
    ax.set(xlabel="the hole is shifted by [mm]", ylabel="and tilted by [degrees]")
    ax.set_title(f"{good.mean():.0%} succeed (95 % interval {low:.0%} to {high:.0%})")
    ax.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False)
    ax.spines[["top", "right"]].set_visible(False)
    figure.savefig(out / "campaign_map.png", dpi=110)
    print(f"report: {report(results, out / 'campaign_map.html').name}")


if __name__ == "__main__":
    parser = ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path(), help="folder of picture and report")
    parser.add_argument("--quick", action="store_true", help="few trials")
    main(**vars(parser.parse_args()))

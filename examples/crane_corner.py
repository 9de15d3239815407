"""A hydraulic crane presses its load into a corner.

The crane has no force sensor: contact forces are estimated from chamber pressures. The skill, written by hand in a
small file, pushes forward and down and is free across, so that the load slides along the pallets until the stop holds
it. The same file works on wood and on styrofoam, which gives way thirty times as easily.
"""

from argparse import ArgumentParser
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from skillframe import run

SKILL = Path(__file__).parents[1] / "docs" / "how-to" / "corner.skill.json"


def main(out: Path, quick: bool) -> None:
    """Run on one surface or on two, and draw force and pressures."""
    runs = {}
    for surface in ["wood"] if quick else ["wood", "styrofoam"]:
        done = run(SKILL, "pallets", "hiab_xs031", set={"world.surface": surface}, duration_s=15 if quick else 40)
        runs[surface] = done
        said = "success" if done.success else done.failure
        print(f"{surface}: {said} after {done.duration_s:.1f} s, peak force {done.peak_force_n / 1000:.1f} kN")

    still = runs["wood"].picture(out / "crane_still.png", far=True)
    figure, axes = plt.subplot_mosaic(
        [["still", "force"], ["still", "pressure"]], figsize=(9.6, 4.8), layout="constrained"
    )
    axes["still"].imshow(plt.imread(still))
    axes["still"].axis("off")
    for surface, colour in zip(runs, ("#8a5a2b", "#1f77b4"), strict=False):
        trace = runs[surface].trace
        kilonewtons = np.linalg.norm(trace.wrench[:, :3], axis=1) / 1000.0
        axes["force"].plot(trace.time, kilonewtons, color=colour, label=surface)
    trace = runs["wood"].trace
    for index, name in enumerate(trace.meta["actuators"]):
        axes["pressure"].plot(
            trace.time, trace.machine["pressure_a"][:, index] / 1e5, label=name.replace("_piston", "")
        )
    axes["force"].set(title="contact force, estimated from pressures", ylabel="[kN]")
    axes["pressure"].set(title="pressure at the bottom of the cylinders, on wood", xlabel="time [s]", ylabel="[bar]")
    for name in ("force", "pressure"):
        axes[name].legend(frameon=False, fontsize="small")
        axes[name].spines[["top", "right"]].set_visible(False)
    figure.savefig(out / "crane_corner.png", dpi=110)
    still.unlink()


if __name__ == "__main__":
    parser = ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path(), help="folder of the picture")
    parser.add_argument("--quick", action="store_true", help="on wood only")
    main(**vars(parser.parse_args()))

"""A hose coupler that rights itself.

A coupler has to sit flat on its seat before it can lock. Taught once from either side, the skill pushes down and is
free to turn, so that contact rights it. Where the same skill turns about the wrist, a coupler that starts too far off
tips over instead. The centre of compliance is chosen when the skill runs; nothing is learned again.
"""

from argparse import ArgumentParser
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from skillframe import SingleRun, learn, record, run

COLOURS = {"tip": "#1f77b4", "wrist": "#cc3c2e"}


def tilt(done: SingleRun) -> np.ndarray:
    """Angle of the tool to the vertical [degrees] over time."""
    x, y = done.trace.quaternion[:, 0], done.trace.quaternion[:, 1]
    return np.degrees(np.arccos(np.clip(2.0 * (x**2 + y**2) - 1.0, -1.0, 1.0)))


def main(out: Path, quick: bool) -> None:
    """Learn once, and run from several tilts about two points."""
    skill = learn(record("hose_coupler", "free_tool", count=2, seed=1))
    print(f"learned: {skill.words[0]}")
    figure, axes = plt.subplots(1, 2, figsize=(9.6, 4.2), sharey=True, layout="constrained")
    for ax, point in zip(axes, COLOURS, strict=True):
        reached = []
        for start in (-12, 12) if quick else (-12, -8, -4, 4, 8, 12):
            done = run(skill, "hose_coupler", "free_tool", coc=point, set={"start.tilt_y": f"{start}deg"})
            reached.append(done.success)
            ax.plot(done.trace.time, tilt(done), color=COLOURS[point], alpha=0.8)
            ax.plot(done.trace.time[-1], tilt(done)[-1], "o" if done.success else "x", color=COLOURS[point])
        print(f"about the {point}: {sum(reached)} of {len(reached)} starts end flat on the seat")
        ax.set(xlabel="time [s]", title=f"centre of compliance at the {point}: {sum(reached)} of {len(reached)}")
        ax.spines[["top", "right"]].set_visible(False)
    axes[0].set_ylabel("tilt of the coupler [degrees]")
    figure.savefig(out / "hose_coupler.png", dpi=110)


if __name__ == "__main__":
    parser = ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path(), help="folder of the picture")
    parser.add_argument("--quick", action="store_true", help="fewer starts")
    main(**vars(parser.parse_args()))

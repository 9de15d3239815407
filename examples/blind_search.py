"""A search by feel, learned from people who searched blindfolded.

Nobody knows exactly where the hole is. Five simulated people look for it with their eyes closed; from where they looked
a distribution is learned, and from what they felt how to press. The search that follows covers the places in order of
how likely they are, and stops when the peg falls in.
"""

from argparse import ArgumentParser
from pathlib import Path

import matplotlib.pyplot as plt

from skillframe import learn, record, run

ROUNDED = {"world.fillet": 0.0008}
FOUND = {**ROUNDED, "world.done_depth": 0.0025}


def main(out: Path, quick: bool) -> None:
    """Record blindfolded people, learn, and search from several starts."""
    recordings = record("peg_in_hole", "free_tool", teacher="blind", count=3 if quick else 5, seed=0, set=ROUNDED)
    search = learn(recordings, "search", at="tip")
    print(f"learned: {search.words[0]}")

    starts = [(4.0, -2.0), (-3.0, 4.0)] if quick else [(4.0, -2.0), (-3.0, 4.0), (5.0, 3.0)]
    figure, axes = plt.subplots(1, len(starts), figsize=(9.6, 9.6 / len(starts) + 0.5), layout="constrained")
    for ax, (x, y) in zip(axes, starts, strict=True):
        places = {**FOUND, "start.offset_x": f"{x}mm", "start.offset_y": f"{y}mm"}
        done = run(search, "peg_in_hole", "free_tool", coc="tip", set=places, duration_s=30.0)
        path = 1000.0 * done.trace.position[:, :2]
        hole = 1000.0 * done.trace.position[-1, :2]
        said = f"found after {done.duration_s:.1f} s" if done.success else "not found"
        print(f"start {x:+.0f}, {y:+.0f} mm beside the hole: {said}, at most {done.peak_force_n:.0f} N")
        ax.plot(*(path - hole).T, color="#1f77b4", lw=0.9)
        ax.plot(*(path[0] - hole), "o", color="#1f77b4", label="start")
        ax.plot(0.0, 0.0, "*", color="#cc3c2e", ms=14, label="hole" if done.success else "end")
        ax.set(title=said, xlabel="x [mm]", aspect="equal")
        ax.spines[["top", "right"]].set_visible(False)
    axes[0].set_ylabel("y [mm]")
    axes[0].legend(frameon=False)
    figure.savefig(out / "blind_search.png", dpi=110)


if __name__ == "__main__":
    parser = ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path(), help="folder of the picture")
    parser.add_argument("--quick", action="store_true", help="fewer people and starts")
    main(**vars(parser.parse_args()))

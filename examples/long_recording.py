"""Cut a long recording into phases, and run them in sequence.

Lower the coupler, then turn it until it locks: two motions, shown in one go. `segment` finds the phases from pose and
wrench, learns each as a skill of its own, and gives a policy. While it runs, the contact wrench says when the next
phase begins.
"""

from argparse import ArgumentParser
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from skillframe import record, run, segment

WORLD = {"world.interlock": 0.7}
COLOURS = ("#dbe9f6", "#fde3cf", "#e2f0d9", "#eadcf4")


def main(out: Path, quick: bool) -> None:
    """Record, segment, run."""
    demonstrations = record("hose_coupler", "free_tool", count=2 if quick else 3, seed=0, set=WORLD)
    policy = segment(demonstrations, phases=2 if quick else None)
    for line in policy.words[1:3]:
        print(line)
    cuts = policy.document["demonstrations"]

    figure, axes = plt.subplots(len(cuts), 1, figsize=(9.6, 1.8 * len(cuts) + 0.6), sharex=True, layout="constrained")
    for ax, recording, cut in zip(axes, demonstrations, cuts, strict=True):
        edges = [recording.time[0], *cut["boundaries"], recording.time[-1]]
        for label, start, stop in zip(cut["labels"], edges, edges[1:], strict=False):
            ax.axvspan(start, stop, color=COLOURS[label % len(COLOURS)])
            ax.text(
                0.5 * (start + stop),
                0.9,
                f"phase {label + 1}",
                ha="center",
                va="top",
                transform=ax.get_xaxis_transform(),
            )
        ax.plot(recording.time, np.linalg.norm(recording.wrench[:, :3], axis=1), color="#cc3c2e", lw=0.9)
        ax.set(ylabel="force [N]", ylim=(0, None))
        ax.spines[["top", "right"]].set_visible(False)
    axes[0].set_title("where each demonstration was cut")
    axes[-1].set_xlabel("time [s]")
    figure.savefig(out / "long_recording.png", dpi=110)

    done = run(policy, "hose_coupler", "free_tool", coc="tip", set={**WORLD, "start.tilt_y": "8deg"})
    print("success" if done.success else done.failure)
    for when, what in done.events:
        print(f"  {when:.2f} s {what}")


if __name__ == "__main__":
    parser = ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path(), help="folder of the picture")
    parser.add_argument("--quick", action="store_true", help="two demonstrations, and their phases counted")
    main(**vars(parser.parse_args()))

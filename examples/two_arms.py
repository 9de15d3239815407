"""Two arms: one holds the peg, the other the hole.

A person leads one arm by teleoperation while the other stands still. What is learned is then shared: each arm has its
own centre of compliance and its own part of the motion. With both arms giving way, a peg that starts eight degrees
askew still goes in.
"""

from argparse import ArgumentParser
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from skillframe_teaching.teacher import TeacherSettings

from skillframe import learn, record, run

REMOTE = TeacherSettings(kind="teleoperation", delay_s=0.02)


def main(out: Path, quick: bool) -> None:
    """Record one arm, learn for two, run both."""
    demonstrations = record("dual_peg", "dual_panda", teacher=REMOTE, count=1 if quick else 2, seed=0)
    skill = learn(demonstrations, "dual_arm", configuration="D")
    print(f"learned: {skill.words[0]}")

    done = run(skill, "dual_peg", "dual_panda", set={"start.tilt_y": "4deg" if quick else "8deg"})
    print(f"{'success' if done.success else done.failure} after {done.duration_s:.1f} s")

    still = done.picture(out / "two_arms_still.png", far=True)
    figure, axes = plt.subplot_mosaic([["still", "force"], ["still", "way"]], figsize=(9.6, 4.8), layout="constrained")
    axes["still"].imshow(plt.imread(still))
    axes["still"].axis("off")
    for arm, trace in done.arms.items():
        way = 1000.0 * np.linalg.norm(trace.position - trace.position[0], axis=1)
        print(f"the {arm} hand went {way[-1]:.0f} mm")
        axes["force"].plot(trace.time, np.linalg.norm(trace.wrench[:, :3], axis=1), label=arm)
        axes["way"].plot(trace.time, way, label=arm)
    axes["force"].set(title="contact force at each hand", ylabel="[N]")
    axes["way"].set(title="way that each hand has gone", xlabel="time [s]", ylabel="[mm]")
    for name in ("force", "way"):
        axes[name].legend(frameon=False)
        axes[name].spines[["top", "right"]].set_visible(False)
    figure.savefig(out / "two_arms.png", dpi=110)
    still.unlink()


if __name__ == "__main__":
    parser = ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path(), help="folder of the picture")
    parser.add_argument("--quick", action="store_true", help="one demonstration, half the tilt")
    main(**vars(parser.parse_args()))

"""Peg in hole from two demonstrations.

A simulated person puts a peg into a hole with 0.25 mm of play, twice. The skill that is learned from the forces pushes
down, slides along one axis and turns freely about another, so that contact aligns the peg. It then finds a hole that is
tilted by five degrees and three millimetres away, which nobody tells the robot.
"""

from argparse import ArgumentParser
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from skillframe import learn, record, run


def main(out: Path, quick: bool) -> None:
    """Record, learn, run, and draw the run."""
    demonstrations = record("peg_in_hole", "panda", count=2, seed=2)
    skill = learn(demonstrations)
    print(f"learned: {skill.words[0]}")

    tilt = "3deg" if quick else "5deg"
    done = run(skill, "peg_in_hole", "panda", coc="tip", set={"fixture.tilt_y": tilt, "fixture.offset_x": "3mm"})
    print(f"{'success' if done.success else done.failure} after {done.duration_s:.1f} s")
    print(f"peak contact force {done.peak_force_n:.1f} N, {1000 * done.final_error_m:.2f} mm from the goal")

    still = done.picture(out / "peg_in_hole_still.png")
    figure, (left, right) = plt.subplots(1, 2, figsize=(9.6, 4.2), width_ratios=(1.1, 1.0), layout="constrained")
    left.imshow(plt.imread(still))
    left.axis("off")
    left.set_title("the end of the run, cut open")
    force = np.linalg.norm(done.trace.wrench[:, :3], axis=1)
    right.plot(done.trace.time, force, color="#cc3c2e")
    right.set(xlabel="time [s]", ylabel="contact force [N]", title="a gentle insertion")
    right.spines[["top", "right"]].set_visible(False)
    figure.savefig(out / "peg_in_hole.png", dpi=110)
    still.unlink()


if __name__ == "__main__":
    parser = ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path(), help="folder of the picture")
    parser.add_argument("--quick", action="store_true", help="less tilt")
    main(**vars(parser.parse_args()))

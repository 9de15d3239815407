"""Your own robot: a URDF, a short robot.toml, and a skill that was taught on another one.

The script writes the URDF of a made-up arm, asks whether its masses can be right, and lets the arm run a skill that was
taught to a free-flying tool. A skill holds directions and forces and no joints, so that nothing is learned again.
"""

from argparse import ArgumentParser
from pathlib import Path

import matplotlib.pyplot as plt

from skillframe import learn, record, run
from skillframe.robot import audit, load_model, load_robot

# Of each joint: its axis; length [m] and mass [kg] of the link behind it.
LINKS = [("z", 0.15, 4.0), ("y", 0.42, 8.0), ("y", 0.40, 4.0), ("y", 0.08, 1.5), ("x", 0.06, 1.2), ("z", 0.06, 0.5)]
LINK = """<link name="link{i}"><inertial><origin xyz="0 0 {half}"/><mass value="{mass}"/>
<inertia ixx="{across}" iyy="{across}" izz="{along}" ixy="0" ixz="0" iyz="0"/></inertial>
<visual><origin xyz="0 0 {half}"/><geometry><cylinder radius="0.04" length="{length}"/></geometry></visual></link>
<joint name="joint{i}" type="revolute"><parent link="{parent}"/><child link="link{i}"/><origin xyz="0 0 {offset}"/>
<axis xyz="{axis}"/><limit lower="-6.3" upper="6.3" effort="200" velocity="3"/></joint>
"""
FLANGE = """<link name="flange"/><joint name="mount" type="fixed"><parent link="link6"/><child link="flange"/>
<origin xyz="0 0 0.06"/></joint>"""
TOML = """summary = "A made-up arm"
urdf = "my_arm.urdf"
[[arm]]
name = "arm"
tool_frame = "flange"
[home]
joint2 = 0.268
joint3 = 1.062
joint4 = 1.811
joint6 = 3.1416
[workspace]
fixture = [0.5, 0.0, 0.2]
"""


def write_robot(folder: Path) -> None:
    """The two files that make a robot."""
    text, parent, offset = '<robot name="my_arm"><link name="base"/>\n', "base", 0.0
    for i, (axis, length, mass) in enumerate(LINKS, start=1):
        across, along = mass * (length**2 / 12 + 0.04**2 / 4), mass * 0.04**2 / 2
        xyz = " ".join(str(int(name == axis)) for name in "xyz")
        text += LINK.format(i=i, half=length / 2, mass=mass, across=across, along=along, length=length, parent=parent,
                            offset=offset, axis=xyz)  # fmt: skip
        parent, offset = f"link{i}", length
    (folder / "my_arm.urdf").write_text(text + FLANGE + "</robot>")
    (folder / "robot.toml").write_text(TOML)


def main(out: Path, quick: bool) -> None:
    """Write, check, run, draw."""
    folder = out / "my_arm"
    folder.mkdir(exist_ok=True)
    write_robot(folder)
    found = audit(load_model(load_robot(folder)))
    print(f"usable: {found.usable}; {found.mass_kg:.1f} kg; {len(found.problems)} problems")
    skill = learn(record("peg_in_hole", "free_tool", count=2, seed=2))
    done = run(skill, "peg_in_hole", folder, coc="tip", set={"fixture.tilt_y": "3deg" if quick else "5deg"})
    print(f"{'success' if done.success else done.failure} after {done.duration_s:.1f} s on {folder.name}")

    figure, axes = plt.subplots(1, 2, figsize=(9.6, 3.9), layout="constrained")
    for ax, far, title in zip(axes, (True, False), ("the arm at the end of the run", "the peg, cut open"), strict=True):
        still = done.picture(out / "own_robot_still.png", far=far)
        ax.imshow(plt.imread(still))
        ax.set_title(title)
        ax.axis("off")
        still.unlink()
    figure.savefig(out / "own_robot.png", dpi=110)


if __name__ == "__main__":
    parser = ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path(), help="folder of the picture")
    parser.add_argument("--quick", action="store_true", help="less tilt")
    main(**vars(parser.parse_args()))

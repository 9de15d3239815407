"""Robots typed by hand, with the slips that people make in robot.toml, and robots that no simulator can hold."""

from __future__ import annotations

from pathlib import Path

import pytest
from skillframe_testkit.suites import example_demonstrations

from skillframe.cli.main import run
from skillframe.document.file import save

LINK = """<link name="{}"><inertial><origin xyz="0 0 .1"/><mass value="1"/>
<inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.005"/></inertial></link>"""
JOINT = """<joint name="j{1}" type="revolute"><parent link="{0}"/><child link="l{1}"/><origin xyz="0 0 .3"/>
<axis xyz="0 1 0"/><limit lower="-2" upper="2" effort="50" velocity="1"/></joint>"""
URDF = (
    "<robot name='r'>"
    + "".join(LINK.format(name) for name in ("base", "l1", "l2"))
    + JOINT.format("base", 1)
    + JOINT.format("l1", 2)
    + "</robot>"
)
TOML = """urdf = "r.urdf"
base = "free"
[[arm]]
name = "arm"
tool_frame = "l2"
[limits]
force_n = 80.0
"""
SLIPS = {
    "[arm] for [[arm]]": (("[[arm]]", "[arm]"), "write [[arm]] in place of [arm]"),
    "no name": (('"arm"', '""'), "an arm has an empty name"),
    "a joint driven twice": (
        ("[limits]", "[[actuation]]\njoint = 'j1'\nfmu = 'f'\n[[actuation]]\njoint = 'j1'\nfmu = 'f'\n[limits]"),
        "two drive one joint (j1, j1)",
    ),
    "a loop of one frame": (
        ("[limits]", "[[loop]]\nframe_a = 'l2'\nframe_b = 'l2'\n[limits]"),
        "closes 'l2' on itself",
    ),
    "payload of no link": (
        ("[limits]", "[payload]\nlink = 'l3'\nmass = 1\nrating = 2\n[limits]"),
        "did you mean 'l2'?",
    ),
    "friction of no joint": (("[limits]", "[friction_share]\njx = 1\n[limits]"), "named in rt's [friction_share]"),
    "friction below zero": (("[limits]", "[friction_share]\nj1 = -1\n[limits]"), "friction_share.j1: is -1"),
    "no attitude": (("[limits]", "[workspace]\norientation = [0, 0, 0, 0]\n[limits]"), "has the length 0, not 1"),
    "w, x, y, z too long": (("[limits]", "[workspace]\norientation = [1, 0, 0, 1]\n[limits]"), "a unit quaternion"),
    "infinitely far": (("[limits]", "[workspace]\nfixture = [inf, 0, 0]\n[limits]"), "inf m is beyond -100m to 100m"),
}
UNUSABLE = {
    "no inertia": lambda text: text.replace("<inertial>", "<!--").replace("</inertial>", "-->"),
    "no mass": lambda text: text.replace('mass value="1"', 'mass value="0"'),
    "negative mass": lambda text: text.replace('mass value="1"', 'mass value="-1"'),
    "against the triangle": lambda text: text.replace('izz="0.005"', 'izz="0.5"'),
    "no axis": lambda text: text.replace('xyz="0 1 0"', 'xyz="0 0 0"'),
    "a floating joint above the root": lambda text: text.replace('"j1" type="revolute"', '"j1" type="floating"'),
    "effort below zero": lambda text: text.replace('effort="50"', 'effort="-50"'),
}


@pytest.fixture
def robot(tmp_path: Path) -> Path:
    folder = tmp_path / "rt"
    folder.mkdir()
    (folder / "r.urdf").write_text(URDF)
    (folder / "robot.toml").write_text(TOML)
    return folder


def refused(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    capsys.readouterr()
    assert run([str(a) for a in arguments]) == 2
    said = capsys.readouterr().err
    assert said.startswith("error: ") and said.count("\n") == 1 and len(said) < 500, said
    return said


@pytest.mark.parametrize("how", SLIPS)
def test_a_slip_in_robot_toml_is_found_before_any_run(
    robot: Path, capsys: pytest.CaptureFixture[str], how: str
) -> None:
    assert run(["robots", "--check", str(robot)]) == 0
    (old, new), words = SLIPS[how]
    (robot / "robot.toml").write_text(TOML.replace(old, new))
    assert words in refused(capsys, "robots", robot)


def test_a_robot_toml_with_a_byte_order_mark_is_read(robot: Path) -> None:
    (robot / "robot.toml").write_text("\ufeff" + TOML.replace("\n", "\r\n"), newline="")
    assert run(["robots", "--check", str(robot)]) == 0


@pytest.mark.needs_plugins
@pytest.mark.parametrize("how", UNUSABLE)
def test_a_robot_that_no_simulator_can_hold_is_refused_by_run_too(
    robot: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], how: str
) -> None:
    from skillframe.document.file import learned
    from skillframe.extend.registry import registry

    skill, trace = tmp_path / "s.skill.json", tmp_path / "t.npz"
    save(learned(registry().skill("lmc"), example_demonstrations()), skill)
    (robot / "r.urdf").write_text(UNUSABLE[how](URDF))
    said = refused(capsys, "run", skill, "--world", "free", "--robot", robot, "--out", trace)
    assert "cannot be simulated" in said or "below zero" in said
    assert not trace.exists()

"""Machines as people draw them: what can run runs, and of what cannot `robots --check` says what a run would say."""

import re

import numpy as np
import pytest
from skillframe_hydraulics.checks.feasibility import problems
from skillframe_hydraulics.law.gains import law_gains
from skillframe_hydraulics.law.hydraulic import tool_axes

from skillframe.cli.main import run
from skillframe.errors import InputError
from skillframe.extend.drives import audit
from skillframe.robot.chain import ClosedChain
from skillframe.robot.describe import describe
from skillframe.robot.model import load_model
from skillframe.robot.spec import load_robot
from tests.digger import write_digger


@pytest.fixture
def drawn(tmp_path):
    """The digger with its URDF and robot.toml changed by regular expressions, each of which has to match."""

    def make(*pairs, toml=(), name="digger"):
        folder = write_digger(tmp_path / name)
        for file, changes in (("digger.urdf", pairs), ("robot.toml", toml)):
            text = (folder / file).read_text()
            for old, new in changes:
                text, count = re.subn(old, new, text, count=1, flags=re.DOTALL)
                assert count, old
            (folder / file).write_text(text)
        return folder

    return make


def cannot_run(folder):
    return [(p.message, p.fix) for p in audit(load_robot(folder)).problems if p.code == "cannot_run"]


BACKWARDS = (
    (
        r'(<joint name="boom_piston".*?<axis xyz=")1 0 0("/>)<limit lower="0.0" upper="0.5"',
        r'\g<1>-1 0 0\2<limit lower="-0.5" upper="0.0"',
    ),
)


@pytest.mark.parametrize("limits", [("-0.5", "0.0"), ("-2.5", "2.5")])
def test_a_piston_drawn_backwards_is_the_same_machine(drawn, limits):
    low, high = limits
    pair = (BACKWARDS[0][0], BACKWARDS[0][1].replace("-0.5", low).replace('upper="0.0"', f'upper="{high}"'))
    turned = load_model(load_robot(drawn(pair, toml=[("boom_piston = ", "boom_piston = -")])))
    plain = load_model(load_robot(drawn(name="plain")))
    np.testing.assert_allclose(turned.home, plain.home, atol=1e-15)
    assert turned.turned == ("boom_piston",) and plain.turned == ()
    one, other = (ClosedChain(robot) for robot in (turned, plain))
    z = one.minimal(turned.home) + 0.05
    a, b = (chain.at(z, np.array([0.1, -0.2, 0.3])) for chain in (one, other))
    for what in ("q", "v", "arms", "mass", "bias"):
        np.testing.assert_allclose(getattr(a, what), getattr(b, what), rtol=1e-9, atol=1e-9)
    assert problems(one, one.minimal(turned.home)) == []
    assert law_gains(one).body == pytest.approx(law_gains(other).body, rel=1e-9)  # loads it again, without its payload
    assert "boom_piston is drawn backwards in the URDF: here it grows as the rod slides out" in describe(turned)


def test_a_loop_that_is_open_along_its_hinge_is_told_with_the_gap(drawn):
    beside = (r'(<joint name="boom_eye_mount".*?<origin xyz="[-\d.]+) 0 ([-\d.]+")', r"\1 0.2 \2")
    assert "at home the loop boom_eye - boom_rod_eye is open by 200 mm" in cannot_run(drawn(beside))[0][0]
    slightly = (beside[0], r"\1 0.0009 \2")
    assert cannot_run(drawn(slightly, name="slightly")) == []


def test_a_barrel_that_cannot_follow_its_eye_is_named_by_check_and_run(drawn, capsys):
    folder = drawn((r'(<joint name="boom_barrel_pivot".*?<axis xyz=")0 -1 0', r"\g<1>1 0 0"))
    words = "the joint boom_barrel_pivot does not move the loop boom_eye - boom_rod_eye"
    assert cannot_run(folder)[0][0].startswith(words)
    with pytest.raises(InputError, match=words):
        ClosedChain(load_model(load_robot(folder)))
    assert run(["robots", "--check", str(folder)]) == 1
    assert words in capsys.readouterr().out


def test_a_barrel_whose_eye_leaves_its_plane_is_named_with_its_loop(drawn):
    """Its hinge is square to the rod, about z, where the boom turns about y."""
    folder = drawn((r'(<joint name="boom_barrel_pivot".*?<axis xyz=")0 -1 0', r"\g<1>0 0 1"))
    words = "the loop boom_eye - boom_rod_eye cannot move: its joints boom, boom_barrel_pivot, boom_piston do not"
    with pytest.raises(InputError, match=words):
        ClosedChain(load_model(load_robot(folder)))
    assert cannot_run(folder)[0][0].startswith(words)


def mounted(angle):
    joint = (
        '<link name="base_link"/>\n<joint name="mount" type="fixed"><parent link="base_link"/><child link="house"/>'
        f'<origin xyz="0 0 0" rpy="0 0 {angle}"/></joint>\n'
    )
    return [
        (r'<robot name="digger">\n', '<robot name="digger">\n'),
        (r'<link name="base_link"/>', joint + '<link name="house"/>'),
        *[(r'<parent link="base_link"/>(<child link="boom)', r'<parent link="house"/>\1')] * 2,
    ]


def test_a_plane_may_be_turned_by_any_angle_and_the_fixture_has_to_stand_in_it(drawn):
    folder = drawn(*mounted(0.7853982))
    text = "the fixture stands 1.38 m beside the plane in which the machine moves its tool: it can be checked"
    assert [(message[: len(text)], fix) for message, fix in cannot_run(folder)] == [
        (text, "write fixture = [0.975, 0.975, 0], or another in the plane")
    ]
    inside = [("1.95, 0.0, 0.0", "0.975, 0.975, 0.0")]
    turned = drawn(*mounted(0.7853982), toml=inside, name="turned")
    assert cannot_run(turned) == []
    axes = tool_axes(ClosedChain(load_model(load_robot(turned))))
    np.testing.assert_allclose(axes, [[0.5**0.5, 0.5**0.5, 0.0], [0.0, 0.0, 1.0]], atol=1e-7)  # as many digits of pi/4
    square = drawn(*mounted(1.5707963267948966), toml=[("1.95, 0.0", "0.0, 1.95")], name="square")
    assert np.array_equal(tool_axes(ClosedChain(load_model(load_robot(square)))), np.eye(3)[1:])
    assert cannot_run(square) == []


HANG = (
    '<joint name="hang" type="revolute"><parent link="bucket"/><child link="grapple"/><axis xyz="0 1 0"/>'
    '<limit lower="-2" upper="2" effort="0" velocity="3"/></joint><link name="grapple"/></robot>'
)
LEVER = (
    '<joint name="lever" type="{}"><parent link="stick"/><child link="bar"/><axis xyz="0 1 0"/>{}'
    '<limit lower="-2" upper="2" effort="0" velocity="3"/></joint><link name="bar"/></robot>'
)


@pytest.mark.parametrize(
    ("urdf", "toml", "words", "fix"),
    [
        (
            [("</robot>", HANG)], [],
            "3 actuators for 4 freedoms (boom, stick, bucket, hang): no actuator moves hang", "hold it by [lock]",
        ),
        ([("</robot>", LEVER.format("continuous", ""))], [], "no actuator moves lever", "hold it by [lock]"),
        ([], [('base = "fixed"', 'base = "free"')], "joint 'root_joint' stands on a free base", 'write base = "fixed"'),
    ],
    ids=["hanging", "continuous", "free"],
)  # fmt: skip
def test_what_is_not_simulated_is_named_with_its_joint(drawn, urdf, toml, words, fix):
    folder = drawn(*urdf, toml=toml)
    found = cannot_run(folder)
    assert any(words in message and fix in cure for message, cure in found), found
    with pytest.raises(InputError, match=re.escape(words)):
        ClosedChain(load_model(load_robot(folder)))


def test_a_piston_beyond_its_stroke_at_home_is_said_before_a_run_says_it(drawn):
    folder = drawn(toml=[("stroke = 0.5,", "stroke = 0.2,")])
    found = [p.message for p in audit(load_robot(folder)).problems if p.code == "impossible_home"]
    assert found == ["at home boom_piston would stand at 0.3269 m, outside its stroke of 0.2 m"]


def test_pistons_need_no_effort_limit(drawn):
    assert not [p for p in audit(load_robot(drawn())).problems if p.code == "no_effort_limits"]

"""Struts and loops between pins, which the URDF does not draw."""

import math

import numpy as np
import pytest

from skillframe.errors import SkillframeError
from skillframe.robot.chain import ClosedChain
from skillframe.robot.model import load_model
from skillframe.robot.spec import load_robot

HUNG, FAR, CLOSED = 0.8, 1.1, 1.0
"""Distances from the joint to the base pin and to the eye, and the strut's closed length [m]."""


def crank(urdf, axis="0 1 0", turned="0 0 0"):
    """A boom on a joint about any axis."""
    boom = urdf.joint("boom", "base", "boom", axis=axis, inside='<limit lower="-3" upper="3" effort="9" velocity="1"/>')
    boom = boom.replace('<origin xyz="0 0 0.3"/>', f'<origin xyz="0.2 0.1 0.3" rpy="{turned}"/>')
    return urdf.robot(urdf.link("base"), urdf.link("boom", urdf.inertial(5.0, 1.0)), boom)


STRUT = """
[[arm]]
name = "arm"
tool_frame = "boom"
[home]
boom = 0.3
[[strut]]
name = "jack"
base = ["base", {}]
eye = ["boom", {}]
closed = "1000 mm"
stroke = 0.8
mass = 4
"""


@pytest.mark.parametrize(
    ("axis", "turned"), [("0 1 0", "0 0 0"), ("0 -1 0", "0 0 0"), ("0 0 1", "0.4 -0.7 1.1"), ("1 2 -1", "-1 0.3 2")]
)
def test_a_strut_is_as_long_as_the_cosine_rule_says_about_any_axis(save, urdf, axis, turned):
    import pinocchio as pin

    about = np.array([float(word) for word in axis.split()])
    about = about / np.linalg.norm(about)
    across = np.linalg.svd(about[None])[2][1:]
    joint = pin.SE3(pin.rpy.rpyToMatrix(*(float(word) for word in turned.split())), np.array([0.2, 0.1, 0.3]))
    base = joint.act(HUNG * across[0])
    eye = FAR * (0.5 * across[0] + math.sqrt(0.75) * across[1])  # 60 degrees on, with a sign that the axis decides
    sign = float(np.sign(about @ np.cross(across[0], across[1])))
    chain = ClosedChain(
        load_model(load_robot(save(crank(urdf, axis, turned), STRUT.format(*map(np.ndarray.tolist, (base, eye))))))
    )
    assert chain.independent == ("boom",)
    for angle in (0.3, -0.2, 0.6):
        between = math.radians(60.0) + sign * angle
        long = math.sqrt(HUNG**2 + FAR**2 - 2.0 * HUNG * FAR * math.cos(between))
        rod = chain.configuration(np.array([angle]))[chain.model.getJointId("jack_rod") - 1]
        assert rod == pytest.approx(long - CLOSED, abs=1e-10)


FOUR_BAR = """
[[arm]]
name = "arm"
tool_frame = "crank"
[home]
crank = 0.4
[[loop]]
pin = [["coupler", [2.0, 0, 0]], ["rocker", [1.0, 0, 0]]]
branch = {{ {} }}
"""


def four_bar(urdf):
    """Crank and rocker of 1 m on pivots 2 m apart, and a coupler of 2 m."""
    limit, solid = '<limit lower="-6" upper="6" effort="9" velocity="1"/>', urdf.inertial(1.0, 0.5)
    joints = [("crank", "base", "0 0 0"), ("coupler", "crank", "1 0 0"), ("rocker", "base", "2 0 0")]
    parts = [urdf.joint(n, p, n, axis="0 0 1", xyz=xyz, inside=limit) for n, p, xyz in joints]
    return urdf.robot(urdf.link("base"), *(urdf.link(n, solid) for n, _, _ in joints), *parts)


def test_a_parallelogram_closes_parallel_or_crossed_as_its_branch_says(save, urdf):
    """Both are 2 m long between the ends of crank and rocker; only the parallel one has equal angles."""
    for branch, crossed in (
        ("coupler = -0.3, rocker = 0.5", False),
        ('coupler = "-60 deg", rocker = "-100 deg"', True),
    ):
        chain = ClosedChain(load_model(load_robot(save(four_bar(urdf), FOUR_BAR.format(branch)))))
        q = dict(zip(list(chain.model.names)[1:], chain.home, strict=True))
        tips = [np.array([math.cos(q["crank"]), math.sin(q["crank"])])]
        tips.append(np.array([2.0 + math.cos(q["rocker"]), math.sin(q["rocker"])]))
        assert np.linalg.norm(tips[1] - tips[0]) == pytest.approx(2.0, abs=1e-10)
        assert (abs(q["rocker"] - q["crank"]) > 0.1) == crossed
    with pytest.raises(SkillframeError, match="crank stands under"):
        load_robot(save(four_bar(urdf), FOUR_BAR.format("crank = 0.4")))

"""Joints of `[lock]`: what is held is the same robot at that position, with a freedom less."""

import numpy as np
import pinocchio as pin
import pytest

from skillframe.errors import InputError, UnknownName
from skillframe.robot.model import load_model
from skillframe.robot.spec import load_robot

HELD = {"turn": 0.7, "slide": -0.2}


@pytest.fixture
def arm(urdf, save):
    """A turning, a sliding and a turning joint, with origins that turn."""

    def make(text, name="made"):
        names = ("base", "a", "b", "c")
        links = [urdf.link(each, urdf.inertial(2.0, 0.3) if each != "base" else "") for each in names]
        joints = [
            urdf.joint("turn", "base", "a", axis="0.6 0 0.8"), urdf.joint("slide", "a", "b", "prismatic", "0 3 4"),
            urdf.joint("wrist", "b", "c", axis="0 1 0"),
        ]  # fmt: skip
        turned = [each.replace('xyz="0 0 0.3"', 'xyz="0 0.1 0.3" rpy="0.3 -0.2 0.9"') for each in joints]
        return load_robot(save(urdf.robot(*links, *turned), text, name))

    return make


def test_what_is_held_stands_where_the_free_robot_stands(arm):
    free = load_model(arm("", "free"))
    held = load_model(arm("[lock]\nturn = 0.7\nslide = '-20 cm'\n", "held"))
    assert list(held.model.names)[1:] == ["wrist"]
    q = free.home.copy()
    for name, value in HELD.items():
        q[free.model.joints[free.model.getJointId(name)].idx_q] = value
    places = []
    for robot, at in ((free, q), (held, held.home)):
        data = robot.model.createData()
        pin.framesForwardKinematics(robot.model, data, at)
        places.append(data.oMf[robot.model.getFrameId("c")].homogeneous)
    np.testing.assert_allclose(places[1], places[0], atol=1e-12)


@pytest.mark.parametrize(
    ("text", "error", "words"),
    [
        ("[lock]\nturm = 0.7\n", UnknownName, r"turm.*named in .*\[lock\]"),
        ("[lock]\nturn = 2.0\n", InputError, r"lock.turn: 2 is outside the joint's limits -1.5 to 1.5"),
        ("[home]\nturn = 0.2\n[lock]\nturn = 0.7\n", InputError, r"turn is held by \[lock\], and moved by \[home\]"),
    ],
)
def test_what_cannot_be_held_is_refused(arm, text, error, words):
    with pytest.raises(error, match=words):
        load_model(arm(text))

"""A bayonet under a constant push and turn, against Coulomb's law on a groove: which of them pass."""

from math import atan, cos, degrees, radians, sin

import numpy as np
import pytest

from skillframe.execution.executor import Setup, simulate
from skillframe.execution.prepare import load_robot_model, load_world
from tests.laws.pushing import Wrenches

pytestmark = pytest.mark.slow
REACH, PUSH_N, FRICTION = 0.03, 20.0, 0.2


def reached(lead_deg, angles_deg, start=0.0):
    """Whether a push at each angle below the level locks it, within 6 s."""
    scene = load_world("bayonet", {"lead": radians(lead_deg), "friction": FRICTION, "reach": REACH})
    angles = np.radians(angles_deg)
    wrenches = np.zeros((len(angles), 6))
    wrenches[:, 2], wrenches[:, 5] = -PUSH_N * np.sin(angles), PUSH_N * REACH * np.cos(angles)
    upright, damper = np.diag([0.0] * 3 + [20.0, 20.0, 0.0]), np.diag([150.0] * 3 + [1.0, 1.0, 0.2])
    setup = Setup(robot=load_robot_model("free_tool"), scene=scene,
                  center_of_compliance=np.array(scene.tool.frames["tip"]), stop_when=scene.goal)  # fmt: skip
    draws = {"start.tilt_z": np.full(len(angles), start)}
    rngs = np.random.default_rng(0).spawn(len(angles))
    return simulate(Wrenches(wrenches, upright, damper), setup, draws, rngs, duration_s=6.0).success


def test_a_push_and_turn_lock_it_where_their_angle_lies_inside_every_friction_cone():
    """On a lead-in of 85 degrees: from 85 + phi - 90 = 6.3 to 90 - phi = 78.7 degrees below the level, phi = atan .2.

    A cap that has strayed hangs by one pin, which gets half of the turn: 68.2 degrees are sure. 4 degrees inside and
    outside, because the pin's way is a circle, along which the wall's lead differs by 1 degree.
    """
    least, most, sure = 85.0 + degrees(atan(FRICTION)) - 90.0, 90.0 - degrees(atan(FRICTION)), degrees(atan(2.5))
    got = reached(85.0, [least - 4.0, least + 4.0, 45.0, sure - 4.0, most + 4.0])
    np.testing.assert_array_equal(got, [False, True, True, True, False])


def test_the_turn_alone_takes_a_lead_in_of_less_than_90_degrees_less_the_friction_angle():
    """A turn cannot put the pins down on the rim, and need not: the overhanging wall leads them down, or jams."""
    assert sin(radians(78.7)) == pytest.approx(cos(atan(FRICTION)), abs=1e-3)  # the limit
    assert reached(73.0, [0.0])[0] and not reached(84.0, [0.0])[0]


def test_the_push_alone_sticks_on_the_rim_and_on_the_bottom():
    assert not reached(85.0, [90.0])[0]
    assert not reached(85.0, [90.0], start=radians(30.0) + 0.13)[0]  # from above the groove it drops, and stays

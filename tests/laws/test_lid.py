"""A lid under a constant push at its lip, against the moment about its hinge: how far it shuts."""

from math import cos, degrees, radians, sin

import numpy as np
import pytest
from scipy.optimize import brentq

from skillframe.execution.executor import Setup, simulate
from skillframe.execution.prepare import load_robot_model, load_world
from tests.laws.pushing import Wrenches

pytestmark = pytest.mark.slow
PUSH_N, SPRING, LENGTH, RADIUS, OPENING = 20.0, 0.6, 0.1, 0.005, 60.0


def left_open(angles_deg, begin=0.028):
    """How far from shut [degrees] the lid is after 6 s of a push at each angle from the closing direction.

    The ball begins 2 mm before the lip, or `begin` [m] farther out than 30 mm before it.
    """
    hinge = {"opening": radians(OPENING), "spring": SPRING, "stuck": 0.0}
    scene = load_world("lid", {**hinge, "length": LENGTH, "radius": RADIUS})
    angles, n = np.radians(angles_deg), len(angles_deg)
    wrenches = np.zeros((n, 6))
    wrenches[:, 0], wrenches[:, 2] = PUSH_N * np.sin(angles), -PUSH_N * np.cos(angles)
    upright, damper = np.diag([0.0] * 3 + [20.0] * 3), np.diag([150.0] * 3 + [1.0] * 3)
    setup = Setup(robot=load_robot_model("free_tool"), scene=scene,
                  center_of_compliance=np.array(scene.tool.frames["tip"]))  # fmt: skip
    along = begin * np.array([cos(radians(OPENING)), 0.0, sin(radians(OPENING))])
    draws = {f"start.offset_{a}": np.full(n, along[i]) for i, a in enumerate("xyz")}
    rngs = np.random.default_rng(0).spawn(n)
    result = simulate(Wrenches(wrenches, upright, damper), setup, draws, rngs, duration_s=6.0)
    return np.degrees(result.final_error_rad)


def test_the_lid_shuts_to_where_the_push_s_moment_is_the_spring_s():
    """In the corner of lid and lip the push itself is the load: F l cos(D - a - b) + m g c cos(a) = K (A - a).

    l is to the ball's centre, 5 mm above the lid, so that b = atan(5 / 95). In place of the hinge's friction, which
    MuJoCo lets creep, a spring. Half a degree is the ball's friction in the corner: 0.1 of some 25 N at 5 mm is 0.0125
    Nm, against 2.3 Nm/rad of push and spring.
    """
    lever, above = np.hypot(LENGTH - RADIUS, RADIUS), np.arctan2(RADIUS, LENGTH - RADIUS)
    weight = 0.05 * 9.81 * 0.5 * (LENGTH + 0.004)

    def at_rest(push):
        def moment(a):
            return PUSH_N * lever * cos(push - a - above) + weight * cos(a) - SPRING * (radians(OPENING) - a)

        return degrees(brentq(moment, 0.0, radians(OPENING))) if moment(0.0) < 0.0 else 0.0

    angles = [65.0, 85.0, 95.0, 105.0]
    expected = [at_rest(radians(push)) for push in angles]
    assert expected[0] == 0.0 and expected[1] > 2.0
    np.testing.assert_allclose(left_open(angles), expected, atol=0.5)


def test_a_push_straight_down_near_the_hinge_slides_to_it_and_shuts_nothing():
    """60 degrees from the lid's normal, far outside the 6 of friction. 25 mm from the hinge it has 0.25 Nm at first."""
    assert left_open([0.0], begin=-0.04)[0] > 50.0

"""Compensation of nominal friction: it cancels damping, never drives a joint that has the friction, and says so."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from skillframe.control.motors import SLOW, FrictionCompensation
from skillframe.frames import norm
from skillframe.robot.model import load_model
from skillframe.robot.spec import Limits, load_robot
from skillframe.robot.tables import Dynamics, JointDynamics
from tests.laws.pushing import Push, impedance
from tests.laws.runs import run, setup

FRICTION, DAMPING = np.array([2.0, 0.0, 0.5]), np.array([1.0, 4.0, 0.0])
ENGINE = SimpleNamespace(nv=3, dof_frictionloss=FRICTION, dof_damping=DAMPING)


def test_moving_joints_get_their_damping_and_their_whole_friction_along_the_motion():
    velocity = np.array([[0.5, -0.5, 0.1], [-1.0, 2.0, -SLOW]])
    given = FrictionCompensation(ENGINE, None, 2).torque(velocity)
    np.testing.assert_allclose(given, DAMPING * velocity + FRICTION * np.sign(velocity), rtol=1e-15)


def test_at_rest_nothing_is_added_and_never_more_than_the_friction():
    compensation = FrictionCompensation(ENGINE, None, 1)
    assert not compensation.torque(np.zeros((1, 3))).any()
    for speed in np.linspace(-3.0 * SLOW, 3.0 * SLOW, 61):
        added = compensation.torque(np.full((1, 3), speed)) - DAMPING * speed
        # to rounding of the subtraction
        assert (np.abs(added) <= FRICTION + 1e-12).all()
        assert (added * speed >= -1e-12).all()


def test_rows_of_arms_get_the_friction_of_their_own_joints():
    given = FrictionCompensation(ENGINE, [np.array([2]), np.array([0])], 4).torque(np.full((4, 1), 10.0))
    np.testing.assert_allclose(given[:, 0], [0.5, 12.0, 0.5, 12.0])


def arm(friction=0.0, damping=0.0, compensate=False):
    own = {f"joint{k}": JointDynamics(friction=friction, damping=damping) for k in range(1, 8)}
    return load_model(
        replace(load_robot("panda"), limits=Limits(), dynamics=Dynamics(compensate=compensate, joint=own))
    )


def lowered(robot, duration_s=0.5):
    """How far a push through the air at 150 mm/s comes [m], and its trace. Joints 2 and 4 are well above SLOW."""
    now = replace(setup("panda", "free"), robot=robot)
    result = run(Push((0.0, 0.0, -1.0), impedance(), speed=0.15), now, duration_s=duration_s, trace_hz=1000)
    trace = result.traces[0]
    return norm(trace.position[-1] - trace.position[0]), trace


@pytest.mark.parametrize(("friction", "damping"), [(0.0, 20.0), (1.0, 0.0)])
def test_an_arm_that_resists_lags_and_one_that_is_compensated_lags_by_a_quarter_of_that_at_most(friction, damping):
    """Friction at the start of a motion is not compensated, hence the quarter."""
    free, slow = lowered(arm())[0], lowered(arm(friction, damping))[0]
    told = lowered(arm(friction, damping, compensate=True))[0]
    assert slow < free - 1e-4
    assert abs(free - told) < 0.25 * (free - slow)


def test_an_arm_without_friction_runs_to_the_last_bit_as_if_nobody_had_spoken_of_it():
    plain = replace(load_model(load_robot("panda")), spec=replace(load_robot("panda"), limits=Limits()))
    first, second = lowered(plain, 0.1)[1], lowered(arm(), 0.1)[1]
    assert first.q.tobytes() == second.q.tobytes()

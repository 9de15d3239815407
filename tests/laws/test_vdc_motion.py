"""The crane in free motion under sampled control with ideal force actuators: VDC, and tuned baselines beside it."""

import numpy as np
import pytest

from skillframe.errors import InputError
from tests.laws.vdc_loop import START, crane, task
from tests.laws.vdc_motion import Vdc, believed, diamond, figures, run
from tests.oracle.vdc_baselines import ModelBased, PistonPid, tune
from tests.oracle.vdc_reference import Path


def test_a_pid_that_stands_where_it_should_holds_the_machine():
    state = crane().at(START, np.zeros(3))
    np.testing.assert_allclose(PistonPid(crane(), START, 5.0).forces(state, state, 1e-3), state.holding_force())


def test_computed_torque_on_the_path_is_the_inverse_dynamics():
    state, zdd = crane().at(START, np.array([0.1, -0.2, 0.1])), np.array([0.3, 0.2, -0.1])
    force = ModelBased(5.0).forces(state, state, zdd)
    np.testing.assert_allclose(state.acceleration(force), zdd, rtol=1e-9)


def test_a_pistons_error_meets_the_response_that_its_number_promises():
    """Effective mass times (w^2 x + 2 w xd): a step of the piston's position makes the force of an oscillator."""
    pid, state = PistonPid(crane(), START, 4.0), crane().at(START, np.zeros(3))
    moved = crane().at(START + np.array([0.0, 0.0, 1e-3]), np.zeros(3))
    mass = 1.0 / (state.arms @ np.linalg.inv(state.mass) @ state.arms.T)[2, 2]
    extra = pid.forces(state, moved, 0.0) - state.holding_force()
    np.testing.assert_allclose(extra, [0.0, 0.0, 16.0 * mass * 1e-3], atol=1e-6)


def test_tuning_takes_the_least_error_and_no_run_that_diverged():
    errors = {1.0: 3.0, 2.0: 1.0, 4.0: float("nan"), 8.0: 2.0}
    assert tune(errors.__getitem__, tuple(errors)) == 2.0


def test_the_task_finds_the_joints_of_a_position_and_refuses_what_it_cannot_reach():
    wanted = np.array([3.0, 1.0, 0.5])
    z = task().solve(crane(), wanted, START)
    np.testing.assert_allclose(task().position(crane().at(z, np.zeros(3))), wanted, atol=1e-11)
    with pytest.raises(InputError, match="reach"):
        task().solve(crane(), np.array([9.0, 1.0, 0.5]), START)


@pytest.mark.slow
def test_without_noise_and_with_the_true_model_the_sampled_law_follows_within_a_millimetre():
    """The start of the published path. The rate filter lags by 2/(2 pi 24 Hz) = 13 ms, which an acceleration of at most
    0.16 m/s^2 turns into 2.2 mm/s, and Lambda = 6 1/s into 0.36 mm: the rest is for the sampled control."""
    errors, speed = run(Vdc(crane(), 16.0), diamond, 0.6, noise=0.0)
    assert figures(errors, speed).largest < 1e-3


def short(t, duration):
    """A tenth of a second of standing still where the path begins."""
    path = diamond(0.0, duration)
    return Path(path.position, 0.0 * path.velocity, 0.0 * path.acceleration)


@pytest.mark.slow
def test_a_run_is_bit_identical_for_one_seed():
    first, second = (run(Vdc(believed(), 16.0, 300.0), short, 0.1)[0] for _ in range(2))
    np.testing.assert_array_equal(first, second)

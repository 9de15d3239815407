"""A machine in contact sets out for what stands out of the force's uncertainty, and for nothing else."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from skillframe_hydraulics.law.vdc_reference import left_undone

SIGMA = np.array([[1000.0, 500.0]])
ANY = st.floats(-1e4, 1e4)
FAR = 1e5 * SIGMA / 1000.0  # a hundred sigmas


def pursued(imbalance, force, sigma):
    return 1.0 - left_undone(imbalance, force, sigma)


@given(ANY, ANY)
def test_in_the_air_every_imbalance_is_pursued(x, z):
    """A force of a fifth of its contact's threshold counts by less than its fourth power, 0.0016 times two."""
    assert pursued(np.array([[x, z]]), np.zeros((1, 2)), SIGMA) == pytest.approx(1.0)
    assert pursued(np.array([[x, z]]), 0.4 * SIGMA * [[1.0, 0.0]], SIGMA) > 1.0 - 0.0016


@given(ANY.filter(lambda x: abs(x) > 1.0), ANY)
def test_a_force_that_is_known_leaves_nothing_undone(x, z):
    assert pursued(np.array([[x, z]]), np.array([[3000.0, -2000.0]]), np.zeros((1, 2))) == pytest.approx(1.0)


@given(st.floats(0.01, 100.0), st.floats(0.0, 6.28))
def test_in_contact_half_is_pursued_at_one_and_a_half_sigma_and_the_rest_by_the_eighth_power(ratio, turn):
    imbalance = 1.5 * ratio * SIGMA * np.array([[np.cos(turn), np.sin(turn)]])
    assert pursued(imbalance, FAR, SIGMA) == pytest.approx(1.0 - 1.0 / (1.0 + ratio**8.0), abs=1e-6)


def test_trials_do_not_know_of_each_other():
    imbalance, force = np.array([[900.0, 0.0], [9e3, 0.0]]), np.array([[4e3, 0.0], [4e3, 0.0]])
    both = pursued(imbalance, force, np.repeat(SIGMA, 2, axis=0))
    for i in range(2):
        assert pursued(imbalance[i : i + 1], force[i : i + 1], SIGMA)[0] == both[i]

"""Friction and payload by recursive least squares: exactly the ridge estimate of all rows that count."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from skillframe_hydraulics.force.identification import Identification, IdentificationSettings

from skillframe.errors import SkillframeError
from tests.oracle.augmented import AugmentedForceFilter, AugmentedSettings

SEEDS = st.integers(0, 2**32 - 1)
PRIOR = np.array([900.0] * 3 + [4000.0] * 3 + [15.0])
VARIANCE = np.array([60.0, 60.0, 150.0]) ** 2


def rows(seed, count=30):
    """Regressors (T, 1, 3, 7) and residuals (T, 1, 3) of a known theta (7,), with noise."""
    rng = np.random.default_rng(seed)
    theta = PRIOR * rng.normal(size=7)
    phi = rng.normal(size=(count, 1, 3, 7)) * np.array([0.3] * 3 + [0.01] * 3 + [30.0])
    return theta, phi, phi @ theta + rng.normal(size=(count, 1, 3)) * np.sqrt(VARIANCE)


def learned(phi, residual, keep=None, **settings):
    found = Identification(1, 3, IdentificationSettings(**settings))
    for k in range(len(phi)):
        found.update(phi[k], residual[k], VARIANCE, np.full((1, 3), True) if keep is None else keep[k])
    return found


@given(SEEDS)
def test_the_recursion_is_the_ridge_estimate_of_all_rows_that_counted(seed):
    _, phi, residual = rows(seed)
    keep = np.random.default_rng(seed).random(residual.shape) < 0.7
    found = learned(phi, residual, keep)
    a, b = (phi / np.sqrt(VARIANCE)[:, None])[keep], (residual / np.sqrt(VARIANCE))[keep]
    ridge = np.linalg.lstsq(
        np.concatenate([a, np.diag(1.0 / PRIOR)]), np.concatenate([b, np.zeros(7)]), rcond=None
    )[0]  # fmt: skip
    np.testing.assert_allclose(found.theta[0] / PRIOR, ridge / PRIOR, atol=1e-7)
    assert found.rows[0] == keep.sum()


@pytest.mark.slow
def test_many_rows_find_theta_within_its_standard_deviations():
    """50 seeds of 7 numbers: none beyond 4.5 deviations, which happens by chance once in 400 such tests."""
    for seed in range(50):
        theta, phi, residual = rows(seed, 200)
        found = learned(phi, residual)
        assert np.abs((found.theta[0] - theta) / found.deviation[0]).max() < 4.5


def test_without_rows_nothing_is_claimed():
    _, phi, residual = rows(0)
    found = learned(phi, residual, np.full((30, 1, 3), False))
    np.testing.assert_array_equal(found.theta, 0.0)
    np.testing.assert_allclose(found.deviation[0], PRIOR)


def test_a_part_that_is_not_identified_stays_nominal():
    _, phi, residual = rows(1)
    assert not learned(phi, residual, friction=False).theta[0, :6].any()
    assert not learned(phi, residual, load=False).payload.any()


def test_a_prior_that_is_no_deviation_is_refused():
    with pytest.raises(SkillframeError, match="payload must be positive, got 0"):
        IdentificationSettings(payload=0.0)


def test_the_augmented_filter_cannot_tell_a_steady_push_from_friction_unless_it_was_told_of_air():
    """A residual that a friction error of 800 N makes: told that f = 0 it blames friction, otherwise partly a force."""
    found = {}
    rng = np.random.default_rng(3)
    jacobian, phi = rng.normal(size=(2, 3)), rng.normal(size=(3, 7)) * np.array([0.3] * 3 + [0.01] * 3 + [30.0])
    for told in (True, False):
        augmented = AugmentedForceFilter(3, AugmentedSettings(told=told))
        for _ in range(300):
            force = augmented.step(jacobian, phi, phi[:, 0] * 800.0, in_air=True)
        found[told] = np.abs(force).max(), np.abs(phi @ augmented.theta - phi[:, 0] * 800.0).max()
    assert found[True][1] < 0.1 * found[False][1]
    assert found[True][0] < found[False][0]

"""The sigma that is stated: what the swing shows, never less than what W says, and more while a force changes."""

import numpy as np
import pytest
from skillframe_hydraulics.force.calibration import StatedSigma
from skillframe_hydraulics.force.momentum import Estimate

DT = 1e-3


def estimate(force, sigma, late=None):
    force, sigma = np.atleast_2d(force), np.atleast_2d(sigma)
    return Estimate(force, sigma, np.full((len(force), 3), 2.0), force if late is None else np.atleast_2d(late), force)


def swung(sizes, seed=3):
    """After a swing in which errors had so many times the sigma that was given."""
    rng, seen = np.random.default_rng(seed), StatedSigma(len(sizes), DT)
    sigma = np.array([[200.0, 50.0]] * len(sizes))
    for tick in range(7000):
        early = 100.0 if tick < 2000 else 1.0  # nothing is identified yet, and such rows are not to count
        error = early * rng.standard_normal(sigma.shape) * sigma * np.array(sizes)[:, None]
        seen.show(tick, estimate(error, sigma))
    seen.hold()
    return seen


def test_a_swing_with_three_times_the_error_makes_sigma_three_times_as_large_and_a_better_one_leaves_it():
    seen = swung([3.0, 0.3])
    # 95 % of |N(0, 3)| lie below 1.96 x 3, half of which is 2.94; 900 rows know a quantile to some 4 %
    assert seen.scale[0] == pytest.approx(2.94, rel=0.12) and seen.scale[1] == 1.0
    stated = seen.stated(estimate([[0.0, 0.0]] * 2, [[10.0, 20.0]] * 2))
    np.testing.assert_allclose(stated, [seen.scale[0] * np.array([10.0, 20.0]), [10.0, 20.0]])


def test_a_force_that_has_just_begun_is_stated_to_be_as_uncertain_as_it_is_new():
    stated = StatedSigma(1, DT).stated(estimate([30.0, 0.0], [40.0, 20.0], late=[0.0, 0.0]))
    np.testing.assert_allclose(stated, [[50.0, 20.0]])  # 3, 4, 5


def test_without_a_swing_sigma_is_as_it_was():
    seen = StatedSigma(2, DT)
    seen.hold()
    assert np.array_equal(seen.scale, np.ones(2))

"""Tours, ergodic control, baselines and smoothing: laws that need no simulator."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st
from skillframe_search import ergodic as control
from skillframe_search.exploration import LEVER, Exploration
from skillframe_search.simple import random_walk, spiral
from skillframe_search.smoothing import STEP_S, smoothed, walked
from skillframe_search.tour import finely, nearest_first, shortened, tour

from skillframe.frames import norm

PLANE = Exploration(
    coordinates=("across_1", "across_2"), mean=(0.001, -0.002), covariance=((1.6e-5, 2e-6), (2e-6, 9e-6))
)
SPACE = Exploration(
    coordinates=("across_1", "across_2", "turn"), mean=(0.0, 0.0, 0.0),
    covariance=((9e-6, 0.0, 0.0), (0.0, 9e-6, 0.0), (0.0, 0.0, np.deg2rad(5.0) ** 2)),
)  # fmt: skip
SPEED, ACCELERATION = 0.015, 0.3


def length(path):
    return float(norm(np.diff(path, axis=0)).sum())


@hypothesis_settings(max_examples=25, deadline=None)
@given(st.integers(0, 10_000), st.integers(3, 40))
def test_a_tour_visits_every_place_once_and_2_opt_never_makes_it_longer(seed, count):
    places = np.random.default_rng(seed).normal(size=(count, 2))
    here = np.zeros(2)
    near = nearest_first(places, here)
    short = shortened(near, here)
    for path in (near, short):
        assert sorted(map(tuple, path.tolist())) == sorted(map(tuple, places.tolist()))
    assert length(np.vstack([here, short])) <= length(np.vstack([here, near])) + 1e-12


def test_no_piece_of_a_2_opt_tour_is_better_walked_backwards():
    path = np.vstack([np.zeros(2), shortened(np.random.default_rng(1).normal(size=(25, 2)), np.zeros(2))])
    best = length(path)
    for i in range(1, len(path) - 1):
        for j in range(i + 1, len(path)):
            turned = np.concatenate([path[:i], path[i : j + 1][::-1], path[j + 1 :]])
            assert length(turned) >= best - 1e-9


@pytest.mark.parametrize("where", [PLANE, SPACE])
def test_a_tour_starts_at_the_start_and_is_as_long_as_asked(where):
    path = tour(where, 0.2, np.random.default_rng(2))
    np.testing.assert_array_equal(path[0], 0.0)
    assert 0.2 <= length(path) < 0.3


def test_a_tour_spreads_as_the_distribution_says():
    """The mean within half a deviation, the deviations within 25 %: one way of 300 mm is a small sample."""
    path = finely(tour(PLANE, 0.3, np.random.default_rng(3)))
    deviation = np.sqrt(np.diag(PLANE.spread))
    assert (np.abs(path.mean(axis=0) - PLANE.center) < 0.5 * deviation).all()
    np.testing.assert_allclose(path.std(axis=0), deviation, rtol=0.25)


@pytest.mark.slow
def test_the_coefficients_of_the_normal_are_its_integrals():
    basis = control._Basis(np.array([0.0128, 0.0096]), 6)
    rng = np.random.default_rng(0)
    drawn = rng.normal(size=(20000, 2)) * [0.004, 0.003]
    values = np.mean([basis.at(x)[0] for x in drawn], axis=0)
    # Monte Carlo: 20,000 draws of functions bounded by 1 / h
    np.testing.assert_allclose(values, basis.of_normal(np.array([0.004, 0.003])), atol=4.0 / basis._h.min() / 141.0)


def test_the_gradients_of_the_basis_are_its_differences():
    basis, place, step = control._Basis(np.array([0.01, 0.02, 0.03]), 4), np.array([0.002, -0.011, 0.007]), 1e-7
    _, slope = basis.at(place)
    for axis in range(3):
        away = np.eye(3)[axis] * step
        difference = (basis.at(place + away)[0] - basis.at(place - away)[0]) / (2.0 * step)
        np.testing.assert_allclose(slope[:, axis], difference, atol=1e-4 * np.abs(slope).max())


@pytest.mark.parametrize("where", [PLANE, SPACE])
def test_ergodic_coverage_improves_with_time(where):
    """The distance sum L_k (c_k - phi_k)^2 of Mathew and Mezic falls as the way gets longer, here to a fifth."""
    path = control.ergodic(where, SPEED, 40.0)
    variance, axes = np.linalg.eigh(where.spread)
    basis = control._Basis(control.REACH * np.sqrt(variance), control.ORDERS[len(variance)])
    values = np.array([basis.at(x)[0] for x in (path[1:] - where.center) @ axes])
    coverage = np.cumsum(values, axis=0) / np.arange(1, len(values) + 1)[:, None] - basis.of_normal(np.sqrt(variance))
    distance = (basis.importance * coverage**2).sum(axis=1)
    assert distance[-1] < 0.2 * distance[199]
    np.testing.assert_allclose(norm(np.diff(path[1:], axis=0)), SPEED * STEP_S, rtol=0.02, atol=1e-4)


def test_ergodic_control_gives_the_same_way_every_time():
    np.testing.assert_array_equal(control.ergodic(PLANE, SPEED, 2.0), control.ergodic(PLANE, SPEED, 2.0))


def test_a_spiral_s_turns_are_one_pitch_apart():
    path = spiral(2, 0.0016, 0.3)
    angle, radius = np.unwrap(np.arctan2(path[2:, 1], path[2:, 0])), norm(path[2:])
    slope = np.polyfit(angle, radius, 1)[0]
    assert slope * 2.0 * np.pi == pytest.approx(0.0016, rel=0.01)
    assert length(path) == pytest.approx(0.3, rel=0.1)


def test_a_spiral_s_layers_are_at_their_turns():
    path = spiral(3, 0.0016, 0.3, [0.0, -0.05 * LEVER, 0.05 * LEVER])
    assert set(np.round(path[:, 2] / LEVER, 9)) == {0.0, -0.05, 0.05}


def test_a_random_walk_keeps_its_step_and_its_reach():
    path = random_walk(2, 0.004, 0.01, 0.5, np.random.default_rng(0))
    np.testing.assert_allclose(norm(np.diff(path, axis=0)), 0.004, rtol=1e-9)
    assert norm(path).max() <= 0.01


@pytest.mark.parametrize("where", [PLANE, SPACE])
@pytest.mark.parametrize("seed", [0, 1])
def test_the_smoothed_motion_keeps_its_bounds_and_its_start(where, seed):
    """Speed and acceleration along the surface below their limits, exactly: the octagon lies inside the circle."""
    path = tour(where, 0.2, np.random.default_rng(seed))
    motion = smoothed(path, SPEED, ACCELERATION, 13.0)
    acceleration = np.diff(motion.rate[:-1], axis=0) / STEP_S
    assert norm(motion.rate[:, :2]).max() <= SPEED
    assert norm(acceleration[:, :2]).max() <= ACCELERATION
    assert np.abs(motion.rate[:, 2:]).max(initial=0.0) <= SPEED
    np.testing.assert_allclose(motion.place[0], path[0], atol=1e-12)
    np.testing.assert_allclose(np.diff(motion.place, axis=0) / STEP_S, motion.rate[:-1], atol=1e-12)


def test_smoothing_stays_near_the_way():
    """Corners are cut by less than 1.5 mm, in the mean by less than 0.5 mm: the size of what a fillet catches."""
    path = tour(PLANE, 0.25, np.random.default_rng(5))
    motion = smoothed(path, SPEED, ACCELERATION, 15.0)
    reference = finely(path)
    away = np.sqrt(((motion.place[:, None] - reference[None]) ** 2).sum(axis=2).min(axis=1))
    assert away.max() < 1.5e-3 and away.mean() < 5e-4


def test_a_straight_way_is_walked_at_the_speed_of_the_reference():
    way = walked(np.array([[0.0, 0.0], [0.1, 0.0]]), 0.01, 5.0)
    np.testing.assert_allclose(way[:, 0], 0.01 * STEP_S * np.arange(len(way)), atol=1e-12)

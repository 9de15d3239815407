"""The force's Kalman filter: Butterworth poles, filterpy's gain, no lag on a ramp; and L taken back exactly."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import signal
from skillframe_hydraulics.force.damped import CriticallyDamped, share_of, undamped
from skillframe_hydraulics.force.impulse import Impulse, gains, sampled_gains
from skillframe_hydraulics.force.momentum import force_gain

from skillframe.errors import SkillframeError
from skillframe.signals import SteadyWrenchFilter

DT, CORNER = 1e-3, 3.0
SEEDS = st.integers(0, 2**32 - 1)


class Running:
    """The filter's formulas, sample after sample, over arrays."""

    def __init__(self, corner, dt):
        self.gains, self.dt = sampled_gains(corner, dt), dt

    def start(self, force):
        self.state = Impulse(force, *(0.0 * force for _ in range(3)))

    def step(self, force):
        self.state = self.state.after(force, self.dt, self.gains)
        return self.state.force


def test_the_filter_starts_at_its_first_value_and_follows_a_ramp_two_time_constants_behind():
    """The lag of two equal poles is 2 / (2 pi corner); a sample more or less is the tolerance."""
    filtered, w = CriticallyDamped(8.0, DT), 2 * np.pi * 8.0
    found = [float(filtered.step(np.array([5.0 + k * DT]))[0]) for k in range(1000)]
    assert found[0] == 5.0
    assert 5.999 - found[-1] == pytest.approx(2.0 / w, abs=DT)


@given(SEEDS)
def test_what_went_into_the_filter_comes_back_from_what_came_out(seed):
    """Rounding times 1/a^2 = 400."""
    values = np.random.default_rng(seed).normal(size=(50, 4, 2))
    damped, inverse, found = CriticallyDamped(8.0, DT), 1.0 / share_of(8.0, DT), []
    middle = before = values[0]
    for value in values:
        filtered = damped.step(value).copy()
        middle, shown = undamped(middle, before, filtered, inverse)
        found.append(shown)
        before = filtered
    np.testing.assert_allclose(found, values, atol=1e-10)


def closed_loop():
    """Errors of (Y, P, f, s) from sample to sample without noise, in continuous time."""
    chain = np.diag(np.ones(3), 1)
    return chain - np.outer(gains(CORNER), [1.0, 0.0, 0.0, 0.0])


def test_the_poles_are_those_of_a_butterworth_filter():
    w = 2 * np.pi * CORNER
    expected = w * np.exp(1j * np.pi * np.array([5, 7, 9, 11]) / 8)
    np.testing.assert_allclose(np.sort_complex(np.linalg.eigvals(closed_loop())), np.sort_complex(expected), rtol=1e-9)


def test_the_gain_is_that_of_filterpys_filter_once_it_has_converged():
    """(2) is the gain in continuous time; at w dt = 0.02 the sampled one is some per cent smaller."""
    from filterpy.kalman import KalmanFilter

    kalman = KalmanFilter(dim_x=4, dim_z=1)
    kalman.F = np.eye(4) + DT * np.diag(np.ones(3), 1) + DT**2 / 2 * np.diag(np.ones(2), 2) + DT**3 / 6 * np.eye(4, k=3)
    kalman.H, kalman.R, kalman.P = np.eye(1, 4), np.array([[1.0]]), np.diag([1e2, 1e4, 1e6, 1e8])
    walk = (2 * np.pi * CORNER) ** 4 * np.sqrt(DT)
    into = np.array([DT**3 / 6, DT**2 / 2, DT, 1.0])
    kalman.Q = walk**2 * DT * np.outer(into, into)
    for _ in range(3000):
        kalman.predict()
        kalman.update(np.zeros((1, 1)))
    np.testing.assert_allclose(kalman.K[:, 0] / DT, gains(CORNER), rtol=0.06)


@pytest.mark.parametrize("rate", [60.0, 100.0, 1000.0])
def test_at_every_rate_that_is_taken_a_step_is_followed_as_in_continuous_time(rate):
    """Scipy's step response: a filter without lag on a ramp must overshoot. A sample of its largest slope, 0.8 w."""
    smooth, k = Running(CORNER, 1.0 / rate), gains(CORNER)
    smooth.start(np.zeros((1, 1)))
    found = np.array([smooth.step(np.ones((1, 1)))[0, 0] for _ in range(round(3 * rate))])
    _, expected = signal.step(signal.TransferFunction(k[2:], [1.0, *k]), T=np.arange(len(found) + 1) / rate)
    np.testing.assert_allclose(found, expected[1:], atol=0.8 * 2.0 * np.pi * CORNER / rate)
    assert found[-1] == pytest.approx(1.0, abs=1e-6)


def test_a_ramp_is_followed_without_lag_and_promised_ahead():
    """4e-3: a sample of 1 ms, and what is left of the start after 2 s."""
    smooth = Running(CORNER, DT)
    smooth.start(np.zeros((1, 2)))
    for k in range(2000):
        found = smooth.step(np.full((1, 2), 3.0 * k * DT))
    np.testing.assert_allclose(found, 3.0 * 1.999, atol=4e-3)
    np.testing.assert_allclose(smooth.state.force + 0.1 * smooth.state.slope, 3.0 * 2.099, atol=4e-3)


def test_noise_of_positions_differentiated_twice_is_taken_out_ten_times_better_than_by_a_filter_for_white_noise():
    """Second differences of white noise, fifty rows of 1 s after 2 s; both filters have the same corner."""
    noise = np.diff(np.random.default_rng(0).normal(size=(3002, 50, 2)), n=2, axis=0)
    ours, white = Running(CORNER, DT), SteadyWrenchFilter(force_gain(CORNER, DT), DT)
    ours.start(0.0 * noise[0])
    white.start(0.0 * noise[0])
    found = np.array([(ours.step(x).copy(), white.step(x)) for x in noise])[2000:]
    assert found[:, 0].std() < 0.1 * found[:, 1].std()


def test_a_corner_near_the_sampling_rate_is_refused():
    with pytest.raises(SkillframeError, match="a corner of 100 Hz needs 2000 samples a second"):
        sampled_gains(100.0, DT)

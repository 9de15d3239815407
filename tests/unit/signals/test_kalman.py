from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import solve_discrete_are

from skillframe.errors import SkillframeError
from skillframe.signals import WrenchFilter, WrenchModel, process_noise, steady_gain, transition

NOISE = np.repeat([0.3, 0.02], 3)


@settings(max_examples=50, deadline=None)
@given(noise=st.floats(1e-4, 1e3), corner=st.floats(0.2, 300.0), dt=st.sampled_from([1e-4, 1e-3, 2e-3, 1e-2]))
def test_the_converged_gain_solves_the_riccati_equation(noise: float, corner: float, dt: float) -> None:
    model = WrenchModel.from_corner(np.full(6, noise), corner, dt)
    gain = steady_gain(model.noise, model.walk, dt)
    q, r = process_noise(model.walk[0], dt) / noise**2, 1.0
    p = solve_discrete_are(transition(dt).T, np.array([[1.0], [0.0]]), q, np.array([[r]]))
    # 1e-6: scipy's solver loses digits where the slope's variance is 1e8 times the value's
    assert gain.value[0] == pytest.approx(p[0, 0] / (p[0, 0] + r), rel=1e-6)
    assert gain.slope[0] == pytest.approx(p[1, 0] / (p[0, 0] + r), rel=1e-6)


@pytest.mark.parametrize(("corner", "dt"), [(5.0, 1e-3), (25.0, 1e-3), (25.0, 5e-3), (200.0, 1e-3)])
def test_the_converged_gain_is_what_filterpy_converges_to(corner: float, dt: float) -> None:
    design = WrenchFilter(WrenchModel.from_corner(NOISE, corner, dt), dt)
    filterpy = design.kalman()
    for _ in range(3000):
        filterpy.predict()
        filterpy.update(np.zeros((6, 1)))
    gain = steady_gain(design.model.noise, design.model.walk, dt)
    for channel in range(6):
        column = filterpy.K[2 * channel : 2 * channel + 2, channel]
        # 1e-8: the recursion of a 5 Hz filter at 1 kHz has converged to that after 3000 steps
        assert column == pytest.approx([gain.value[channel], gain.slope[channel]], rel=1e-8)


def test_the_loops_filter_and_filterpy_agree_once_the_gain_has_converged() -> None:
    rng = np.random.default_rng(0)
    time = np.arange(3000) * 1e-3
    wrench = 10.0 * np.sin(3.0 * time)[:, None] + rng.normal(size=(3000, 6)) * NOISE
    design = WrenchFilter()
    loop = design.steady()
    loop.start(wrench[:1])
    ours = np.array([loop.step(w[None])[0] for w in wrench])
    theirs = design.filter(time, wrench)
    # 1e-9 N: both recursions forget their start within a few dozen periods of the corner
    assert np.abs(ours - theirs)[1500:].max() < 1e-9


def test_every_row_is_filtered_for_itself_bit_for_bit() -> None:
    rng = np.random.default_rng(1)
    wrench = rng.normal(size=(50, 7, 6))
    whole = WrenchFilter().steady()
    whole.start(wrench[0])
    together = np.array([whole.step(w) for w in wrench])
    for rows in (slice(3, 4), slice(0, 5), slice(2, 7)):
        part = WrenchFilter().steady()
        part.start(wrench[0, rows])
        assert np.array_equal(np.array([part.step(w[rows]) for w in wrench]), together[:, rows])


def test_a_returned_wrench_is_never_changed_by_a_later_step() -> None:
    loop = WrenchFilter().steady()
    loop.start(np.zeros((2, 6)))
    first = loop.step(np.ones((2, 6)))
    kept = first.copy()
    loop.step(5.0 * np.ones((2, 6)))
    assert np.array_equal(first, kept)


def test_a_trial_that_diverged_does_not_touch_the_others() -> None:
    loop = WrenchFilter().steady()
    loop.start(np.zeros((2, 6)))
    measured = np.ones((2, 6))
    measured[0] = np.nan
    assert np.all(np.isfinite(loop.step(measured)[1]))


def test_a_ramp_is_followed_without_lag_and_noise_is_reduced() -> None:
    time = np.arange(4000) * 1e-3
    loop = WrenchFilter().steady()
    ramp = 20.0 * time[:, None] * np.ones(6)
    loop.start(ramp[:1])
    followed = np.array([loop.step(w[None])[0] for w in ramp])
    assert np.abs(followed - ramp)[1000:].max() < 1e-9
    noise = np.random.default_rng(2).normal(size=(20_000, 6)) * NOISE
    loop.start(noise[:1])
    out = np.array([loop.step(w[None])[0] for w in noise])[2000:]
    # variance of the filtered white noise for k1, k2 h of equation (1): alpha-beta filter, closed form
    gain = steady_gain(WrenchModel.default().noise, WrenchModel.default().walk, 1e-3)
    a, b = gain.value[0], gain.slope[0] * 1e-3
    ratio = np.sqrt((2 * a**2 + b * (2 - 3 * a)) / (a * (4 - 2 * a - b)))
    # 5 %: 18 000 samples correlated over some 10 give 1 800 independent ones, 1.7 % at one sigma
    assert out.std(axis=0) / NOISE == pytest.approx(np.full(6, ratio), rel=0.05)
    assert ratio < 0.6


def test_the_smoother_beats_the_filter_and_the_filter_beats_the_sensor() -> None:
    rng = np.random.default_rng(3)
    time = np.arange(2000) / 500.0
    truth = (5.0 * np.sin(4.0 * time) + 3.0 * np.cos(1.0 + 9.0 * time))[:, None] * np.ones(6)
    measured = truth + rng.normal(size=truth.shape) * 0.5
    design = WrenchFilter(WrenchModel.from_corner(np.full(6, 0.5), 8.0, 0.002), 0.002)
    errors = [
        float((x - truth)[100:-100].std())
        for x in (measured, design.filter(time, measured), design.smooth(time, measured))
    ]
    assert errors[2] < 0.6 * errors[1] < 0.6 * errors[0]


def test_the_smoother_shifts_nothing_in_time() -> None:
    time = np.arange(1001) * 1e-3
    hump = np.exp(-(((time - 0.5) / 0.05) ** 2))[:, None] * np.ones(6)
    smoothed = WrenchFilter().smooth(time, hump)
    assert np.abs(smoothed - smoothed[::-1]).max() < 1e-6  # a symmetric input stays symmetric far from its ends


def test_uneven_samples_are_smoothed_with_their_own_spacing() -> None:
    rng = np.random.default_rng(4)
    time = np.sort(rng.uniform(0.0, 2.0, 600))
    line = (3.0 - 2.0 * time)[:, None] * np.ones(6)
    smoothed = WrenchFilter(dt=float(np.median(np.diff(time)))).smooth(time, line)
    assert np.abs(smoothed - line)[50:-50].max() < 1e-6  # a straight line is what the model expects


def test_long_recordings_are_smoothed_in_chunks_without_a_seam(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(5)
    time = np.arange(900) * 1e-3
    wrench = np.cumsum(rng.normal(size=(900, 6)), axis=0)
    whole = WrenchFilter().smooth(time, wrench)
    monkeypatch.setattr("skillframe.signals.CHUNK", 300)
    monkeypatch.setattr("skillframe.signals.OVERLAP", 250)
    # 1e-5: at 25 Hz and 1 kHz the memory fades by e^-27 over 250 samples, times the slope's large prior variance
    assert np.abs(WrenchFilter().smooth(time, wrench) - whole).max() < 1e-5


@pytest.mark.parametrize("noise", [np.zeros(6), np.ones(5), np.full(6, np.nan)])
def test_noise_figures_must_be_six_positive_numbers(noise: np.ndarray) -> None:
    with pytest.raises(SkillframeError, match="six positive numbers"):
        WrenchModel(noise=noise, walk=np.ones(6))


def test_the_loop_needs_neither_filterpy_nor_scipy() -> None:
    code = (
        "import sys, numpy as np; from skillframe.signals import WrenchFilter; f = WrenchFilter().steady();"
        "f.start(np.zeros((1, 6))); f.step(np.ones((1, 6)));"
        "sys.exit(any(m in sys.modules for m in ('filterpy', 'scipy')))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0

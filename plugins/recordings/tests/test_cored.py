"""A filter that is no worse than a plain 10 Hz one, held against forces that are known."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import butter, sosfilt
from skillframe_recordings.conditioning.offline import filter_wrench, smooth
from skillframe_recordings.conditioning.quiet_filter import cored, plain
from skillframe_recordings.conditioning.wrench_model import estimate_model

from skillframe.demonstration.contact import detrended_std
from skillframe.demonstration.record import Demonstration
from skillframe.frames import Float

RATE, SECONDS = 200.0, 8.0
QUIET = slice(200, 480)


def touching(seed: int, vibration: tuple[float, float] | None) -> tuple[Float, Float, Float]:
    """Time, true wrench (T, 6), and the measured one: a touch at 3 s within 20 ms, waves of 0.4 Hz, and noise.

    The noise is white and, if a band [Hz] is given, twice as much in this band, on top of the white.
    """
    rng = np.random.default_rng([7, seed])
    time = np.arange(0.0, SECONDS, 1 / RATE)
    true = np.zeros((len(time), 6))
    pressed = np.clip((time - 3.0) / 0.02, 0.0, 1.0) * (time < 6.0)
    true[:, 2] = pressed * (8.0 + 2.0 * np.sin(2.0 * np.pi * 0.4 * time))
    true[:, 3] = 0.05 * true[:, 2]
    noise = rng.normal(size=true.shape)
    if vibration is not None:
        band = butter(2, vibration, btype="bandpass", fs=RATE, output="sos")
        coloured = sosfilt(band, rng.normal(size=true.shape), axis=0)
        noise += 2.0 * coloured / coloured.std(axis=0)
    return time, true, true + noise * np.repeat([0.03, 0.002], 3)


def error(true: Float, filtered: Float) -> float:
    return float(np.sqrt(np.mean((true - filtered)[:, :3] ** 2)))


@pytest.mark.parametrize("causal", [False, True])
@pytest.mark.parametrize("vibration", [None, (12.0, 18.0), (30.0, 45.0)], ids=["white", "near", "far"])
@pytest.mark.parametrize("seed", range(2))
def test_it_is_nearer_to_the_true_force_than_a_plain_filter_and_as_quiet(
    seed: int, vibration: tuple[float, float] | None, causal: bool
) -> None:
    time, true, measured = touching(seed, vibration)
    ours = cored(time, measured, estimate_model(time, measured), causal=causal).wrench
    theirs = plain(measured, 10.0, RATE, causal)
    assert error(true, ours) < error(true, theirs)
    # where nothing happens, by more than the choice saw: 1.4 s, of which some are not in the quietest quarter
    assert error(true[QUIET], ours[QUIET]) < 1.05 * error(true[QUIET], theirs[QUIET])
    # a step loses with the root of the corner: sqrt(10 / 25) is 0.63, and noise adds to it
    touch = slice(int(2.9 * RATE), int(3.1 * RATE))
    assert error(true[touch], ours[touch]) < 0.7 * error(true[touch], theirs[touch])


def test_the_causal_one_does_not_look_ahead() -> None:
    time, _, measured = touching(0, None)
    time, measured = time[:-20], measured[:-20]  # so that the last samples fill no window of 0.25 s: the choice stays
    later = measured.copy()
    later[-5:, :3] += 0.01
    model = estimate_model(time, measured)
    first, second = (cored(time, w, model, causal=True).wrench for w in (measured, later))
    np.testing.assert_array_equal(first[:-5], second[:-5])
    assert np.abs(first[-5:] - second[-5:]).max() > 0.0


def test_a_pure_line_passes_without_lag_of_the_smoother() -> None:
    time = np.arange(0.0, 4.0, 1 / RATE)
    line = np.outer(time, [1.0, -2.0, 0.5, 0.1, 0.0, -0.1])
    ours = cored(time, line, estimate_model(time, line), causal=False).wrench
    # both ways a line is a fixed point but at the ends, where the plain filter starts
    assert np.abs(ours - line)[100:-100].max() < 1e-3


def test_what_was_chosen_is_noted_and_a_given_model_is_used_as_it_is() -> None:
    time, _, measured = touching(1, (30.0, 45.0))
    d = Demonstration(
        time=time, position=np.zeros((len(time), 3)), quaternion=np.tile([0.0, 0.0, 0.0, 1.0], (len(time), 1)),
        wrench=measured,
    )  # fmt: skip
    said = smooth(d).meta["conditioning"]
    assert max(said["corner_hz"]) <= 25.0
    assert max(said["quiet_corner_hz"]) <= 10.0
    assert "fits best" in said["because"][0]
    model = estimate_model(time, measured)
    given = filter_wrench(d, model)
    assert "because" not in given.meta["conditioning"]
    assert given.meta["conditioning"]["corner_hz"] == pytest.approx(model.corner(1.0 / d.rate))


def test_ten_samples_and_slow_recordings_are_filtered_too() -> None:
    rng = np.random.default_rng(3)
    for rate, count in ((200.0, 10), (12.0, 60), (20.0, 60)):
        time = np.arange(count) / rate
        measured = rng.normal(size=(count, 6))
        for causal in (False, True):
            ours = cored(time, measured, estimate_model(time, measured), causal=causal).wrench
            assert np.all(np.isfinite(ours))
            assert np.abs(ours).max() < 5.0  # no filter rings up beyond the largest of so few normal numbers


@pytest.mark.parametrize("causal", [False, True])
def test_noise_with_spikes_does_not_leak_and_a_corner_beyond_all_bounds_is_held_and_said(causal: bool) -> None:
    rng = np.random.default_rng(11)
    time = np.arange(0.0, 10.0, 1 / RATE)
    measured = 0.02 * rng.standard_t(2, size=(len(time), 6))
    rough = time > 5.0
    measured[rough] += 5.0 * np.sin(2.0 * np.pi * 8.0 * time[rough])[:, None]  # large beside the noise: follow it
    ours = cored(time, measured, estimate_model(time, measured), causal=causal)
    quiet, theirs = slice(50, 950), plain(measured, 10.0, RATE, causal)
    # scatter within 0.25 s, which is what the plain filter is not to be exceeded in: its very measure, so no margin
    scatter = [np.median(detrended_std(w[quiet].reshape(-1, 50, 6)), axis=0)[:3] for w in (ours.wrench, theirs)]
    assert np.sqrt(np.mean(scatter[0] ** 2)) < 1.02 * np.sqrt(np.mean(scatter[1] ** 2))
    assert ours.said["identified_corner_hz"][0] > 25.0
    assert ours.said["corner_hz"] == [25.0] * 6
    assert "25 Hz is the most that is allowed" in ours.said["because"][0]


def test_a_choice_that_is_noisier_than_the_plain_filter_is_not_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("skillframe_recordings.conditioning.quiet_filter.CORNERS", (3.0, 1.0))
    time, _, measured = touching(2, None)
    for causal in (False, True):
        said = cored(time, measured, estimate_model(time, measured), causal=causal).said
        assert 30.0 not in said["quiet_corner_hz"]

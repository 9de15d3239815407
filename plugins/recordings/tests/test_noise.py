from __future__ import annotations

import numpy as np
import pytest
from skillframe_recordings.conditioning.offline import first_free_air
from skillframe_recordings.conditioning.wrench_model import estimate_model, model_of

from skillframe.demonstration.contact import contact_intervals, detrended_std, free_air_level, noise_figures
from skillframe.demonstration.record import Demonstration
from skillframe.errors import InputError
from skillframe.signals import WrenchFilter

SCATTER = np.array([0.035, 0.021, 0.075, 0.002, 0.003, 0.0005])


def recording(seed: int, rate: float = 500.0) -> tuple[np.ndarray, np.ndarray]:
    """6 s: free air with slow weight changes, a press of 20 N from 2.5 to 4.5 s with vibration, free air."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, 6.0, 1 / rate)
    wrench = rng.normal(size=(len(time), 6)) * SCATTER
    wrench[:, 0] += 0.5 * np.sin(0.5 * time)
    press = (time >= 2.5) & (time < 4.5)
    wrench[press, 2] += 20.0 + 1.5 * np.sin(90.0 * time[press])
    return time, wrench


@pytest.mark.parametrize("seed", range(10))
def test_noise_is_found_in_the_quiet_parts_whatever_the_rest_does(seed: int) -> None:
    # 15 %: a window of 125 samples scatters by 6 %, and the quietest quarter is chosen from its low side
    assert noise_figures(*recording(seed)).quiet == pytest.approx(SCATTER, rel=0.15)


def test_the_scatter_about_a_line_is_unbiased() -> None:
    rng = np.random.default_rng(0)
    windows = rng.normal(size=(4000, 12, 1)) + np.linspace(0.0, 50.0, 12)[:, None]
    variance = (detrended_std(windows) ** 2).mean()
    assert variance == pytest.approx(1.0, abs=4 * np.sqrt(2 / (4000 * 10)))  # four sigma of a variance estimate


def test_noise_of_too_few_samples_is_refused() -> None:
    with pytest.raises(InputError, match="too few"):
        noise_figures(np.arange(5.0), np.zeros((5, 6)))


@pytest.mark.parametrize("corner", [3.0, 12.0])
def test_the_likelihood_finds_the_corner_a_recording_was_made_with(corner: float) -> None:
    rng = np.random.default_rng(1)
    dt, noise = 0.002, 0.1
    walk = noise * np.sqrt(dt) * (2 * np.pi * corner) ** 2
    count = 15_000
    slope = np.cumsum(rng.normal(size=(count, 6)) * walk * np.sqrt(dt), axis=0)
    value = np.cumsum(slope * dt, axis=0) + rng.normal(size=(count, 6)) * noise
    model = estimate_model(np.arange(count) * dt, value)
    # the grid's step is 26 %, and noise taken from windows holds some of the walk
    assert model.corner(dt)[0] == pytest.approx(corner, rel=0.35)


def test_an_estimated_filter_reduces_the_noise_and_keeps_the_press() -> None:
    time, wrench = recording(3)
    smoothed = WrenchFilter(estimate_model(time, wrench), 0.002).smooth(time, wrench)
    assert smoothed[(time > 3.0) & (time < 4.0), 2].mean() == pytest.approx(20.0, abs=0.1)
    free = time < 2.0
    assert np.diff(smoothed[free], axis=0).std() < np.diff(wrench[free], axis=0).std()


def test_noise_stated_in_the_metadata_wins() -> None:
    time, wrench = recording(4)
    demo = Demonstration(
        time=time, position=np.zeros((len(time), 3)), quaternion=np.tile([0.0, 0, 0, 1], (len(time), 1)),
        wrench=wrench, meta={"sensor": {"force_noise": 0.2, "torque_noise": 0.01}},
    )  # fmt: skip
    assert model_of(demo).noise == pytest.approx([0.2] * 3 + [0.01] * 3)


@pytest.mark.parametrize("seed", range(5))
def test_contact_is_found_between_its_true_ends(seed: int) -> None:
    time, wrench = recording(seed)
    noise = noise_figures(time, wrench)
    found = contact_intervals(time, wrench, noise, free_air_level(time, wrench))
    assert len(found) == 1
    assert found[0][:2] == pytest.approx((2.5, 4.5), abs=0.005)
    assert first_free_air(time, wrench, noise) == pytest.approx((0.0, 2.4), abs=0.005)


@pytest.mark.parametrize("seed", range(5))
def test_a_contact_that_every_sample_drowns_is_found_by_averaging(seed: int) -> None:
    time, wrench = recording(seed)
    wrench[:, 2] *= 0.3  # a press of 6 N
    wrench[:, :3] += np.random.default_rng(seed).normal(size=(len(time), 3))
    found = contact_intervals(time, wrench, noise_figures(time, wrench), free_air_level(time, wrench))
    # 25 ms: half of what is averaged over, at most
    assert [c[:2] for c in found] == [pytest.approx((2.5, 4.5), abs=0.025)]


def test_a_spike_is_no_contact_and_two_presses_are_two() -> None:
    time, wrench = recording(0)
    wrench[300, 2] = 277.0
    wrench[int(3.3 * 500) : int(3.6 * 500), 2] = 0.0
    found = contact_intervals(time, wrench, noise_figures(time, wrench), free_air_level(time, wrench))
    assert [c.start for c in found] == pytest.approx([2.5, 3.6], abs=0.01)

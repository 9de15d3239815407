"""How late a wrench is against its pose: found in what touches and slides, and not claimed where nothing tells."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from skillframe_recordings.audit import audit
from skillframe_recordings.lateness import lateness

from skillframe.demonstration.record import Demonstration


def wander(rng: np.random.Generator, count: int, width: int) -> np.ndarray:
    """Smooth motion without a period, of unit size: noise averaged over a bell of so many samples."""
    noise = np.convolve(rng.normal(size=count + 2 * width), np.hanning(width), "same")[width:-width]
    return noise / noise.std()


def recorded(seed: int = 0, rate: float = 200.0, duration: float = 20.0) -> Demonstration:
    """A tool that touches a table of 2 N/mm now and then, and slides to and fro on it with friction of 0.4."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, duration, 1.0 / rate)
    height = 0.004 * wander(rng, len(time), 120)
    across = 0.05 * wander(rng, len(time), 200)
    normal = 2000.0 * np.maximum(-height, 0.0)
    wrench = rng.normal(scale=np.repeat([0.1, 0.01], 3), size=(len(time), 6))
    wrench[:, 2] += normal
    wrench[:, 0] -= 0.4 * normal * np.tanh(np.gradient(across, time) / 0.005)
    position = np.stack([across, np.zeros_like(time), height], axis=1) + rng.normal(scale=2e-5, size=(len(time), 3))
    return Demonstration(
        time=time, position=position, quaternion=np.tile([1.0, 0.0, 0.0, 0.0], (len(time), 1)), wrench=wrench
    )


def late(d: Demonstration, seconds: float) -> Demonstration:
    """The wrench as a clock that is late stamps it: what happened at t stands at t + seconds."""
    wrench = np.stack([np.interp(d.time - seconds, d.time, column) for column in d.wrench.T], axis=1)
    return replace(d, wrench=wrench)


@pytest.mark.parametrize("seconds", [0.3, *(pytest.param(s, marks=pytest.mark.slow) for s in (-0.5, 0.06))])
def test_a_late_wrench_is_found_with_the_line_to_type(seconds: float) -> None:
    found = audit(late(recorded(), seconds))
    assert found.wrench_late_s == pytest.approx(seconds, abs=0.02)  # one sample of the 50 Hz that are compared
    (said,) = [text for text in found.warnings if text.startswith("clocks:")]
    assert f"{'after' if seconds > 0 else 'before'} the motion" in said
    assert f"--set wrench-shift={-found.wrench_late_s:.2f} cures it" in said


@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.slow)])
def test_one_clock_raises_no_alarm(seed: int) -> None:
    found = audit(recorded(seed))
    assert found.wrench_late_s == 0.0
    assert not [text for text in found.warnings if text.startswith("clocks:")]


def test_nothing_is_said_of_noise_of_free_motion_or_of_a_short_recording() -> None:
    d = recorded()
    noise = np.random.default_rng(3).normal(size=d.wrench.shape)
    assert lateness(replace(d, wrench=noise)) is None
    assert lateness(replace(d, meta={"contact": False})) is None
    assert lateness(d.between(0.0, 3.9)) is None
    assert lateness(replace(d, time=1e9 * d.time)) is None  # nanoseconds: 2e10 s would be compared
    assert lateness(replace(d, time=np.where(d.time < 10.0, d.time, d.time + 1e9))) is None  # a gap of 30 years


def test_a_broad_likeness_is_no_difference_of_clocks() -> None:
    """A person who pushes half a second before it moves, smoothly: the likeness is as broad as the motion is slow."""
    d = recorded()
    slow = np.cumsum(np.random.default_rng(4).normal(size=(len(d) + 200, 3)), axis=0)
    slow = np.stack([np.convolve(column, np.hanning(200) / 100.0, "same") for column in slow.T], axis=1)[: len(d)]
    pushed = np.zeros((len(d), 6))
    pushed[:, :3] = slow
    moved = np.stack([np.interp(d.time - 0.4, d.time, column) for column in slow.T], axis=1) * 1e-3
    found = lateness(replace(d, position=moved, wrench=pushed))
    assert found is None

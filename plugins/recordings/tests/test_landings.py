"""Spikes of a tool that lands are no damage: told apart by their flanks and by what they do to the motion."""

from dataclasses import replace

import numpy as np
import pytest
from skillframe_recordings.audit import audit
from skillframe_recordings.suspicions import broken_samples, spike_indices

from skillframe.demonstration.record import Demonstration

RATE, MASS, SPEED, LANDS, TAU, NOISE = 500.0, 1.5, 0.05, 0.5, 0.003, 0.3


def landed(direction=(0.0, 0.0, -1.0), bias=0.0, seed=0):
    """A tool of 1.5 kg that is led at 50 mm/s onto something that takes its speed with a time constant of 3 ms.

    From F = m v' with v = v_0 exp(-t / tau): F = m v_0 / tau exp(-t / tau), at most 25 N.
    """
    rng, way = np.random.default_rng(seed), np.array(direction)
    time = np.arange(500) / RATE
    after = np.maximum(time - LANDS, 0.0)
    path = SPEED * np.minimum(time, LANDS) + SPEED * TAU * (1.0 - np.exp(-after / TAU))
    force = np.where(time >= LANDS, MASS * SPEED / TAU * np.exp(-after / TAU), 0.0)
    wrench = np.zeros((500, 6))
    wrench[:, :3] = -force[:, None] * way + bias + rng.normal(scale=NOISE, size=(500, 3))
    wrench[:, 3:] = rng.normal(scale=0.02, size=(500, 3))
    position = path[:, None] * way + rng.normal(scale=5e-5, size=(500, 3))
    return Demonstration(
        time=time, position=position, quaternion=np.tile([0.0, 0.0, 0.0, 1.0], (500, 1)), wrench=wrench, source="d"
    )


def told(demonstration):
    return [text for text in audit(demonstration).warnings if text.startswith("spikes")]


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize(
    ("direction", "bias"), [((0.0, 0.0, -1.0), 0.0), ((0.6, 0.0, -0.8), 0.0), ((0.0, 1.0, 0.0), 8.0)]
)
def test_the_force_that_stops_a_landing_tool_is_no_spike(direction, bias, seed):
    d = landed(direction, bias, seed)
    assert spike_indices(d.wrench[:, :3])[0].size >= 1  # it does stand out of its neighbours
    assert audit(d).spikes == 0
    assert not told(d)


@pytest.mark.parametrize("seed", range(5))
def test_the_same_force_on_a_tool_that_moves_on_is_a_spike(seed):
    d = landed(seed=seed)
    through = replace(d, position=d.position + np.outer(np.maximum(d.time - LANDS, 0.0), [0.0, 0.0, -SPEED]))
    assert told(through)
    away = replace(d, position=-d.position)  # the force pushes along the motion, which cannot stop it
    assert told(away)
    still = replace(d, position=0.0 * d.position)
    assert told(still)


@pytest.mark.parametrize("length", [1, 2])
@pytest.mark.parametrize("where", [100, 240, 300, 450])
def test_broken_samples_are_all_told_beside_a_landing(where, length):
    d = landed()
    wrench = d.wrench.copy()
    wrench[where : where + length, 1] += 40.0
    assert broken_samples(replace(d, wrench=wrench)).tolist() == list(range(where, where + length))


@pytest.mark.parametrize("length", [1, 2])
def test_a_broken_sample_at_the_moment_of_landing_has_no_flank_and_is_told(length):
    d = landed()
    wrench = np.random.default_rng(1).normal(scale=NOISE, size=(500, 6))
    first = round(LANDS * RATE)
    wrench[first : first + length, 2] += 40.0
    assert broken_samples(replace(d, wrench=wrench)).tolist() == list(range(first, first + length))


def test_at_the_ends_of_a_recording_nothing_can_be_told_of_a_motion_and_every_spike_counts():
    d = landed()
    wrench = np.random.default_rng(1).normal(scale=NOISE, size=(500, 6))
    for first in (1, 2, 496, 498):
        broken = wrench.copy()
        broken[first : first + 3, 2] += np.array([40.0, 20.0, 10.0])[: 500 - first]
        seen = spike_indices(broken[:, :3])[0].tolist()
        assert first in seen and broken_samples(replace(d, wrench=broken)).tolist() == seen

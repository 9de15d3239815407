"""The watch for contact that rings: what it takes for ringing, and what for a force that changes."""

import numpy as np
import pytest

from skillframe.control.admittance import MEMORY, SHARE, SLOW, RingWatch

DT, DELAY, PUSH = 2e-3, 0.04, 20.0


def watched(forces, count=1):
    watch = RingWatch(count, DT, DELAY, PUSH)
    return np.array([watch.look(np.atleast_2d(force)) for force in forces]), watch


def sine(amplitude, hertz, seconds=3.0):
    time = np.arange(0.0, seconds, DT)
    return np.outer(np.sin(2.0 * np.pi * hertz * time), [0.0, 0.6, 0.8]) * amplitude


def test_a_sine_rings_from_the_amplitude_on_whose_two_sides_are_both_remembered():
    """Of a sine the rest of a low-pass of time constant T, |s T / (1 + s T)|; it fades while the other side grows.

    It goes by steps of 2 ms: 5 %.
    """
    hertz = 1.0 / (4.0 * DELAY)
    turn, since = 2.0 * np.pi * hertz * SLOW * DELAY, np.linspace(0.0, 2.0 * DELAY, 1000)
    kept = np.minimum(np.exp(-since / (MEMORY * DELAY)), -np.cos(2.0 * np.pi * hertz * since)).max()
    least = SHARE * PUSH * np.sqrt(1.0 + turn**2) / turn / kept
    for amplitude, rings in ((0.95 * least, False), (1.05 * least, True)):
        found, _ = watched(sine(amplitude, hertz))
        assert found[-500:].any() == rings


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_force_that_only_rises_or_only_falls_does_not_ring_however_far_or_fast(sign):
    """A touch of three pushes, at once, within T_tot and over seconds."""
    time = np.arange(0.0, 3.0, DT)
    for rise in (np.ones_like(time), 1.0 - np.exp(-time / DELAY), time):
        found, watch = watched(np.outer(rise, [sign * 60.0, 0.0, 0.0]))
        assert not found.any()
        assert watch.amplitude[0] == 0.0


def test_a_touch_that_leaves_again_rings_for_as_long_as_it_is_remembered():
    """15 N for T_tot and gone: the fall is F (1 - exp(-T / (SLOW T))), the lesser part. It fades by exp(-t / 5 T)."""
    still = round(DELAY / DT)
    forces = np.zeros((800, 3))
    forces[:still, 2] = 15.0
    found, _ = watched(forces)
    fallen = 15.0 * (1.0 - np.exp(-1.0 / SLOW))
    assert not found[:still].any() and found[still]
    expected = MEMORY * DELAY * np.log(fallen / (SHARE * PUSH))
    assert DT * found.sum() == pytest.approx(expected, abs=2 * DT)  # two steps


def test_a_row_does_not_depend_on_its_neighbours():
    forces = np.stack([sine(9.0, 6.0, 0.5), np.full((250, 3), np.nan), sine(1.0, 6.0, 0.5)], axis=1)
    many, _ = watched(forces, 3)
    for row in (0, 2):
        alone, _ = watched(forces[:, row])
        np.testing.assert_array_equal(many[:, row], alone[:, 0])
    assert not many[:, 1].any()

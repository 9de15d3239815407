"""The watch for contact that rings: what it takes for ringing, and what for a force that changes."""

import numpy as np
import pytest

from skillframe.control.ringing import MEMORY, SHARE, SLOW, RingWatch

DT, DELAY, PUSH = 2e-3, 0.04, 20.0


def watched(forces, count=1):
    watch = RingWatch(count, DT, DELAY, PUSH)
    return np.array([watch.look(np.atleast_2d(force)) for force in forces]), watch


def sine(amplitude, hertz, seconds=3.0):
    time = np.arange(0.0, seconds, DT)
    return np.outer(np.sin(2.0 * np.pi * hertz * time), [0.0, 0.6, 0.8]) * amplitude


def test_a_sine_rings_from_the_amplitude_on_that_a_first_order_filter_leaves_of_a_quarter_of_the_push():
    """The rest of a low-pass of time constant T: |s T / (1 + s T)|. It goes by steps of 2 ms: 5 %."""
    hertz = 1.0 / (4.0 * DELAY)
    turn = 2.0 * np.pi * hertz * SLOW * DELAY
    least = SHARE * PUSH * np.sqrt(1.0 + turn**2) / turn
    for amplitude, rings in ((0.95 * least, False), (1.05 * least, True)):
        found, _ = watched(sine(amplitude, hertz))
        assert found[-500:].any() == rings


def test_a_force_that_rises_slowly_or_stays_does_not_ring():
    """A ramp of r N/s leads f_s by r SLOW T: 20 N/s by 1.6 N."""
    ramp = np.outer(np.arange(0.0, 3.0, DT), [20.0, 0.0, 0.0])
    found, watch = watched(ramp)
    assert not found.any()
    assert watch.amplitude[0] == pytest.approx(20.0 * SLOW * DELAY, rel=0.02)


def test_a_touch_rings_for_as_long_as_it_is_remembered():
    """A step of F is forgotten as F exp(-t / 10 T): until t = 10 T ln(F / 5 N), to two steps."""
    found, _ = watched(np.tile([0.0, 0.0, 15.0], (800, 1)))
    assert found[0, 0]
    assert DT * found.sum() == pytest.approx(MEMORY * DELAY * np.log(15.0 / (SHARE * PUSH)), abs=2 * DT)


def test_a_row_does_not_depend_on_its_neighbours():
    forces = np.stack([sine(9.0, 6.0, 0.5), np.full((250, 3), np.nan), sine(1.0, 6.0, 0.5)], axis=1)
    many, _ = watched(forces, 3)
    for row in (0, 2):
        alone, _ = watched(forces[:, row])
        np.testing.assert_array_equal(many[:, row], alone[:, 0])
    assert not many[:, 1].any()

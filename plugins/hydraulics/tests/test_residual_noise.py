"""The residual's noise by formula, against noise that passes the machine's own filters, and against what was found."""

import dataclasses

import numpy as np
import pytest
from skillframe_hydraulics.declared import MachineNoise
from skillframe_hydraulics.force.damped import CriticallyDamped
from skillframe_hydraulics.force.momentum import ForceSettings
from skillframe_hydraulics.force.residual_noise import LEAST, RUBBING, residual_noise
from skillframe_hydraulics.law.vdc_actuator import cylinders

from skillframe.signals import RateFilter
from tests.laws.crane_plants import crane

DT, SAMPLES = 1e-3, 20_000


def known():
    return cylinders(crane().robot.spec.actuation)


@pytest.mark.parametrize(("corner", "dt"), [(24.0, 1e-3), (60.0, 1e-3), (24.0, 2e-3)])
@pytest.mark.slow
def test_noise_through_the_filters_themselves_has_the_stated_deviation(corner, dt):
    """Fifty signals of 20 s and more: a deviation is known within half a percent."""
    rng, sensors = np.random.default_rng(2), MachineNoise(encoder=1.0, pressure=0.0, corner_hz=corner)
    gauge, smooth, found, before = RateFilter(corner, dt), CriticallyDamped(8.0, dt), [], np.zeros(50)
    gauge.start(before)
    for _ in range(SAMPLES):
        rate = gauge.step(rng.standard_normal(50))
        found.append(smooth.step((rate - before) / dt).copy())
        before = rate
    state = crane().at(crane().minimal(crane().robot.home), np.zeros(3))
    smooth_pistons = dataclasses.replace(known(), coulomb_friction=np.zeros(3))
    expected = residual_noise(crane(), smooth_pistons, sensors, 8.0, dt) / np.linalg.norm(state.mass, axis=1)
    assert np.std(found[1000:]) == pytest.approx(expected[0], rel=0.02)
    np.testing.assert_allclose(expected, expected[0])


def test_for_the_crane_that_ships_it_gives_what_was_measured_in_air_within_a_tenth():
    np.testing.assert_allclose(
        residual_noise(crane(), known(), MachineNoise(), ForceSettings().corner, DT),
        ForceSettings().row_noise,
        rtol=0.1,
    )


def test_perfect_sensors_leave_what_friction_leaves():
    silent = MachineNoise(encoder=0.0, pressure=0.0)
    arms = crane().at(crane().minimal(crane().robot.home), np.zeros(3)).arms
    left = np.abs(np.diag(arms)) * RUBBING * known().coulomb_friction
    np.testing.assert_allclose(residual_noise(crane(), known(), silent, 8.0, DT), left, rtol=1e-9)


def test_what_has_no_noise_at_all_still_has_a_weight():
    smooth_pistons = dataclasses.replace(known(), coulomb_friction=np.zeros(3))
    silent = MachineNoise(encoder=0.0, pressure=0.0)
    np.testing.assert_allclose(residual_noise(crane(), smooth_pistons, silent, 8.0, DT), LEAST)

"""The generated estimate and the readable one are one estimate."""

import dataclasses

import numpy as np
import pytest
from skillframe_hydraulics.force.compiled import CompiledEstimator
from skillframe_hydraulics.force.momentum import ForceSettings
from skillframe_hydraulics.law.hydraulic import HydraulicGains, Measured
from skillframe_hydraulics.law.hydraulic_compiled import CompiledLaw
from skillframe_hydraulics.law.vdc_actuator import cylinders

from tests.laws.vdc_loop import START, crane
from tests.oracle.force_estimator import ForceEstimator

DT = 1e-3
SAME = 1e-8  # relative to the largest; differences over a millisecond leave 1e-16 x 1e3 of the momentum, twice
QUICK = ForceSettings(settle=0.01, memory=0.005)  # so that pistons count as sliding within a short test


def machine(count):
    return crane(), cylinders(crane().robot.spec.actuation), count, DT


def motions(count, ticks=80):
    """Sensors of machines that swing up, pause and come back, with noise, and the model's terms there."""
    rng, law = np.random.default_rng(5), CompiledLaw(*machine(0)[:2], HydraulicGains(), count, DT)
    phase = rng.uniform(0.0, 2.0, (count, 3))
    for k in range(ticks):
        turn = 2 * np.pi * k / 40 + 0.2 * phase
        z = START + 0.02 * phase * np.sin(turn)
        rate = 0.3 * phase * np.cos(turn)
        pressures = 90e5 + 3e6 * np.sin(turn + phase), 60e5 + 2e6 * np.cos(turn)
        measured = Measured(z, rate, *pressures, *np.zeros((2, count, 2)))
        at = law.terms(measured)
        yield measured, type(at)(*(x.copy() for x in at))


def close(found, expected, what):
    for name, own, other in zip(expected._fields, found, expected, strict=True):
        np.testing.assert_allclose(own, other, rtol=0, atol=SAME * np.abs(other).max(), err_msg=f"{name}, {what}")


@pytest.mark.parametrize("use_compiler", [True, False])
@pytest.mark.parametrize("parts", [{}, {"force_corner": None}, {"weighted": False}])
def test_the_generated_estimate_is_the_readable_one_in_air_and_after(use_compiler, parts):
    settings = dataclasses.replace(QUICK, **parts)
    readable = ForceEstimator(*machine(2), settings)
    generated = CompiledEstimator(*machine(2), settings, use_compiler=use_compiler)
    slid = 0
    for k, (measured, at) in enumerate(motions(2)):
        if k in (0, 50):  # the second start forgets all but what was identified
            readable.start()
            generated.start()
        for each in (readable, generated):
            each.calibrate(k < 50)
        expected, found = readable.step(measured, at), generated.step(measured, at)
        close(found, expected, f"sample {k}")
        np.testing.assert_allclose(generated.friction(at), readable.friction(at), rtol=1e-9, atol=1e-6)
        slid += int(expected.valid.sum())
    np.testing.assert_allclose(generated.identification.theta, readable.identification.theta, rtol=1e-6, atol=1e-6)
    assert slid > 10
    assert readable.identification.rows.min() > 0


@pytest.mark.slow
def test_a_trial_is_the_same_to_the_bit_alone_and_in_a_batch():
    batch, alone = CompiledEstimator(*machine(3), QUICK), CompiledEstimator(*machine(1), QUICK)
    for k, (measured, at) in enumerate(motions(3, 30)):
        one = type(measured)(*(x[1:2] for x in measured)), type(at)(*(x[1:2] for x in at))
        if k == 0:
            batch.start()
            alone.start()
        together = batch.step(measured, at)
        for own, many in zip(alone.step(*one), together, strict=True):
            np.testing.assert_array_equal(own[0], many[1])

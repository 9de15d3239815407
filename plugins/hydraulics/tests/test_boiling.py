"""Oil that is torn apart boils: no chamber goes below -1 bar gauge, in both FMUs and in their Python reference."""

import numpy as np
import pytest
from skillframe_hydraulics.cylinder import equations as eq

from plugins.hydraulics.tests.test_cylinder_dynamics import radau
from plugins.hydraulics.tests.test_cylinder_static import PA, PB, parameters
from plugins.hydraulics.tests.test_reference import bank as reference_bank
from tests.unit.fmu.fmu_fakes import Swing, bank

H, STEPS, FLOOR = 1e-3, 500, -1e5
TORN = {"check_conductance": 0.0, "leakage": 0.0, "coulomb_friction": 0.0, "static_friction": 0.0}
"""Nothing lets oil in, so a piston that is pulled tears it apart."""
CASES = {"litres": {}, "hoses": {"dead_volume_a": 3e-4, "dead_volume_b": 3e-4}, "air": {"air_fraction": 0.01}}


def pulled(b, hertz=2.0, amplitude=0.2):
    """Pressures (STEPS, 2) of a closed cylinder whose piston goes to and fro."""
    swing, found = Swing(amplitude, hertz), []
    b.u[:, 1:3] = swing.at(0.0)[:2]
    b.start()
    for k in range(STEPS):
        b.u[:, 1:4] = swing.at(k * H)
        assert b.step(k * H, H)
        found.append(b.y[0, [PA, PB]].copy())
    return np.array(found)


@pytest.mark.parametrize("cylinder", [3], indirect=True)
@pytest.mark.parametrize("case", CASES)
@pytest.mark.slow
def test_no_pressure_goes_below_the_floor_in_either_version_and_the_reference_agrees(cylinder, cylinder2, case):
    changes = TORN | CASES[case]
    three, two, ours = (
        pulled(b) for b in (bank(cylinder, changes), bank(cylinder2, changes), reference_bank([changes]))
    )
    assert np.array_equal(three, two)
    for seen in (three, ours):
        assert seen.min() >= FLOOR
        assert seen.min() < (-0.9e5 if case != "air" else 0.0)  # else nothing was torn; bubbles grow instead
        assert seen.max() > 30e5  # and the other chamber is squeezed as before
    # a few kPa: where a piston turns at the floor the two integrators see the kink at other times
    np.testing.assert_allclose(three, ours, atol=5e3, rtol=2e-3)


def test_a_cavity_closes_as_soon_as_the_piston_comes_back(cylinder2):
    """A quarter of a period out, then back: the pressure rises from the floor within a step or two of the turn."""
    seen = pulled(bank(cylinder2, TORN))[:, 1]
    swing = Swing(0.2, 2.0)
    speed = np.array([swing.at((k + 1) * H)[1] for k in range(STEPS)])
    torn = (seen < -0.9e5) & (np.abs(speed) > 0.1)
    assert torn.any() and np.all(speed[torn] < 0.0)  # the rod's chamber grows while the piston goes in


@pytest.mark.slow
def test_the_slope_that_the_integrator_is_given_is_that_of_the_law(cylinder2):
    """At the floor the FMU's steps of a millisecond come to what scipy's Radau comes to."""
    p = parameters(**TORN)
    swing, y = Swing(0.2, 2.0), eq.equilibrium(parameters(**TORN), np.zeros(1))[:, 0]
    seen = pulled(bank(cylinder2, TORN))
    for k in range(80):
        x, v, a = swing.at(k * H)

        def motion(s, x=x, v=v, a=a):
            return x + v * s + a * s * s / 2, v + a * s, 0.0

        y = radau(p, y, motion, [0.0, H])
        np.testing.assert_allclose(seen[k], y[2:4], atol=500.0, rtol=1e-4)  # 5 mbar, the FMU's own tolerance


def test_above_the_floor_nothing_is_left_of_it():
    pressure = np.array([-0.9e5, 0.0, 1e7, -2e5, -0.95e5])
    np.testing.assert_array_equal(eq.boiling(pressure, np.full(5, -1.0)), [1.0, 1.0, 1.0, 0.0, 0.5])
    np.testing.assert_array_equal(eq.boiling(pressure, np.full(5, 1.0)), np.ones(5))

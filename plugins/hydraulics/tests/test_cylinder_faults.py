"""A hole in a hose and a supply that is lost, as inputs of the cylinder: closed forms, and the FMU against its twin."""

import numpy as np
import pytest
from skillframe_hydraulics.cylinder.reference import ReferenceBank

from plugins.hydraulics.tests.test_cylinder_static import PA, PB
from skillframe.fmu.actuator import ActuatorSpec
from skillframe.fmu.build import fmu_folders
from skillframe.fmu.driver import FmuBank
from skillframe.fmu.table import read_table

H = 1e-3
MAPPED = {n: n for n in ("command", "position", "velocity", "acceleration", "burst_a", "burst_b", "supply_drop")}
BURST_A, BURST_B, DROP, FLOW_A = 4, 5, 6, 5
HELD = {"initial_force": 5.5e4, "leakage": 0.0, "return_pressure": 0.0, "initial_pressure": 60e5}
"""The lift as it hangs. The port's check opens below the return line, so it stays shut here."""


def specs(**parameters):
    return [ActuatorSpec(fmu="hydraulic_cylinder", parameters=HELD | parameters, inputs=MAPPED)]


@pytest.fixture(params=["fmu", "reference"])
def make(request, cylinder2):
    """Makes a started bank of one cylinder at mid stroke."""

    def started(**parameters):
        chosen = specs(**parameters)
        table = read_table(fmu_folders()["hydraulic_cylinder"])
        bank = FmuBank(chosen, [cylinder2]) if request.param == "fmu" else ReferenceBank(chosen, table)
        bank.u[:, 1] = 0.3
        bank.start()
        return bank

    return started


@pytest.mark.parametrize(
    ("side", "column", "area", "length"), [("a", PA, 0.08**2, 0.3), ("b", PB, 0.08**2 - 0.045**2, 0.29)]
)
def test_the_root_of_the_pressure_falls_linearly_while_a_hose_empties(make, side, column, area, length):
    """p' = -(B/V) S C sqrt(p) at a piston that stands, so sqrt(p) loses B S C / 2V a second."""
    bank, hole = make(), 2e-6
    bank.u[0, BURST_A if side == "a" else BURST_B] = hole
    volume, before = 3e-3 + np.pi / 4 * area * length, bank.y[0, column]
    for k in range(60):
        assert bank.step(k * H, H)
    expected = np.sqrt(before) - 60 * H * 8e8 / volume * hole * 0.67 * np.sqrt(2 / 850) / 2
    assert bank.y[0, column] < 0.9 * before
    # C stands as three digits, and the laminar transition at 1 bar takes (1/50)^2 / 4 from the flow
    assert np.sqrt(before) - np.sqrt(bank.y[0, column]) == pytest.approx(np.sqrt(before) - expected, rel=1e-3)


def test_a_large_hole_empties_its_chamber_within_ten_milliseconds_and_the_other_keeps_its_pressure(make):
    bank = make()
    other = bank.y[0, PB]
    bank.u[0, BURST_A] = 1.27e-4  # half an inch
    for k in range(10):
        assert bank.step(k * H, H)
    assert bank.y[0, PA] < 1e5 and bank.y[0, PB] == pytest.approx(other, rel=1e-9)  # it leaks nowhere


def test_a_lost_supply_lets_a_chamber_drain_backwards_through_an_open_valve(make):
    bank = make(return_pressure=10e5, initial_pressure=30e5)
    bank.u[0, 0], bank.u[0, DROP] = 1.0, 180e5
    for k in range(300):
        assert bank.step(k * H, H)
    # what is left before the valve is 10 bar, and oil flows until the chamber has no more; 1e3 Pa of 120 bar remain
    assert bank.y[0, PA] == pytest.approx(10e5, abs=1e3)
    assert abs(bank.y[0, FLOW_A]) < 1e-6


@pytest.mark.parametrize("own", [{}, {"counterbalance_a": 300e5, "pilot_ratio": 3.5}])
@pytest.mark.parametrize("command", [0.2, -0.2])
def test_fmu_and_reference_lose_their_oil_alike(cylinder2, own, command):
    table = read_table(fmu_folders()["hydraulic_cylinder"])
    fmu, twin = FmuBank(specs(**own), [cylinder2]), ReferenceBank(specs(**own), table)
    for bank in (fmu, twin):
        bank.u[0] = command, 0.3, 0.0, 0.0, 1e-6 if own else 0.0, 3e-5, 20e5
        bank.start()
        for k in range(50):
            assert bank.step(k * H, H)
    # both integrators keep to 10 Pa of a converged solution each (test_cylinder_dynamics), of 1e7 Pa; where a
    # valve shuts within a step of the reference, to 1e-4 of it
    np.testing.assert_allclose(fmu.y[0, [PA, PB]], twin.y[0, [PA, PB]], rtol=0, atol=1e3 if own else 20.0)

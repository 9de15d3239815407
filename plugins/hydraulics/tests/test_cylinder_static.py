"""Closed forms at rest: areas, equilibrium, held loads, holding without creep, bulk modulus, rated flow."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from skillframe_hydraulics.cylinder import equations as eq
from skillframe_hydraulics.cylinder.reference import ReferenceBank

from skillframe.fmu.actuator import ActuatorSpec
from skillframe.fmu.build import fmu_folders
from skillframe.fmu.driver import FmuBank
from skillframe.fmu.table import read_table, rows
from tests.unit.fmu.fmu_fakes import bank

FREE = {"coulomb_friction": 0.0, "static_friction": 0.0, "viscous_friction": 0.0}
FORCE, PA, PB = 0, 3, 4


def parameters(**changes):
    table = read_table(fmu_folders()["hydraulic_cylinder"])
    values = {r.name: r.entry.start for r in rows(table) if r.causality == "parameter"}
    return eq.derive(values | changes)


@settings(max_examples=30)
@given(st.floats(10.0, 1000.0), st.floats(1e3, 1e5))
def test_an_edge_passes_the_root_of_its_drop_and_near_none_a_straight_line(ratio, transition):
    """Sharp-edged orifice, Q = c sqrt(dp). Off by (transition / dp)^2 / 4, 0.25 % at ten times the transition."""
    drop = ratio * transition
    assert eq.edge_flow(drop, transition) == pytest.approx(math.sqrt(drop), rel=0.3 / ratio**2)
    assert eq.edge_flow(-drop, transition) == -eq.edge_flow(drop, transition)
    small = transition / ratio
    assert eq.edge_flow(small, transition) == pytest.approx(small / math.sqrt(transition), rel=0.3 / ratio**2)


@settings(max_examples=20)
@given(st.floats(10e5, 150e5), st.floats(10e5, 150e5), st.floats(0.05, 0.5))
def test_what_leaks_out_of_one_chamber_enters_the_other_from_high_to_low(pressure_a, pressure_b, position):
    """Valve shut, piston held: flows are p' V / B, of both chambers opposite and c_l (p_a - p_b)."""
    p = parameters(leakage=1e-12)
    y = np.array([0.0, 0.0, pressure_a, pressure_b, 0.0])[:, None]
    still = np.zeros(1)
    rate = eq.pressure_rates(p, y, eq.PistonMotion(np.array([position]), still, still))[:, 0]
    volume = np.array([p.dead_volume_a + p.area_a * position, p.dead_volume_b + p.area_b * (p.stroke - position)])
    flow = rate * volume / np.array([eq.bulk_modulus(x, p) for x in (pressure_a, pressure_b)])
    leak = 1e-12 * (pressure_a - pressure_b)
    np.testing.assert_allclose(flow, [-leak, leak], rtol=1e-9, atol=1e-20)


@pytest.mark.parametrize("load", [-4e4, 0.0, 5.5e4])
def test_the_pressures_at_the_start_hold_the_load_to_rounding(cylinder, load):
    b = bank(cylinder, FREE | {"initial_force": load})
    b.start()
    area_a, area_b = math.pi / 4 * 0.08**2, math.pi / 4 * (0.08**2 - 0.045**2)
    assert b.y[0, FORCE] == pytest.approx(load, rel=1e-10, abs=1e-10 * 1e5)  # 1e-10 of the forces that cancel
    assert area_a * b.y[0, PA] - area_b * b.y[0, PB] == pytest.approx(load, rel=1e-10, abs=1e-5)
    assert min(b.y[0, PA], b.y[0, PB]) == 30e5
    b.close()


def test_a_closed_valve_without_leakage_holds_its_load_for_a_minute_without_creep(cylinder2):
    b = bank(cylinder2, {"initial_force": 5.5e4, "leakage": 0.0})
    b.start()
    first = b.y.copy()
    for k in range(60_000):
        assert b.step(k * 1e-3, 1e-3)
    # nothing moves, so nothing may change: the tolerance is that of the equilibrium's own rounding
    np.testing.assert_allclose(b.y[0, [FORCE, PA, PB]], first[0, [FORCE, PA, PB]], rtol=1e-10)
    b.close()


def test_friction_holds_a_push_within_the_presliding_length_and_gives_it_back(cylinder2):
    b = bank(cylinder2, {"leakage": 0.0})
    b.start()
    stiffness = 4000 / 5e-4
    for k, v in enumerate([1e-4] * 100 + [0.0] * 500):  # 10 um in, then standing still
        b.u[0, 1:4] = 0.3 + 1e-4 * 1e-3 * min(k, 100), v, 0.0
        b.step(k * 1e-3, 1e-3)
    p = parameters()
    oil = sum(
        8e8 * a * a / volume for a, volume in ((p.area_a, 3e-3 + p.area_a * 0.3), (p.area_b, 3e-3 + p.area_b * 0.29))
    )
    held = -(stiffness + oil) * 1e-5
    # z relaxes by z/z_ss = 2 % over 10 um of sliding, so the force is within 2 % of the springs'
    assert b.y[0, FORCE] == pytest.approx(held, rel=0.02)
    b.close()


def test_the_valve_passes_the_rated_flow_at_the_rated_drop(cylinder):
    per_edge = {"supply_pressure": 100e5, "initial_pressure": 30e5, "return_pressure": 0.0, "laminar_pressure": 1e3}
    whole = per_edge | {"rated_drop_is_per_edge": False}
    b = bank(cylinder, per_edge, whole)
    b.u[:, 0] = 1.0
    b.start()
    # the laminar transition takes (dp_tr/dp)^2/4 of the flow
    np.testing.assert_allclose(b.y[:, 5], [100 / 60e3, math.sqrt(2) * 100 / 60e3], rtol=1e-8)
    b.close()


def test_overlap_opens_nothing_and_full_travel_opens_everything(cylinder2):
    b = bank(cylinder2, *({"deadband": 0.1, "initial_pressure": 30e5} for _ in range(3)))
    b.u[:, 0] = 0.1, 0.55, 1.0
    b.start()
    flows = b.y[:, 5] / b.y[2, 5]
    np.testing.assert_allclose(flows, [0.0, 0.5, 1.0], atol=1e-12)
    b.close()


@given(st.floats(0, 400e5), st.floats(0, 0.05), st.floats(4e8, 2e9))
@settings(max_examples=60, deadline=None)
@pytest.mark.slow
def test_the_bulk_modulus_is_minus_volume_times_slope_of_the_mixture(pressure, air, oil):
    p = parameters(air_fraction=air, bulk_modulus=oil)

    def volume(gauge):  # liquid of constant mass, air on a polytrope, per unit at ambient pressure
        liquid = (1 - air) * (1 - (gauge - pressure) / oil)
        return liquid + air * (eq.AMBIENT / (gauge + eq.AMBIENT)) ** (1 / 1.4)

    d = 10.0
    slope = (volume(pressure + d) - volume(pressure - d)) / (2 * d)
    # central differences over 20 Pa of a volume of one: 1e-16 / 20 Pa against a slope of 1e-9 / Pa
    assert float(eq.bulk_modulus(pressure, p)) == pytest.approx(-volume(pressure) / slope, rel=1e-5)


def test_relief_and_check_keep_a_blocked_cylinder_between_their_pressures(cylinder2):
    b = bank(cylinder2, {"leakage": 0.0}, {"leakage": 0.0, "air_fraction": 0.01})
    b.u[:, 2] = 0.1
    b.start()
    for k in range(1500):  # 0.15 m against a closed valve
        b.u[:, 1] = 0.3 + 0.1 * k * 1e-3
        assert b.step(k * 1e-3, 1e-3)
    area_a, area_b = math.pi / 4 * 0.08**2, math.pi / 4 * (0.08**2 - 0.045**2)
    relief, check = 250e5 + area_b * 0.1 / 1.7e-9, 10e5 - area_a * 0.1 / 8e-9
    np.testing.assert_allclose(b.y[:, PB], relief, rtol=1e-6)
    np.testing.assert_allclose(b.y[:, PA], check, rtol=1e-6)
    b.close()


@pytest.mark.parametrize("command", [0.3, -0.3])
def test_the_slope_of_the_flow_is_its_derivative_by_the_supplys_pressure(cylinder2, command):
    """Central differences over 2 kPa of a root at 100 bar, whose third derivative adds 1e-8; the reference alike."""
    outputs = {name: name for name in ("force", "flow_supply", "supply_slope")}
    inputs = {name: name for name in ("command", "position", "velocity", "acceleration", "supply_drop")}
    own = {"edge_pa": 0.4, "edge_pb": 1.7}
    spec = ActuatorSpec(fmu="hydraulic_cylinder", parameters=own, inputs=inputs, outputs=outputs)
    found = []
    for b in (FmuBank([spec], [cylinder2]), ReferenceBank([spec], read_table(fmu_folders()["hydraulic_cylinder"]))):
        drop, flow, slope = b.inputs.index("supply_drop"), *map(b.outputs.index, ("flow_supply", "supply_slope"))
        b.u[0, :2] = command, 0.3
        b.start()
        flows = []
        for more in (1e3, -1e3, 0.0):
            b.u[0, drop] = 20e5 + more
            assert b.refresh()
            flows.append(b.y[0, flow])
        assert b.y[0, slope] == pytest.approx((flows[1] - flows[0]) / 2e3, rel=1e-6)
        assert flows[2] > 0.0
        found.append(flows)
        b.close()
    np.testing.assert_allclose(found[0], found[1], rtol=1e-12)


def test_each_edge_passes_its_own_share_of_the_rated_flow():
    """Meter-in and meter-out that differ, and differ in both directions."""
    shares = {"edge_pa": 0.5, "edge_pb": 0.7, "edge_at": 2.0, "edge_bt": 1.5}
    for spool, into, out in ((0.6, "edge_pa", "edge_bt"), (-0.6, "edge_pb", "edge_at")):
        plain, own = (
            eq.valve_flows(parameters(**given), np.array([spool]), *(np.array([p]) for p in (60e5, 70e5, 180e5, 0.3)))
            for given in ({}, shares)
        )
        fed, drained = ("a", "b") if spool > 0.0 else ("b", "a")
        assert getattr(own, fed)[0] == pytest.approx(shares[into] * getattr(plain, fed)[0], rel=1e-14)
        assert getattr(own, drained)[0] == pytest.approx(shares[out] * getattr(plain, drained)[0], rel=1e-14)
        assert own.supply[0] == getattr(own, fed)[0]


@pytest.mark.parametrize("kind", ["fmu", "reference"])
def test_a_check_valve_keeps_a_load_up_that_a_fallen_supply_would_let_sink(cylinder2, kind):
    """50 kN need 119 bar, and the supply has 30: the check keeps its oil, which else goes back through the valve."""
    inputs = {name: name for name in ("command", "position", "velocity", "acceleration", "supply_drop")}
    names = ("force", "force_mean", "work", "pressure_a", "pressure_b", "flow_supply", "supply_slope")
    own = {"initial_force": 5e4, "leakage": 0.0}
    specs = [
        ActuatorSpec(fmu="x", parameters=own | {"feed_check": check}, inputs=inputs, outputs={n: n for n in names})
        for check in (0.0, 1.0)
    ]
    table = read_table(fmu_folders()["hydraulic_cylinder"])
    b = FmuBank(specs, [cylinder2] * 2) if kind == "fmu" else ReferenceBank(specs, table)
    b.u[:, :2] = 0.1, 0.3
    b.u[:, b.inputs.index("supply_drop")] = 160e5
    b.start()
    high = b.y[1, PA]
    for k in range(600):
        assert b.step(k * 1e-3, 1e-3)
    flow, slope = (b.outputs.index(name) for name in ("flow_supply", "supply_slope"))
    assert b.y[1, PA] == high > 110e5
    assert b.y[1, flow] == b.y[1, slope] == 0.0
    assert b.y[0, PA] < 35e5
    b.close()

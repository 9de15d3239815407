"""Counterbalance valves: closed forms, an integration of the stated equations, loads lowered and held, and the law."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from skillframe_hydraulics.counterbalance import Counterbalance, conductances, counterbalances, narrowing
from skillframe_hydraulics.cylinder.bank import open_cylinders
from skillframe_hydraulics.force.valve import ValveIdentification
from skillframe_hydraulics.law import vdc_actuator as act
from skillframe_hydraulics.law.hydraulic import Measured, Terms
from skillframe_hydraulics.oil_balance import Knowledge
from skillframe_hydraulics.watch import FlowWatch

from plugins.hydraulics.tests.test_cylinder_static import FORCE, FREE, PA, PB
from skillframe.fmu import INPUTS, ActuatorSpec
from skillframe.robot.spec import load_robot

H = 2.5e-4
D, ROD, STROKE, DEAD, B = 0.080, 0.045, 0.59, 3e-3, 8e8
AREA_A, AREA_B = math.pi / 4 * D**2, math.pi / 4 * (D**2 - ROD**2)
EDGE, WIDE = 100.0 / 6e4 / math.sqrt(70e5), 6.0
SUPPLY, RETURN, LAMINAR = 190e5, 10e5, 1e5
SETTING, RATIO, RANGE, OPEN = 130e5, 1.5, 30e5, 1e-3 / math.sqrt(10e5)
MASS, LOAD, RUB = 4000.0, 4.0e4, 4e4  # kg, N on the rod, N s/m
PLAIN = FREE | {
    "viscous_friction": RUB, "edge_at": WIDE, "spool_slew": 0.0, "leakage": 0.0, "initial_force": LOAD,
    "initial_pressure": 15e5,
}  # fmt: skip
HELD = PLAIN | {"counterbalance_a": SETTING, "pilot_ratio": RATIO}
BORNE = (LOAD + AREA_B * 15e5) / AREA_A  # Pa at the loaded port
EXTRA = ("burst_a", "burst_b", "supply_drop")


def ridden(parameters, command, seconds, extra=lambda t: (0.0, 0.0, 0.0), place=0.4):
    """A mass on a cylinder, rows of x, v, p_a and p_b at every step: it takes a and gives the force."""
    names = {name: name for name in (*INPUTS, *EXTRA)}
    bank = open_cylinders([ActuatorSpec(fmu="hydraulic_cylinder", parameters=parameters, inputs=names)])
    at = [bank.inputs.index(name) for name in names]
    x, v, force, found = place, 0.0, LOAD, []
    bank.u[0, at] = 0.0, x, v, 0.0, 0.0, 0.0, 0.0
    bank.start()
    for k in range(round(seconds / H)):
        a = (force - LOAD) / MASS
        bank.u[0, at] = command(k * H), x, v, a, *extra(k * H)
        assert bank.step(k * H, H), bank.problem(0)
        new = (bank.y[0, FORCE] - LOAD) / MASS
        x, v = x + v * H + H * H / 6 * (2 * a + new), v + H / 2 * (a + new)
        bank.u[0, at[1:3]] = x, v
        bank.refresh()
        force = bank.y[0, FORCE]
        found.append((x, v, bank.y[0, PA], bank.y[0, PB]))
    bank.close()
    return np.array(found)


def root(drop):
    return drop / (drop * drop + LAMINAR**2) ** 0.25


def stated(t, y, command):
    """The cylinder of the README with its mass, once more: rates of spool, its rate, p_a, p_b, x and v."""
    spool, rate, pa, pb, x, v = y
    omega = 2 * math.pi * 30.0
    u = min(max(spool, -1.0), 1.0)
    valve = OPEN * min(max((pa + RATIO * pb - SETTING) / RANGE, 0.0), 1.0)
    if u > 0.0:
        qa, qb = (EDGE * u * root(SUPPLY - pa) if pa < SUPPLY else 0.0), -EDGE * u * root(pb - RETURN)
    else:
        wide = WIDE * EDGE * -u
        if pa > RETURN:
            wide = wide * valve / math.hypot(wide, valve) if valve > 0.0 else 0.0
        qa, qb = -wide * root(pa - RETURN), EDGE * -u * root(SUPPLY - pb)
    for which, p in (("a", pa), ("b", pb)):  # port relief and check
        more = 8e-9 * max(RETURN - p, 0.0) - 1.7e-9 * max(p - 250e5, 0.0)
        qa, qb = (qa + more, qb) if which == "a" else (qa, qb + more)
    return [
        rate, omega**2 * (command(t) - spool) - 2 * 0.707 * omega * rate,
        B / (DEAD + AREA_A * x) * (qa - AREA_A * v), B / (DEAD + AREA_B * (STROKE - x)) * (qb + AREA_B * v),
        v, (AREA_A * pa - AREA_B * pb - RUB * v - LOAD) / MASS,
    ]  # fmt: skip


def commanded(t):
    """Lowered, stopped, lifted, lowered slowly."""
    return (-0.5, 0.0, 0.3, -0.1)[min(int(t / 0.3), 3)]


@pytest.mark.slow
def test_pressures_and_positions_are_those_of_an_integration_of_the_stated_equations():
    found = ridden(HELD, commanded, 1.2)
    y, rows = [0.0, 0.0, BORNE, 15e5, 0.4, 0.0], []
    for begin in (0.0, 0.3, 0.6, 0.9):
        times = np.arange(round(begin / H) + 1, round((begin + 0.3) / H) + 1) * H
        held = commanded(begin + 0.1)
        solved = solve_ivp(
            lambda t, y, held=held: stated(t, y, lambda _: held), (begin, times[-1]), y, method="Radau", t_eval=times,
            rtol=1e-8, atol=[1e-9, 1e-6, 1.0, 1.0, 1e-10, 1e-9],
        )  # fmt: skip
        rows.append(solved.y.T)
        y = solved.y[:, -1]
    rows = np.concatenate(rows)
    assert np.ptp(rows[:, 4]) > 0.05 and np.ptp(rows[:, 2]) > 30e5  # it has moved, and the valve has worked
    np.testing.assert_allclose(found[:, 2:], rows[:, 2:4], rtol=0.0, atol=0.1e5)
    np.testing.assert_allclose(found[:, 0], rows[:, 4], rtol=0.0, atol=1e-4)


def lowered(parameters, u=-0.15):
    """Mean speed, and both pressures, of a load that has settled to sinking."""
    found = ridden(parameters, lambda t: u, 1.2, place=0.5)
    return found[-800:].mean(axis=0)[1:]


def test_a_load_that_runs_ahead_empties_the_other_chamber_and_with_the_valve_follows_the_command():
    """The command is the oil that the edge from the supply lets into chamber b."""
    speed, _, p_b = lowered(PLAIN)
    assert p_b < RETURN  # fed by the anti-cavitation check alone
    assert -speed > 1.5 * 0.15 * EDGE * root(SUPPLY - p_b) / AREA_B
    speed, _, p_b = lowered(HELD)
    assert p_b > RETURN + 5e5
    # a per cent: what the load still swings by in the last 0.2 s
    assert -speed == pytest.approx(0.15 * EDGE * root(SUPPLY - p_b) / AREA_B, rel=0.01)


@pytest.mark.parametrize("setting", [120e5, 130e5, 150e5])
@pytest.mark.parametrize("ratio", [1.0, 1.5])
def test_in_steady_lowering_the_pilot_has_what_the_setting_lacks_over_the_pilot_ratio(setting, ratio):
    """p_pilot = (p_set + open p_range - p_load) / R, with the opening that passes A_a v in series with the edge."""
    speed, p_a, p_b = lowered(HELD | {"counterbalance_a": setting, "pilot_ratio": ratio})
    through, wide = -AREA_A * speed / root(p_a - RETURN), 0.15 * WIDE * EDGE
    opened = 1.0 / math.sqrt(through**-2 - wide**-2) / OPEN
    assert 0.05 < opened < 0.95
    # 1 % of the opening, likewise
    assert p_b == pytest.approx((setting + opened * RANGE - p_a) / ratio, abs=0.01 * RANGE / ratio)


@pytest.mark.slow
@pytest.mark.parametrize(("share", "swings"), [(0.5, False), (2.0, True)])
def test_a_load_swings_up_while_it_sinks_if_the_pilot_ratio_is_above_that_of_the_chambers_lengths(share, swings):
    """As on real machines. Without friction, where the valve's flow grows by G with the load's pressure,

    m V_a V_b s^3 + m V_b B G s^2 + B (A_b^2 V_a + A_a^2 V_b) s + B^2 G A_b (A_b + R A_a) = 0, stable by Routh's
    criterion for R < (V_b / A_b) / (V_a / A_a), here 1.06 m over 1.00 m.
    """
    most = (DEAD / AREA_B + STROKE - 0.4) / (DEAD / AREA_A + 0.4)
    free = HELD | {"viscous_friction": 0.0, "counterbalance_a": 200e5, "pilot_ratio": share * most}
    speed = ridden(free, lambda t: -0.04, 3.0)[-round(0.4 / H) :, 1]
    assert (np.std(speed) > np.abs(speed.mean())) == swings
    assert swings or np.std(speed) < 0.2 * -speed.mean()


def test_a_held_load_stays_and_sinks_only_by_the_pistons_leak():
    """With the spool shut the valve changes no bit; closed chambers give way by c_l (p_a - p_b) t and their oil."""
    still = ridden(HELD, lambda t: 0.0, 1.0)
    assert np.ptp(still[:, 0]) < 1e-7
    leak = 1e-11
    one, other = (ridden(p | {"leakage": leak}, lambda t: 0.0, 1.0) for p in (HELD, PLAIN))
    np.testing.assert_array_equal(one, other)
    begin, end = one[0], one[-1]
    lost = leak * np.sum(one[1:, 2] - one[1:, 3]) * H
    volume = DEAD + AREA_A * 0.4
    # oil that leaves chamber a, less what it expands by: the piston's way, to the 0.1 % that the volume changes by
    assert AREA_A * (begin[0] - end[0]) == pytest.approx(lost + volume / B * (end[2] - begin[2]), rel=5e-3)
    assert begin[0] - end[0] > 1e-4


def half_an_inch(t):
    return (1.27e-4 if t > 0.1 else 0.0, 0.0, 0.0)


@pytest.mark.parametrize("u", [0.0, 0.2])
def test_a_burst_hose_drops_a_load_and_with_the_valve_it_stays(u):
    """While it is lifted, too: what the spool lets in goes out of the hole."""
    fallen, kept = (ridden(p, lambda t: u, 0.5, half_an_inch, place=0.5) for p in (PLAIN, HELD))
    at = round(0.1 / H)
    assert fallen[at, 0] - fallen[-1, 0] > 0.1
    assert abs(kept[at, 0] - kept[-1, 0]) < 2e-3  # the oil's spring, of 60 bar over 0.6 m
    assert kept[-1, 2] > 50e5


def test_a_load_that_is_lifted_does_not_sink_into_a_supply_that_has_stopped():
    fallen, kept = (ridden(p, lambda t: 0.3, 0.5, lambda t: (0.0, 0.0, 180e5 * (t > 0.1))) for p in (PLAIN, HELD))
    assert fallen[-1, 0] < fallen[:, 0].max() - 0.03
    assert kept[-1, 0] > kept[:, 0].max() - 2e-3


def test_before_a_hose_that_leaks_a_little_the_load_still_rises():
    """Spool's flow less the hole's."""
    hole = 3e-6
    found = ridden(HELD, lambda t: 0.3, 0.8, lambda t: (hole, 0.0, 0.0), place=0.2)
    speed, p_a = found[-200:, 1].mean(), found[-200:, 2].mean()
    fed = 0.3 * EDGE * root(SUPPLY - p_a) - hole * 0.67 * math.sqrt(2.0 / 850.0) * root(p_a)
    assert AREA_A * speed == pytest.approx(fed, rel=0.01)


def test_two_orifices_in_series_pass_one_flow_whose_drops_add():
    edge, valve = 3e-7, np.array([1e-8, 3e-7, 1e-3, 0.0])
    flow = edge * narrowing(edge, valve) * math.sqrt(50e5)
    np.testing.assert_allclose((flow / edge) ** 2 + (flow / np.maximum(valve, 1e-30)) ** 2, 50e5, rtol=1e-9)


SPEC = load_robot("hiab_xs031")
NOMINAL = act.cylinders(SPEC.actuation)
VALVES = Counterbalance(
    counterbalance_a=np.array([SETTING, 0.0, 0.0]), counterbalance_b=np.array([0.0, SETTING, 0.0]),
    holds_a=np.array([1.0, 0.0, 0.0]), holds_b=np.array([0.0, 1.0, 0.0]), pilot_ratio=np.full(3, RATIO),
    counterbalance_range=np.full(3, RANGE), counterbalance_edge=np.full(3, OPEN),
)  # fmt: skip
CYLINDERS = dataclasses.replace(NOMINAL, counterbalance=VALVES, edge_at=np.full(3, 8.0))


def test_a_machine_without_a_valve_has_none():
    assert NOMINAL.counterbalance is None and counterbalances(SPEC.actuation) is None


@given(st.integers(0, 2**32 - 1))
def test_the_law_opens_the_spool_so_far_that_edge_and_valve_pass_what_is_asked(seed):
    """For shut, opening and open valves; a third cylinder has none."""
    rng, c = np.random.default_rng(seed), CYLINDERS
    x, p_a, p_b = rng.uniform(0.05, 0.5, 3), rng.uniform(15e5, 185e5, 3), rng.uniform(15e5, 60e5, 3)
    demand = rng.choice([-1.0, 1.0], 3) * 10.0 ** rng.uniform(-4.0, -2.0, 3)
    u = act.inverse_valve(c, demand, x, (p_a, p_b))
    a, b = act.chamber_lengths(c, x)
    held_a, held_b = conductances(VALVES, p_a, p_b)
    wide_a, wide_b = c.edge * c.edge_at * np.abs(u), c.edge * c.edge_bt * np.abs(u)
    out_a, out_b = wide_a * narrowing(wide_a, held_a), wide_b * narrowing(wide_b, held_b)
    extend = c.edge * u * np.sqrt(c.supply_pressure - p_a) / a + out_b * np.sqrt(p_b - c.return_pressure) / b
    retract = c.edge * u * np.sqrt(c.supply_pressure - p_b) / b - out_a * np.sqrt(p_a - c.return_pressure) / a
    np.testing.assert_allclose(np.where(demand > 0.0, extend, retract), demand, rtol=2e-5)


def flows_of_lowering(valves):
    """A cylinder's piston, pressures and mean command in steady lowering, and the balance's findings."""
    c = dataclasses.replace(CYLINDERS, counterbalance=valves)
    watch = FlowWatch(c, ("lift", "tilt", "extension"), 1, 0.02)
    knowledge = Knowledge(*(np.full((1, 3), value) for value in (SUPPLY, 0.0, 1e5, 0.0, 0.0, 1.0)))
    _, p_a, p_b = lowered(HELD | {"edge_at": 8.0})
    pressures = (np.array([[p_a, 60e5, 60e5]]), np.array([[p_b, 60e5, 60e5]]))
    speed = np.array([[-0.15 * EDGE * root(SUPPLY - p_b) / AREA_B, 0.0, 0.0]])
    valve, found = np.array([[-0.15, 0.0, 0.0]]), []
    for k in range(40):
        nothing = np.zeros((1, 1))
        seen = Measured(nothing, nothing, *pressures, nothing, nothing)
        terms = Terms(*(nothing,) * 4, np.zeros((1, 3, 3)), 0.4 + 0.02 * k * speed, speed, *(nothing,) * 3)
        found += watch.look(valve, seen, terms, knowledge, False)
    return [one.text for one in found]


@pytest.mark.slow
def test_the_watch_knows_the_valve_and_without_it_misses_oil():
    assert flows_of_lowering(VALVES) == []
    assert "the oil of lift does not balance" in flows_of_lowering(None)[0]


@pytest.mark.parametrize(("valves", "found"), [(VALVES, False), (None, True)])
def test_what_drains_through_a_valve_is_no_measure_of_the_spool(valves, found):
    c = dataclasses.replace(CYLINDERS, counterbalance=valves)
    known = ValveIdentification(c, 1, 1e-3)
    rows, nothing = np.ones((1, 3)), np.zeros((1, 1))
    for _ in range(2000):  # the lift sinks at half of what its edge would pass by itself
        seen = Measured(nothing, nothing, 80e5 * rows, 30e5 * rows, nothing, nothing)
        speed = np.array([[-0.5 * 0.15 * EDGE * 8.0 * math.sqrt(70e5) / AREA_A, 0.0, 0.0]])
        terms = Terms(*(nothing,) * 5, 0.3 * rows, speed, *(nothing,) * 3)
        known.step(np.array([[-0.15, 0.0, 0.0]]), seen, terms)
    known.solve()
    assert (abs(known.ratio[0, 0] - 1.0) > 0.05) == found

"""The cylinder against an independent solver, against theory, and against its own other faces."""

import itertools
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from skillframe_hydraulics.cylinder import equations as eq

from plugins.hydraulics.tests.test_cylinder_static import FORCE, FREE, PA, PB, parameters
from tests.unit.fmu.fmu_fakes import Swing, bank

H = 1e-3
SMALL = {"dead_volume_a": 3e-4, "dead_volume_b": 3e-4}
CASES = {
    "published": {},
    "short hoses": SMALL,
    "everything": SMALL
    | {"deadband": 0.1, "hysteresis": 0.02, "air_fraction": 0.01, "static_friction": 6000.0, "cushion_length": 0.35},
    "check valve": SMALL | {"feed_check": 1.0, "supply_pressure": 45e5},
    "counterbalance": SMALL | {"counterbalance_a": 250e5, "pilot_ratio": 2.0, "edge_at": 4.0, "deadband": 0.05},
    "unequal edges": SMALL | {"edge_pa": 0.5, "edge_pb": 0.7, "edge_at": 2.0, "edge_bt": 1.5},
}


def radau(p, y, motion, breaks, tolerance=1e-9):
    """States after a step by scipy's Radau, restarted at the kinks of the inputs."""
    one = np.ones(1)

    def f(s, state):
        x, v, demand = motion(s)
        return eq.rates(p, state[:, None], eq.PistonMotion(x * one, v * one, demand * one))[:, 0]

    for begin, end in itertools.pairwise(breaks):
        atol = [1e-11, 1e-8, 0.02, 0.02, 1e-13]
        y = solve_ivp(f, (begin, end), y, method="Radau", rtol=tolerance, atol=atol).y[:, -1]
    return y


def follow_with_radau(changes, swing, commands, hold):
    """Pressures at every step from Radau: the command's play and slew by hand, as the README has them."""
    p = parameters(**changes)
    y = eq.equilibrium(p, np.zeros(1))[:, 0]
    target = demand = 0.0
    history = []
    for k in range(len(commands) * hold):
        x, v, a = swing.at(k * H)
        u = commands[k // hold]
        target = min(max(target, u - p.hysteresis / 2), u + p.hysteresis / 2)
        way = target - demand
        arrival, turn = abs(way) / p.spool_slew, -v / a if a else -1.0
        breaks = [0.0, *sorted(t for t in (arrival, turn) if 0 < t < H), H]

        def motion(s, x=x, v=v, a=a, demand=demand, way=way, arrival=arrival):
            done = demand + way * min(s / arrival, 1.0) if arrival > 0 else demand
            return x + v * s + a * s * s / 2, v + a * s, done

        y = radau(p, y, motion, breaks)
        demand = motion(H)[2]
        history.append(y)
    return np.array(history)


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
@pytest.mark.figures
def test_pressures_agree_with_scipy_radau_within_ten_pascal(cylinder2, case):
    swing, hold = Swing(), 20
    commands = [0.0, *np.random.default_rng(0).uniform(-1, 1, 6)]
    expected = follow_with_radau(CASES[case], swing, commands, hold)
    b = bank(cylinder2, CASES[case])
    b.u[0, 1:4] = swing.at(0.0)
    b.u[0, 3] = 0.0
    b.start()
    for k, y in enumerate(expected):
        b.u[0, 0] = commands[k // hold]
        b.u[0, 1:4] = swing.at(k * H)
        assert b.step(k * H, H)
        # the issue's bound on pressures; the force then errs by area x 10 Pa plus the seals' midpoint rule
        assert abs(b.y[0, PA] - y[2]) < 10.0
        assert abs(b.y[0, PB] - y[3]) < 10.0
        assert b.y[0, 7] == pytest.approx(y[0], abs=1e-8)
    b.close()


def test_the_python_reference_and_the_fmu_agree(cylinder2, reference):
    swing, rng = Swing(), np.random.default_rng(1)
    sets = [CASES["published"], CASES["published"] | {"deadband": 0.05, "hysteresis": 0.02, "air_fraction": 0.01}]
    sets.append(CASES["unequal edges"] | {"dead_volume_a": 3e-3, "dead_volume_b": 3e-3, "feed_check": 1.0})
    sets.append(CASES["counterbalance"] | {"dead_volume_a": 3e-3, "dead_volume_b": 3e-3, "cushion_length": 0.35})
    both = [bank(cylinder2, *sets), reference(sets)]
    for b in both:
        b.u[:, 1:3] = swing.at(0.0)[:2]
        b.start()
    for k in range(150):
        command = rng.uniform(-0.5, 0.5, len(sets)) if k % 30 == 0 else both[0].u[:, 0].copy()
        for b in both:
            b.u[:, 0] = command
            b.u[:, 1:4] = swing.at(k * H)
            assert b.step(k * H, H)
        # the reference's fourth-order rule where a port's valve opens inside its step: 1e-4 of 100 bar
        np.testing.assert_allclose(both[1].y[:, [PA, PB]], both[0].y[:, [PA, PB]], atol=1000.0)
        np.testing.assert_allclose(both[1].y[:, FORCE], both[0].y[:, FORCE], atol=6.0)
        # the mean takes the speed as constant while the seals' 4 kN turn over within a step: one part in 400 of them
        np.testing.assert_allclose(both[1].y[:, 1], both[0].y[:, 1], atol=10.0)
        np.testing.assert_allclose(both[1].y[:, 2], both[0].y[:, 2], atol=2e-3)
    both[0].close()


def oscillation(facts, mass, amplitude=1e-5, seconds=2.0, h=2.5e-4):
    """Zero crossings of a mass on the closed cylinder: Gauss-Seidel coupling with the acceleration, h small."""
    b = bank(facts, FREE | SMALL | {"leakage": 0.0, "initial_force": 0.0})
    x, v, force = 0.3, amplitude * 300, 0.0
    b.u[0, 1:3] = x, v
    b.start()
    crossings = []
    for k in range(int(seconds / h)):
        a = force / mass
        b.u[0, 1:4] = x, v, a
        b.step(k * h, h)
        new = b.y[0, FORCE]
        x1 = x + v * h + h * h / 6 * (2 * a + new / mass)
        v1 = v + h / 2 * (a + new / mass)
        if x < 0.3 <= x1:
            crossings.append((k + (0.3 - x) / (x1 - x)) * h)
        x, v = x1, v1
        b.u[0, 1:3] = x, v
        b.refresh()
        force = b.y[0, FORCE]
    b.close()
    return np.diff(crossings).mean()


@pytest.mark.parametrize("mass", [6000.0, 50000.0])
def test_the_natural_frequency_is_that_of_the_oil_springs_within_half_a_percent(cylinder, mass):
    p = parameters(**SMALL)
    stiffness = 8e8 * (p.area_a**2 / (3e-4 + p.area_a * 0.3) + p.area_b**2 / (3e-4 + p.area_b * (0.59 - 0.3)))
    expected = 2 * math.pi / math.sqrt(stiffness / mass)
    assert oscillation(cylinder, mass) == pytest.approx(expected, rel=5e-3)


def test_co_simulation_in_one_long_step_equals_many_short_ones(cylinder):
    """Same parabola of motion, so only the internal integration differs."""
    ends = []
    for count in (1, 2, 7, 40):
        b = bank(cylinder, SMALL | {"spool_slew": 20.0})
        b.u[0, :4] = 0.0, 0.3, 0.1, 0.0
        b.start()
        h, a = 0.02 / count, -12.0
        work = 0.0
        for k in range(count):
            t = k * h
            b.u[0, :4] = 0.8, 0.3 + 0.1 * t + a * t * t / 2, 0.1 + a * t, a
            assert b.step(t, h)
            work += b.y[0, 2]
        ends.append([b.y[0, PA], b.y[0, PB], work])
        b.close()
    ends = np.array(ends)
    # the stated accuracy: 10 Pa; work to 10 Pa x area x path
    np.testing.assert_allclose(ends[:, :2], ends[-1, :2] * np.ones((4, 1)), atol=10.0)
    np.testing.assert_allclose(ends[:, 2], ends[-1, 2], atol=1e-2)


def test_model_exchange_through_fmpys_solver_equals_co_simulation(cylinder):
    from fmpy import simulate_fmu

    start = SMALL | {"initial_force": 2e4, "spool_slew": 20.0, "deadband": 0.02, "velocity": 0.0}
    steps = np.array([(0.0, 0.0), (0.02, 0.3), (0.05, -0.4), (0.1, 0.0)], dtype=[("time", float), ("command", float)])
    results = []
    for kind in ("CoSimulation", "ModelExchange"):
        results.append(
            simulate_fmu(
                str(cylinder.path), stop_time=0.12, step_size=H, output_interval=H, fmi_type=kind, start_values=start,
                input=steps, relative_tolerance=1e-9, output=["pressure_a", "pressure_b", "spool", "force"],
            )
        )  # fmt: skip
    cs, me = (r[np.isin(np.round(r["time"] / H), np.arange(121))] for r in results)
    at = np.linspace(0.0, 0.12, 61)[1:-1] + 0.4e-3  # between the commands' jumps, which fmpy records twice
    for name, tolerance in (("pressure_a", 2e3), ("pressure_b", 2e3), ("spool", 1e-4), ("force", 20.0)):
        a, b = (np.interp(at, r["time"], r[name]) for r in (cs, me))
        # interpolation between two recorded millisecond points is the same for both; CVode at 1e-9 x 100 bar per step
        np.testing.assert_allclose(a, b, atol=tolerance, err_msg=name)


@pytest.mark.slow
@pytest.mark.parametrize("air", [0.0, 0.01])
@pytest.mark.figures
def test_energy_is_balanced_over_six_seconds_with_oil_and_motion_as_state_functions(air):
    """A mass on the cylinder: what supply, return and load bring in is what oil and motion store and friction takes."""
    p = parameters(
        **SMALL, air_fraction=air, leakage=0.0, initial_force=2e4, relief_conductance=0.0, check_conductance=0.0
    )
    mass, load, one = 3000.0, 2e4, np.ones(1)
    soft = Softness(p)

    def f(t, s):
        x, v, cylinder = s[0] * one, s[1] * one, s[2:7, None]
        u = 0.06 * np.sin(2 * math.pi * t / 3.0) * one
        rates = eq.rates(p, cylinder, eq.PistonMotion(x, v, u))[:, 0]
        flows = eq.valve_flows(p, *cylinder[[0, 2, 3]], p.supply_pressure, x)
        force = eq.piston_force(p, cylinder, x, v)[0]
        lost = eq.friction_force(p, cylinder[4], v)[0] * v[0]
        brought = sum(q[0] * (s[i] + soft.energy(s[i])) for q, i in ((flows.a, 4), (flows.b, 5)))
        return [v[0], (force - load) / mass, *rates, brought, lost]

    y = eq.equilibrium(p, np.zeros(1))[:, 0]
    start = np.array([0.3, 0.0, *y, 0.0, 0.0])
    atol = [1e-12, 1e-11, 1e-11, 1e-9, 1e-2, 1e-2, 1e-14, 1e-6, 1e-6]
    end = solve_ivp(f, (0.0, 6.0), start, method="Radau", rtol=1e-9, atol=atol, max_step=0.01).y[:, -1]

    def stored(s):
        volumes = 3e-4 + p.area_a * s[0], 3e-4 + p.area_b * (p.stroke - s[0])
        oil = sum(volume * soft.energy(s[i]) for volume, i in zip(volumes, (4, 5), strict=True))
        return oil + mass * s[1] ** 2 / 2 + load * s[0]

    moved = abs(end[7]) + end[8] + abs(stored(end) - stored(start))
    # 1e-6 of the energy that moved is the bound; Radau at 1e-9 and the table of the oil's energy stay below it
    assert abs(stored(end) - stored(start) - end[7] + end[8]) < 1e-6 * moved
    assert end[8] > 100.0  # friction has taken something worth balancing


def oil_energy(p, pressure, points=2001):
    r"""Elastic energy of oil per volume [J/m3], a state function: \(\rho(p) \int_0^p \pi / (\rho B)\, d\pi\).

    With \(d\rho/\rho = dp/B\). For a constant B this is \(B e^{p/B} - B - p\).
    """
    grid = np.linspace(0.0, pressure, points)
    soft = 1.0 / eq.bulk_modulus(grid, p)
    step = grid[1] - grid[0]
    log_density = np.concatenate([[0.0], np.cumsum(0.5 * step * (soft[1:] + soft[:-1]))])
    return float(np.trapezoid(grid * soft * np.exp(log_density[-1] - log_density), dx=step))


class Softness:
    """The oil's energy per volume at a pressure: in closed form without air, else `oil_energy` as a smooth table."""

    def __init__(self, p):
        from scipy.interpolate import CubicSpline

        b = float(p.bulk_modulus)
        if p.air_fraction == 0:
            self.energy = lambda x: b * np.expm1(x / b) - x
            assert oil_energy(p, 2e7) == pytest.approx(self.energy(2e7), rel=1e-6)
        else:
            grid = np.geomspace(1e3, 300e5, 400)
            self.energy = CubicSpline(grid, [oil_energy(p, x, points=20001) for x in grid])

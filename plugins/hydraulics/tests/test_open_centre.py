"""A pump of open-centre valves: one integration of everything, closed forms, refusals, and a machine on a path."""

import dataclasses

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from skillframe_hydraulics.cylinder import equations as eq
from skillframe_hydraulics.declared import impossible_supplies
from skillframe_hydraulics.entry import told
from skillframe_hydraulics.law.line_ahead import BEGIN, STILL, inverse_ahead, known_lines
from skillframe_hydraulics.law.vdc_actuator import CYLINDER, Cylinders, chamber_lengths, cylinders, inverse_valve
from skillframe_papers.rows.crane_runs import MOVING, Follow, blend, scene

from plugins.hydraulics.tests.test_cylinder_static import parameters
from plugins.hydraulics.tests.test_supply import COMMANDS, CONSTANT, LOAD, MASS, OWN, RATED, Coupled, H, of_volume
from skillframe.execution.executor import Setup, simulate
from skillframe.execution.prepare import load_robot_model
from skillframe.extend.drives import audit
from skillframe.robot.chain import ClosedChain
from skillframe.robot.spec import load_robot
from tests.excavator import write_excavator

OUTLET, DROP, SHUT = OWN["return_pressure"], 12e5, 0.6
CHECKED = OWN | {"feed_check": 1.0}
FLOW = float(CONSTANT.flow[0])
CENTRE = CONSTANT._replace(drop=np.array([DROP]), shut=np.array([SHUT]), outlet=np.array([OUTLET]))


def root(drop):
    """The root of a drop, linear below 1 bar, of (1) in `skillframe_hydraulics.open_centre`."""
    return drop / (drop**2 + 1e10) ** 0.25


def one_system(lines, end):
    """The rows of `Coupled` by Radau, every millisecond: masses, oil and line, with the centre edges one by one."""
    p, softness = parameters(**CHECKED, initial_force=LOAD), float(lines.softness[0])
    y = np.concatenate([np.full(2, 0.2), np.zeros(2), eq.equilibrium(p, np.zeros(2)).ravel(), [OUTLET + DROP]])
    edge = FLOW / root(DROP) * np.sqrt(2.0)  # of one of two: in series they pass FLOW at DROP
    history = []
    for i, (begin, command) in enumerate(COMMANDS):
        u = np.array(command)
        stop = COMMANDS[i + 1][0] if i + 1 < len(COMMANDS) else end

        def f(time, y, u=u):
            x, v, oil, line = y[:2], y[2:4], y[4:14].reshape(5, 2), y[14]
            oil_rates = eq.rates(p, oil, eq.PistonMotion(x, v, u, supply_drop=RATED - line))
            taken = eq.valve_flows(p, oil[0], oil[2], oil[3], line, x).supply.sum()
            left, right = np.maximum(1.0 - np.abs(oil[0]) / SHUT, 1e-6)
            through = edge * left * right / np.hypot(left, right) * root(line - OUTLET)
            relief = FLOW / (0.1 * RATED) * max(line - RATED, 0.0)
            a = (eq.piston_force(p, oil, x, v) - LOAD) / MASS
            return np.concatenate([v, a, oil_rates.ravel(), [(FLOW - taken - through - relief) / softness]])

        at = np.arange(round(begin / H) + 1, round(stop / H) + 1) * H
        atol = [1e-10] * 4 + [1e-9] * 4 + [1.0] * 4 + [1e-11] * 2 + [1.0]
        found = solve_ivp(f, (begin, at[-1]), y, method="Radau", t_eval=at, rtol=1e-8, atol=atol, max_step=5e-3)
        history.append(found.y.T)
        y = found.y[:, -1]
    return np.concatenate(history)[:, [0, 1, 8, 9, 10, 11, 14]]


@pytest.mark.slow
@pytest.mark.parametrize("litres", [20.0, pytest.param(10.0, marks=pytest.mark.figures)])
def test_cylinders_line_and_centres_are_one_integration_of_all_within_a_tenth_of_a_bar_and_of_a_millimetre(litres):
    lines = of_volume(CENTRE, litres)
    expected = one_system(lines, 0.65)
    errors = []
    for step in (H, H / 2):
        every = round(H / step)
        off = np.abs(Coupled(lines, step, own=CHECKED).rows[every - 1 :: every, :7] - expected)
        errors.append((off[:, :2].max(), off[:, 2:].max()))
    assert errors[0][0] < 1e-4
    assert errors[0][1] < 0.1e5
    assert errors[1][1] < 0.4 * errors[0][1]


WIDE = CHECKED | {"rated_flow": 6e-3}


@pytest.mark.parametrize("litres", [20.0, 5.0, 2.0, 1.0, 0.5])
@pytest.mark.parametrize("own", [CHECKED, WIDE])
def test_a_line_of_open_centres_settles_at_a_millisecond_whatever_its_volume(own, litres):
    """Second differences of the pressure once the valves have stood for 0.2 s: what is left is no swing of the step."""
    found = Coupled(of_volume(CENTRE, litres), end=0.4, commands=((0.0, (0.0, 0.0)), (0.05, (0.5, 0.4))), own=own)
    pressure = found.rows[:, 6]
    assert np.abs(np.diff(pressure, 2)[-150:]).max() < 0.2e5
    assert 0.0 < pressure.min() <= pressure.max() <= 1.1 * RATED
    assert found.supplies.taken[0, 0] > 1e-4


@pytest.mark.parametrize("litres", [5.0, 0.5])
def test_a_large_pump_settles_through_open_centres_whatever_the_volume(litres):
    """360 l/min through the centres: of half a litre B H / V times the bypass's slope is 6, and a held flow swings."""
    lines = of_volume(CENTRE._replace(flow=np.array([6e-3])), litres)
    found = Coupled(lines, end=0.5, commands=((0.0, (0.3, 0.2)), (0.1, (0.0, 0.0))), own=CHECKED)
    assert np.abs(np.diff(found.rows[-100:, 6], 2)).max() < 1e3
    assert found.rows[-1, 6] == pytest.approx(OUTLET + DROP, rel=1e-3)


def test_with_all_spools_in_their_middle_the_line_has_the_declared_drop_which_is_what_a_standing_machine_wastes():
    found = Coupled(CENTRE, end=0.8, commands=((0.0, (0.5, 0.4)), (0.2, (0.0, 0.0))), own=CHECKED)
    assert found.rows[:200, 6].max() > 50e5
    assert found.rows[-1, 6] == pytest.approx(OUTLET + DROP, rel=1e-6)
    still = Coupled(CENTRE, end=0.3, commands=((0.0, (0.0, 0.0)),), own=CHECKED).supplies
    wasted = (OUTLET + DROP) * FLOW * 0.3
    np.testing.assert_allclose([still.given, still.wasted], wasted, rtol=1e-9)
    assert still.waste(0) == [
        f"supply main: {wasted / 1e3:.3g} kJ of its pump's {wasted / 1e3:.3g} kJ went to the return line through open"
        " centres and relief"
    ]
    assert still.said(0) == []


def test_a_spool_narrows_the_centre_by_what_is_left_of_its_edge_and_no_load_moves_below_its_pressure():
    """o = 5/6 of one of two edges of equal drops: the drop is (1 + 1.44) / 2 of that in the middle, but for e."""
    found = Coupled(CENTRE, end=0.6, commands=((0.0, (SHUT / 6.0, 0.0)),), own=CHECKED)
    assert root(found.rows[-1, 6] - OUTLET) == pytest.approx(np.sqrt(1.22) * root(DROP), rel=1e-5)
    assert found.rows[-1, 6] < found.rows[-1, 2]
    np.testing.assert_allclose(found.supplies.taken, 0.0, atol=1e-12)


def test_with_one_valve_fully_open_all_of_the_pumps_flow_goes_to_its_actuator():
    found = Coupled(CENTRE, end=0.6, commands=((0.0, (1.0, 0.0)),), own=CHECKED)
    speed = (found.rows[-1, 0] - found.rows[-101, 0]) / (100 * H)
    area = float(np.ravel(parameters(**CHECKED, initial_force=LOAD).area_a)[0])
    assert speed == pytest.approx(FLOW / area, rel=2e-3)  # the mass still swings a little on its oil
    assert found.supplies.said(0)[0].startswith("supply main: its pump gave all it can for ")


def test_the_relief_of_open_centres_opens_at_the_supply_pressure_and_passes_all_of_the_flow_a_tenth_above():
    supplies = Coupled(CENTRE, end=H, commands=((0.0, (0.0, 0.0)),), own=CHECKED).supplies
    for share in (0.0, 0.5, 1.0):
        flow, _ = supplies._relieves(np.full((1, 1), (1.0 + 0.1 * share) * RATED))
        assert flow[0, 0] == pytest.approx(share * FLOW, abs=1e-12)


PUMP = 'kind = "open_centre"\nflow = "300 l/min"\nvolume = "10 l"\n'


@pytest.fixture
def excavator(tmp_path):
    """The excavator with load check valves and a pump of open centres: its folder."""

    def made(text=PUMP, check="true"):
        folder = write_excavator(tmp_path / "excavator")
        file = folder / "robot.toml"
        own = file.read_text(encoding="utf-8").replace("leakage =", f"feed_check = {check}, leakage =")
        file.write_text(f"{own}\n[supply.main]\n{text}", encoding="utf-8")
        return folder

    return made


@pytest.mark.parametrize(
    ("text", "check", "said"),
    [
        (PUMP, "false", "main: has open centres, and without a load check valve a load sinks into its line: slew"),
        (PUMP + 'centre_drop = "12 kPa"', "true", "main.centre_drop: 12 kPa is beyond 1bar to 100bar"),
        (PUMP + "centre_shut = 0.1", "true", "main.centre_shut: 0.1 is beyond 0.2 to 1"),
        (PUMP.replace("300", "30"), "true", "its pump gives 9.94 % of the flow of the swing that identifies it"),
    ],
)  # fmt: skip
def test_open_centres_that_cannot_work_are_refused_by_check_with_what_to_do(excavator, text, check, said):
    messages = [f"{each.message}; {each.fix}" for each in audit(load_robot(excavator(text, check))).problems]
    assert any(said in message for message in messages), messages


def test_a_bypass_above_the_relief_and_a_foreign_actuator_without_its_spool_are_refused(excavator):
    spec = load_robot(excavator())
    assert list(impossible_supplies(spec)) == []
    low = [dataclasses.replace(a, parameters={**a.parameters, "supply_pressure": 16e5}) for a in spec.actuation]
    assert [each[:2] for each in impossible_supplies(dataclasses.replace(spec, actuation=tuple(low)))] == [
        ("supply.main.centre_drop", "and the return_pressure are 17 bar, and its relief opens at 16 bar")
    ]
    first, *rest = spec.actuation
    mapped = {"flow_supply": "q", "supply_slope": "s", "force": "F"}
    foreign = dataclasses.replace(first, fmu="theirs.fmu", inputs={"supply_drop": "d"}, outputs=mapped)
    assert [each[1] for each in impossible_supplies(dataclasses.replace(spec, actuation=(foreign, *rest)))] == [
        "the FMU of slew has no spool, by which a line feeds it"
    ]


def test_show_says_what_goes_through_the_centres_while_nothing_moves(excavator):
    """300 l/min at 12 bar above a return line of 5 bar: 8.5 kW."""
    lines, plain = told(load_robot(excavator()))
    assert lines[-1].startswith("  supply main: open-centre pump of 300 l/min, line of 10 l, feeds slew, boom_left")
    assert lines[-1].endswith("; 8.5 kW go through its open centres while nothing moves")
    assert plain["supply"]["main"]["centre_drop"] == 12e5


def law_of_lines(spec, lines):
    """Openings (k,) of demand, piston, velocity, required velocity, pressures a and b, and measured supply."""
    c = cylinders(spec.actuation)
    own = Cylinders(**{name: ca.SX(ca.DM(getattr(c, name))) for name in CYLINDER})
    given = [ca.SX.sym(f"given{i}", len(c.area_a)) for i in range(7)]
    opened = inverse_ahead(lines, own, tuple(given[:4]), tuple(given[4:6]), given[6], ca.SX(ca.DM(c.deadband)))
    found = ca.Function("law", given, [opened])
    return c, lambda *rows: np.array(found(*rows)).ravel()


def test_the_law_opens_its_valves_where_flows_and_centres_take_what_the_pump_gives(excavator):
    """Openings are chosen, and with them the pump's flow and the demands: the law finds them again."""
    spec = load_robot(excavator())
    at, u = 180e5, np.array([0.2, 0.9, 0.9, -0.3, 0.0])
    p_a, p_b, x = np.array([60, 150, 150, 20, 30]) * 1e5, np.array([40, 15, 15, 130, 60]) * 1e5, np.full(5, 0.4)
    c = cylinders(spec.actuation)
    into = np.abs(u) * c.edge * root(at - np.where(u > 0.0, p_a, p_b))
    share = root(at - 5e5) / root(12e5) / np.sqrt(np.mean((1.0 - np.abs(u)) ** -2.0))
    lines = known_lines(spec)
    lines = lines._replace(flow=np.array([into.sum() / (1.0 - share)]))
    c, law = law_of_lines(spec, lines)
    length_a, length_b = chamber_lengths(c, x)
    drained = np.abs(u) * c.edge * root(np.where(u > 0.0, p_b, p_a) - 5e5)
    first, last = np.where(u > 0.0, (length_a, length_b), (length_b, length_a))
    demand = np.sign(u) * (into / first + drained / last)
    moving = np.full(5, 1.0)
    np.testing.assert_allclose(
        law(demand, x, 0.0 * x, moving, p_a, p_b, np.full(5, at)), u, atol=1e-4
    )  # bisection to 6e-3 bar
    # a line that measures 20 bar less is believed on its way, and valves open wider
    wider = np.abs(law(demand, x, 0.0 * x, moving, p_a, p_b, np.full(5, at - 20e5)))
    assert np.all(wider[:4] > np.abs(u[:4]) * (1.0 + 3e-4))


def test_the_law_shuts_the_centre_for_a_small_flow_and_opens_nothing_below_a_required_speed(excavator):
    """A drained chamber, a load of 150 bar and 5 l/min, of one of five valves of equal edges: the others stay open.

    1/o^2 = 5 (145 bar / drop) - 4 with all of 300 l/min through the centre. STILL takes a part of the demand.
    """
    spec = load_robot(excavator())
    c, law = law_of_lines(spec, known_lines(spec))
    p_a, p_b, x = np.full(5, 150e5), np.full(5, 5e5), np.full(5, 0.4)
    demand = np.array([0.0, 5e-3 / 60 / chamber_lengths(c, x)[0][1], 0.0, 0.0, 0.0])
    u = law(demand, x, 0.0 * x, np.full(5, 1.0), p_a, p_b, np.full(5, 150.2e5))
    needed = 1.0 - 1.0 / np.sqrt(5.0 * (root(145e5) / root(12e5)) ** 2 - 4.0)
    assert u[1] == pytest.approx(needed, abs=0.01)
    assert np.abs(u[[0, 2, 3, 4]]).max() == 0.0
    # from the pressure of a standing machine the line has to fill in T besides
    rising = law(demand, x, 0.0 * x, np.full(5, 1.0), p_a, p_b, np.full(5, 17e5))
    assert needed < rising[1] < 1.0
    held = inverse_valve(c, demand, x, (p_a, p_b), np.full(5, 17e5))
    assert held[1] < 0.2 * needed  # at the measured pressure nothing would ever move
    still = law(demand, x, 0.0 * x, np.full(5, BEGIN), p_a, p_b, np.full(5, 17e5))
    np.testing.assert_array_equal(still, 0.0)


def test_an_emptied_chamber_makes_no_force_by_filling(excavator):
    """At 1 bar below the return line only what drains counts, of the demand less the emptied chamber's motion."""
    spec = load_robot(excavator())
    c, law = law_of_lines(spec, known_lines(spec))
    p_a, p_b, x, speed = np.full(5, 4e5), np.full(5, 65e5), np.full(5, 0.4), np.full(5, 0.05)
    length_a, length_b = chamber_lengths(c, x)
    u = np.full(5, 0.1)
    demand = u * c.edge * root(60e5) / length_b + c.area_a * speed / length_a
    got = law(demand, x, speed, np.full(5, 1.0), p_a, p_b, np.full(5, 100e5))
    np.testing.assert_allclose(got, u, rtol=1e-6)
    assert root(60e5) > STILL


def run_line(folder, seconds=4.0, way=(0.4, 0.8, -0.4), draws=None):
    """The excavator's tool on a line, of 1 m by default: the result, and its distances from that line [m]."""
    way = np.array(way)

    def path(time):
        value, rate = blend(time / seconds)
        return value * way, rate / seconds * way

    robot = load_robot_model(str(folder))
    chain = ClosedChain(robot)
    tip = chain.at(chain.minimal(chain.home), np.zeros(4)).data.oMf[chain.robot.tool_frames[0]].translation
    setup = Setup(robot=robot, scene=scene(tip - np.array([5.0, 0.0, 0.0]), plate=False))
    rngs = [np.random.default_rng(5 + i) for i in range(len(next(iter((draws or {"": [0]}).values()))))]
    found = simulate(Follow(path, MOVING), setup, draws or {}, rngs, duration_s=seconds + 1.5, trace_hz=100.0)
    gone = found.traces[0].position - found.traces[0].position[0]
    along = way / np.linalg.norm(way)
    return found, np.linalg.norm(gone - np.outer(gone @ along, along), axis=1)


@pytest.mark.slow
def test_a_machine_of_open_centres_follows_a_path_from_standstill(excavator):
    """Where the measured pressure is inverted, the tool is 40 mm off. The pump's energy is in trace and note."""
    found, off = run_line(excavator())
    trace = found.traces[0]
    assert found.reason[0].startswith("time limit")
    assert off.max() < 12e-3
    machine = trace.machine
    assert machine["line_pressure"].min() == pytest.approx(17e5, abs=1.5e5)
    assert machine["line_pressure"].max() > 100e5
    np.testing.assert_allclose(machine["pump_flow"], 300e-3 / 60.0, rtol=1e-12)
    given = np.trapezoid((machine["line_pressure"] * machine["pump_flow"])[:, 0], trace.time)
    note = next(
        each for each in trace.meta["notes"] if each.startswith("supply main: ") and " kJ of its pump's " in each
    )
    wasted, total = (float(note.split(word)[1].split(" kJ")[0]) * 1e3 for word in ("main: ", "pump's "))
    assert total == pytest.approx(given, rel=0.02)
    taken = machine["energy_supply"][-1] - machine["energy_supply"][0]
    # what is left is stored in the line, 10 l at 141 bar at most
    assert wasted + taken == pytest.approx(total, rel=0.02)


@pytest.mark.slow
@pytest.mark.figures
@pytest.mark.parametrize(("kind", "most", "rms"), [("constant", 3e-3, 1e-3), ("load_sensing", 5e-3, 2e-3)])
def test_the_same_line_with_other_pumps(excavator, kind, most, rms):
    """Beside the 12 mm of open centres: docs/how-to/own-crane.md."""
    found, off = run_line(excavator(PUMP.replace("open_centre", kind)))
    assert found.reason[0].startswith("time limit")
    assert off.max() < most
    assert np.sqrt(np.mean(off**2)) < rms


@pytest.mark.slow
@pytest.mark.figures
def test_a_small_pump_of_open_centres_slows_the_path_down(excavator):
    """0.9 m/s need 260 of 160 l/min, at 0.57 of the speed."""
    found, off = run_line(excavator(PUMP.replace("300", "160") + "centre_shut = 0.7\n"), seconds=2.0)
    assert found.reason[0].startswith("time limit")
    assert off.max() < 15e-3
    assert 0.4 < found.traces[0].machine["pace"].min() < 0.65


@pytest.mark.slow
@pytest.mark.figures
@pytest.mark.parametrize(("encoder", "most"), [(1e-4, 25e-3), (1e-5, 14e-3)])
def test_a_boom_that_lifts_slowly_is_late_by_what_encoders_scatter(excavator, encoder, most):
    folder = excavator(f"{PUMP}centre_shut = 0.7\n[sensors]\nencoder = {encoder}\n")
    found, off = run_line(folder, seconds=3.0, way=(-0.8, 0.0, 0.0))
    assert found.reason[0].startswith("time limit")
    assert off.max() < most

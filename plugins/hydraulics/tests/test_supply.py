"""A pump and its line in the co-simulation, against one integration of everything, and what robot.toml may say."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from skillframe_hydraulics.compensation import HELD, OPEN
from skillframe_hydraulics.cylinder import equations as eq
from skillframe_hydraulics.cylinder.bank import open_cylinders
from skillframe_hydraulics.declared import DeclaredSupply, impossible_supplies, supplies_of
from skillframe_hydraulics.entry import told
from skillframe_hydraulics.law.hydraulic import Measured, Reference, Terms
from skillframe_hydraulics.lines import Lines
from skillframe_hydraulics.sharing import FlowSharing
from skillframe_hydraulics.supply import NEEDED_IN, NEEDED_OUT, Supplies
from skillframe_papers.rows.crane_runs import MOVING, Follow, blend, scene

from plugins.hydraulics.tests.test_cylinder_static import parameters
from skillframe.cosim import CosimSettings, Master, Motion
from skillframe.errors import InputError
from skillframe.execution.executor import Setup, simulate
from skillframe.execution.prepare import load_robot_model
from skillframe.extend.drives import audit
from skillframe.fmu.actuator import INPUTS, OUTPUTS, ActuatorSpec
from skillframe.frames import Pose
from skillframe.robot.chain import ClosedChain
from skillframe.robot.spec import load_robot
from skillframe.skill import Command, Impedance, no_reasons
from tests.excavator import write_excavator

H, RATED, BULK, RESPONSE = 1e-3, 200e5, 1.2e9, 0.06
MASS, LOAD = np.array([2000.0, 3000.0]), np.array([4e4, 2e4])
OWN = {
    "dead_volume_a": 1e-3, "dead_volume_b": 1e-3, "bulk_modulus": BULK, "supply_pressure": RATED, "leakage": 0.0,
    "return_pressure": 5e5, "spool_slew": 0.0, "relief_pressure": 350e5, "laminar_pressure": 1e5,
}  # fmt: skip
COMMANDS = ((0.0, (0.0, 0.0)), (0.05, (0.5, 0.3)), (0.35, (0.5, 0.05)), (0.6, (0.0, -0.2)))
END = 0.65
CONSTANT = Lines(
    ("main",), np.ones((1, 2)), np.array([6e-4]), np.array([np.inf]), np.array([np.inf]), np.array([RESPONSE]),
    np.array([5e-3 / BULK]),
)  # fmt: skip
SENSING = CONSTANT._replace(margin=np.array([20e5]), flow=np.array([1.2e-3]))


def of_volume(lines, litres):
    return lines._replace(softness=np.array([1e-3 * litres / BULK]))


class Masses:
    """Two masses that their cylinders lift, one each: x'' = (F - load) / mass, exact for a force linear in time."""

    count = 2

    def __init__(self):
        self.x, self.v = np.full(2, 0.2), np.zeros(2)

    def motion(self, force):
        return Motion(self.x, self.v, (force - LOAD) / MASS)

    def advance(self, begin, end, step):
        a, b = (begin - LOAD) / MASS, (end - LOAD) / MASS
        self.x = self.x + step * self.v + step**2 / 6.0 * (2.0 * a + b)
        self.v = self.v + 0.5 * step * (a + b)


def command_at(time, commands=COMMANDS):
    return np.array(next(u for begin, u in reversed(commands) if time >= begin - 1e-9))


class Coupled:
    """Rows (x, x, p_a, p_a, p_b, p_b, p_S, Q) at every step, and energies [J] and volumes [m3] of the line."""

    def __init__(self, lines, step=H, end=END, commands=COMMANDS, own=OWN):
        inputs = {name: name for name in (*INPUTS, NEEDED_IN, *((HELD,) if lines.compensated else ()))}
        outputs = {name: name for name in (*OUTPUTS, *NEEDED_OUT)}
        spec = ActuatorSpec(fmu="hydraulic_cylinder", parameters=own, inputs=inputs, outputs=outputs, name="c")
        self.bank, plant = open_cylinders([spec] * 2), Masses()
        master = Master(plant, self.bank, CosimSettings(step=step))
        master.start(0.0, 0.0, [{"initial_force": load} for load in LOAD])
        self.supplies = s = Supplies(lines, self.bank, np.full((1, 2), RATED), np.zeros((1, 2)), step)
        pressures = [self.bank.outputs.index(f"pressure_{side}") for side in "ab"]
        rows, self.given, self.left, self.work = [], 0.0, 0.0, []
        for k in range(round(end / step)):
            before = s.pressure[0, 0], s.flow[0, 0], s.taken[0, 0] + s.relieved[0, 0]
            s.begin()
            assert master.step(command_at(k * step, commands))
            s.end()
            after = s.pressure[0, 0], s.flow[0, 0], s.taken[0, 0] + s.relieved[0, 0]
            self.given += 0.5 * step * (before[1] + after[1])
            self.left += 0.5 * step * (before[2] + after[2])
            power = [p * (q - taken) for p, q, taken in (before, after)]
            self.work.append(0.5 * step * sum(power))
            rows.append([*plant.x, *self.bank.y[:, pressures].T.ravel(), *after[:2]])
        self.rows = np.array(rows)
        self.bank.close()


def one_system(lines, end=END):
    """The same rows by Radau, every millisecond: masses, oil, line and pump, equations (1) and (2) written again."""
    p = parameters(**OWN, initial_force=LOAD)
    softness, flow, margin = float(lines.softness[0]), float(lines.flow[0]), float(lines.margin[0])
    y = np.concatenate([np.full(2, 0.2), np.zeros(2), eq.equilibrium(p, np.zeros(2)).ravel(), [0.0, 0.0]])
    y[14] = min(RATED, y[4:14].reshape(5, 2)[2:4].max() + margin)
    history = []
    for i, (begin, command) in enumerate(COMMANDS):
        u = np.array(command)
        stop = COMMANDS[i + 1][0] if i + 1 < len(COMMANDS) else end

        def f(time, y, u=u):
            x, v, oil, line, pump = y[:2], y[2:4], y[4:14].reshape(5, 2), y[14], y[15]
            drop = RATED - line
            oil_rates = eq.rates(p, oil, eq.PistonMotion(x, v, u, supply_drop=drop))
            taken = eq.valve_flows(p, oil[0], oil[2], oil[3], line, x).supply.sum()
            fed = np.where(np.abs(oil[0]) > OPEN, np.where(oil[0] > 0.0, oil[2], oil[3]), 0.0)
            goal = min(RATED, fed.max() + margin)
            limit = min(flow, float(lines.power[0]) / line)
            asked = min(max(taken + softness / (2.0 * RESPONSE) * (goal - line), 0.0), limit)
            relief = flow / (0.1 * RATED) * max(line - 1.1 * RATED, 0.0)
            a = (eq.piston_force(p, oil, x, v) - LOAD) / MASS
            return np.concatenate(
                [v, a, oil_rates.ravel(), [(pump - taken - relief) / softness, (asked - pump) / RESPONSE]]
            )

        at = np.arange(round(begin / H) + 1, round(stop / H) + 1) * H
        atol = [1e-10] * 4 + [1e-9] * 4 + [1.0] * 4 + [1e-11] * 2 + [1.0, 1e-12]
        found = solve_ivp(f, (begin, at[-1]), y, method="Radau", t_eval=at, rtol=1e-8, atol=atol, max_step=5e-3)
        history.append(found.y.T)
        y = found.y[:, -1]
    return np.concatenate(history)[:, [0, 1, 8, 9, 10, 11, 14, 15]]


@pytest.mark.slow
@pytest.mark.parametrize(("lines", "litres"), [(CONSTANT, 5.0), pytest.param(SENSING, 20.0, marks=pytest.mark.figures)])
def test_cylinders_line_and_pump_are_one_integration_of_all_within_a_tenth_of_a_bar_and_of_a_millimetre(lines, litres):
    """Two functions at once, a pump that is too small for both, and one that follows the load. Second order in H."""
    lines = of_volume(lines, litres)
    expected = one_system(lines)
    errors = []
    for step in (H, H / 2):
        every = round(H / step)
        off = np.abs(Coupled(lines, step).rows[every - 1 :: every] - expected)
        errors.append((off[:, :2].max(), off[:, 2:7].max()))
    assert errors[0][0] < 1e-4
    assert errors[0][1] < 0.1e5
    assert errors[1][1] < 0.4 * errors[0][1]  # 0.25 for the order alone; the largest load changes between two steps


WIDE = OWN | {"rated_flow": 6e-3}
"""Valves whose slope makes B H s / V three to eight with half a litre, where flows held over a step swing."""


@pytest.mark.parametrize("litres", [20.0, 5.0, 2.0, 1.0, 0.5])
@pytest.mark.parametrize("lines", [CONSTANT, SENSING])
def test_a_line_of_any_volume_settles_at_a_millisecond(lines, litres):
    """Second differences of the pressure once the valves have stood for 0.2 s: what is left is no swing of the step."""
    found = Coupled(of_volume(lines, litres), end=0.4, commands=((0.0, (0.0, 0.0)), (0.05, (1.0, 0.8))), own=WIDE)
    pressure = found.rows[:, 6]
    assert np.abs(np.diff(pressure, 2)[-150:]).max() < 0.2e5
    assert 0.0 < pressure.min() <= pressure.max() <= 1.2 * RATED
    assert found.supplies.taken[0, 0] > 1e-4


@pytest.mark.parametrize("litres", [20.0, 2.0])
def test_oil_and_energy_of_a_line_balance(litres):
    """What the pump gives is what is taken and what the line stores; its power less theirs is that of V p^2 / 2 B."""
    found = Coupled(of_volume(CONSTANT, litres), end=0.7)
    softness, end = 1e-3 * litres / BULK, found.rows[-1, 6]
    assert found.given > 2e-4
    # the step's residual and the trapezoidal rule, of second order
    assert found.given - found.left == pytest.approx(softness * (end - RATED), abs=1e-3 * found.given)
    stored = 0.5 * softness * (end**2 - RATED**2)
    assert sum(found.work) == pytest.approx(stored, abs=1e-3 * found.given * RATED)


def test_a_pump_that_is_full_says_so_and_for_how_long():
    found = Coupled(of_volume(CONSTANT, 5.0), end=0.6)
    rows, supplies = found.rows, found.supplies
    full = rows[:, 7] >= 0.98 * CONSTANT.flow[0]
    assert full.sum() > 100
    assert supplies.full[0, 0] == pytest.approx(H * full.sum())
    assert supplies.first[0, 0] == pytest.approx(H * (1 + np.argmax(full)))
    assert supplies.lowest[0, 0] == rows[full, 6].min()
    first = supplies.first[0, 0]
    assert supplies.said(0)[0].startswith(f"supply main: its pump gave all it can for {H * full.sum():.2f} s of 0.60 s")
    assert f"first at {first:.3f} s, and its line fell to {rows[full, 6].min() / 1e5:.0f} bar" in supplies.said(0)[0]
    assert Coupled(of_volume(SENSING, 5.0), end=0.3).supplies.said(0) == []


def test_a_pump_gives_no_more_than_its_power_at_the_lines_pressure():
    found = Coupled(CONSTANT._replace(power=np.array([4e3])), end=0.6)
    power = found.rows[:, 6] * found.rows[:, 7]
    assert power.max() == pytest.approx(4e3, rel=0.02)  # the limit is that of the pressure a step before
    assert (power > 0.98 * 4e3).sum() > 100


def test_a_load_sensing_pump_keeps_its_margin_above_the_largest_load_that_is_fed_and_a_relief_opens_above_the_rest():
    found = Coupled(of_volume(SENSING, 5.0), end=0.6, commands=((0.0, (0.0, 0.0)), (0.05, (0.05, 0.03))))
    assert found.rows[-1, 6] - found.rows[-1, 2:4].max() == pytest.approx(20e5, rel=0.02)
    found.supplies.pressure[:] = 1.15 * RATED
    flow, slope = found.supplies._relieves(found.supplies.pressure)
    np.testing.assert_allclose(flow[0], 0.5 * SENSING.flow, rtol=1e-12)
    np.testing.assert_allclose(slope[0], 2.0 * CONSTANT.flow / (0.1 * RATED), rtol=1e-12)


def test_a_line_counts_what_it_feeds_alone_and_an_actuator_beside_it_may_not_tell_its_flow():
    twice = {key: np.repeat(getattr(CONSTANT, key), 2) for key in Lines._fields[2:]}
    y = np.array([[1e-4, 1e-11, 0.0, 5e6, 5e6], [2e-4, 2e-11, 0.0, 5e6, 5e6], [np.nan, np.nan, 0.0, 5e6, 5e6]])
    names = [*NEEDED_OUT, "spool", "pressure_a", "pressure_b"]
    bank = SimpleNamespace(inputs=[NEEDED_IN], outputs=names, u=np.zeros((3, 1)), y=y)
    supplies = Supplies(Lines(("a", "b"), np.eye(2, 3), **twice), bank, np.full((1, 3), RATED), np.zeros((1, 3)), H)
    np.testing.assert_array_equal(np.concatenate(supplies._sums()), [[1e-4, 2e-4], [1e-11, 2e-11]])


@pytest.fixture
def excavator(tmp_path):
    """The excavator with a pump: its folder."""

    def made(text, name="excavator"):
        folder = write_excavator(tmp_path / name)
        with (folder / "robot.toml").open("a", encoding="utf-8") as file:
            file.write(f"\n[supply.main]\n{text}\n")
        return folder

    return made


FITS = 'flow = "400 l/min"\nvolume = "20 l"\n'


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("flow = 400\nvolume = 0.02", "main.flow: 400 m3/s is beyond 1.66667e-05m3/s to 0.1m3/s; did you mean 400l"),
        ('flow = "400 l/min"\nvolume = 20', "main.volume: 20 m3 is beyond 5e-05m3 to 0.5m3; did you mean 20l?"),
        (FITS + "power = 90", "main.power: 90 W is beyond 100W to 2e+06W; did you mean 90kW?"),
        (FITS + "response = 60", "main.response: 60 s is beyond 1ms to 2s; did you mean 60ms?"),
        ('flow = "400 l/min"', "main: missing volume"),
        (FITS + "feeds = ['boom']", "main.feeds: unknown joint of an [[actuation]] 'boom'; did you mean 'boom_left"),
        (FITS + "[supply.b]\n" + FITS, "b.feeds: both it and supply.main feed slew; say under feeds of each"),
        (FITS + "kind = 'open'", "main.kind: unknown value 'open'"),
        ('flow = "1 l/min"\nvolume = "20 l"', "its pump gives 0.331 % of the flow of the swing that identifies it"),
    ],
)  # fmt: skip
def test_a_supply_that_cannot_be_is_refused_by_check_and_run_with_what_it_takes(excavator, text, said):
    folder = excavator(text)
    messages = [f"{each.message}; {each.fix}" for each in audit(load_robot(folder)).problems]
    assert any(said in message for message in messages), messages
    with pytest.raises(InputError) as refused:
        drive(load_robot_model(str(folder)))
    assert said in str(refused.value)


def drive(robot):
    from skillframe_hydraulics.drive import MachineDrive

    where = scene(np.array([8.0, 0.0, 0.0]), plate=False)
    return MachineDrive(Setup(robot=robot, scene=where), {}, [np.random.default_rng(0)])


def test_a_pump_of_several_pressures_or_that_leaks_away_or_whose_margin_is_all_is_refused(excavator):
    spec = load_robot(excavator(FITS + "kind = 'load_sensing'"))

    def refused(**changes):
        first, *rest = spec.actuation
        own = dataclasses.replace(first, parameters={**first.parameters, **changes})
        return [f"{key}: {problem}; {fix}" for key, problem, fix in impossible_supplies(with_actuation(own, *rest))]

    def with_actuation(*each):
        return dataclasses.replace(spec, actuation=each)

    assert refused() == []
    assert refused(supply_pressure=300e5) == [
        "supply.main: feeds actuators whose supply_pressure is 300 and 350 bar, and a pump has one;"
        " give one, or a supply each"
    ]
    assert refused(leakage=1e-9)[0].startswith(
        "supply.main: cannot hold 350 bar: 2.1e+03 l/min leak past the pistons, and the pump gives 400"
    )
    low = [dataclasses.replace(a, parameters={**a.parameters, "supply_pressure": 20e5}) for a in spec.actuation]
    assert [each[:2] for each in impossible_supplies(with_actuation(*low))] == [
        ("supply.main.margin", "is 20 bar, not below the supply_pressure of 20 bar")
    ]
    foreign = dataclasses.replace(spec.actuation[0], fmu="theirs.fmu", inputs={"command": "u"}, outputs={"force": "F"})
    assert [each[1] for each in impossible_supplies(with_actuation(foreign, *spec.actuation[1:]))] == [
        "the FMU of slew has no supply_drop, flow_supply, supply_slope, by which a line feeds it"
    ]
    table = dataclasses.replace(spec, tables={"supply": {"flow": 1.0}})
    with pytest.raises(InputError, match=r"is a table of tables, one for each pump; write \[supply.main\]"):
        supplies_of(table)


def one_line(count, flow=2e-3):
    """A supply of two pistons of 0.02 and 0.01 m2, that move as the tool does along x and y, at 0.92 of its flow."""
    lines = CONSTANT._replace(flow=np.array([flow]))
    supplies = SimpleNamespace(lines=lines, pressure=np.full((count, 1), RATED))
    c = SimpleNamespace(area_a=np.array([0.02, 0.01]), area_b=np.array([0.01, 0.005]))
    zeros = [np.zeros((count, 2)) for _ in range(6)]
    stiff = np.tile(np.eye(2), (count, 1, 1))
    nothing = np.zeros((count, 0))
    reference = Reference(zeros[0], zeros[1], 0.0 * stiff, stiff, zeros[2], nothing, nothing)
    measured = Measured(zeros[3], zeros[3], zeros[3], zeros[3], zeros[4], zeros[4])
    law = SimpleNamespace(given=(measured, reference), cylinders=c, gains=SimpleNamespace(joint=3.0))
    still = np.zeros((count, 2))
    terms = Terms(stiff, still, still, stiff, stiff, still, still, still, still, still)
    return FlowSharing({"main": DeclaredSupply(flow=flow, volume=1e-3)}, supplies, law, 2, H), reference, terms


def commanded(position, velocity):
    count = len(position)
    pose = Pose(np.column_stack([position, np.zeros(count)]), np.tile(np.eye(3), (count, 1, 1)))
    twist = np.column_stack([velocity, np.zeros((count, 4))])
    return Command(pose, twist, Impedance(np.eye(6)), np.zeros((count, 6)), np.zeros(count, int), no_reasons(count))


def test_a_path_within_the_pumps_flow_is_passed_on_to_the_bit_and_a_faster_one_at_the_pace_that_the_flow_allows():
    """Trial 0 moves at 50 mm/s, 1 at 0.1 and 0.2 m/s along both: 0.02 * 0.1 + 0.01 * 0.2 = 4e-3 of 0.92 * 2e-3 m3/s."""
    sharing, reference, terms = one_line(2)
    velocity = np.array([[0.05, 0.0], [0.1, 0.2]])
    for tick in range(1000):
        asked = commanded(velocity * tick * H, velocity)
        got = sharing.shared(asked, terms)
        reference.velocity[...] = got.twist[:, :2]
        np.testing.assert_array_equal(got.pose.position[0], asked.pose.position[0])
        np.testing.assert_array_equal(got.twist[0], asked.twist[0])
        along = got.pose.position[1, :2]
        assert along[1] == pytest.approx(2.0 * along[0], abs=1e-15)  # on the path
    np.testing.assert_allclose(sharing.pace, [1.0, 0.46], rtol=1e-9)
    np.testing.assert_allclose(got.twist[1, :2], 0.46 * velocity[1], rtol=1e-9)
    assert sharing.said(0) == []
    assert sharing.said(1) == [
        "the motion was slowed down for 1.00 s to share the pump's flow, to 0.46 of its speed at least; it ends 0.53 s"
        " behind its command"
    ]
    behind = sharing._last[1] - sharing._at[1]
    # 0.54 s a second but for the 20 ms in which the pace falls
    assert behind == pytest.approx(1000 * (1 - 0.46) - 20 * (1 - 0.46), abs=2.0)


def test_a_path_that_stands_still_is_played_to_its_end():
    sharing, reference, terms = one_line(1)
    velocity = np.array([[0.2, 0.0]])
    for tick in range(3000):
        moving = tick < 500
        asked = commanded(velocity * min(tick, 500) * H, velocity if moving else 0.0 * velocity)
        got = sharing.shared(asked, terms)
        reference.velocity[...] = got.twist[:, :2]
        if tick == 600:
            assert got.pose.position[0, 0] < 0.08
    np.testing.assert_array_equal(got.pose.position, asked.pose.position)
    np.testing.assert_array_equal(got.twist, 0.0)
    assert sharing.said(0)[0].endswith("it ends 0.00 s behind its command")


@pytest.mark.slow
@pytest.mark.parametrize("sharing", ["law", pytest.param("none", marks=pytest.mark.figures)])
def test_two_functions_with_a_small_pump_stay_on_their_path_slower_and_without_sharing_are_stopped(excavator, sharing):
    """0.9 m/s need 260 l/min of 160. With sharing the tool is within 5 mm of the line; without, it is said why not."""
    way = np.array([0.4, 0.8, -0.4])

    def path(time):
        value, rate = blend(time / 2.0)
        return value * way, rate / 2.0 * way

    text = f'flow = "160 l/min"\nvolume = "20 l"\nsharing = "{sharing}"'
    robot = load_robot_model(str(excavator(text)))
    chain = ClosedChain(robot)
    tip = chain.at(chain.minimal(chain.home), np.zeros(4)).data.oMf[chain.robot.tool_frames[0]].translation
    setup = Setup(robot=robot, scene=scene(tip - np.array([5.0, 0.0, 0.0]), plate=False))
    rngs = [np.random.default_rng(5)]
    found = simulate(Follow(path, MOVING), setup, {}, rngs, duration_s=3.5, trace_hz=100.0)
    trace = found.traces[0]
    machine = trace.machine
    if sharing == "none":
        assert found.reason[0].startswith("watchdog: the tool is ")
        assert "; supply main: its pump gave all it can for 0." in found.reason[0]
        assert machine["line_pressure"].min() < 250e5
        np.testing.assert_array_equal(machine["pace"], 1.0)
        return
    gone = trace.position - trace.position[0]
    along = way / np.linalg.norm(way)
    assert np.linalg.norm(gone - np.outer(gone @ along, along), axis=1).max() < 5e-3
    assert np.linalg.norm(gone[-1] - way) < 5e-3
    assert 0.4 < machine["pace"].min() < 0.65  # 0.92 * 160 / 260 = 0.57
    assert machine["pump_flow"].max() <= 160e-3 / 60 * (1 + 1e-12)
    assert machine["line_pressure"].min() > 300e5
    # the bill is what the pump gave less what the line stores: the trace's hundredths of a second, and both ends of it
    given = np.trapezoid((machine["line_pressure"] * machine["pump_flow"])[:, 0], trace.time)
    softness, ends = 20e-3 / 1.2e9, machine["line_pressure"][[0, -1], 0]
    taken = machine["energy_supply"][-1] - machine["energy_supply"][0]
    assert taken == pytest.approx(given - 0.5 * softness * (ends[1] ** 2 - ends[0] ** 2), rel=0.01)
    assert any(note.startswith("the motion was slowed down for ") for note in trace.meta["notes"])


def test_show_says_which_pump_feeds_what(excavator):
    lines, plain = told(load_robot(excavator(FITS + "kind = 'load_sensing'\nfeeds = ['slew']")))
    assert lines[-1] == "  supply main: load-sensing pump of 400 l/min, line of 20 l, feeds slew"
    assert plain["supply"]["main"]["margin"] == 20e5

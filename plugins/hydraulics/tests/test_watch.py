"""What a watch notices and what it leaves alone: readings, balances of oil and ways of the tool, made by hand."""

from types import SimpleNamespace

import casadi as ca
import numpy as np
import pytest
from skillframe_hydraulics.declared import MachineNoise
from skillframe_hydraulics.force.valve import ValveIdentification
from skillframe_hydraulics.law.hydraulic import HydraulicGains, Measured, Reference, Terms
from skillframe_hydraulics.law.hydraulic_compiled import CompiledLaw
from skillframe_hydraulics.law.vdc_actuator import cylinders
from skillframe_hydraulics.oil_balance import BOUNDS, Knowledge, _edge
from skillframe_hydraulics.watch import FlowWatch, MachineWatch, ReadingWatch, ToolWatch, knowledge

from skillframe.execution.prepare import load_robot_model
from skillframe.robot.chain import ClosedChain

DT, PERIOD = 1e-3, 0.02
C = cylinders(load_robot_model("hiab_xs031").spec.actuation)
JOINTS, PISTONS = ("lift", "tilt", "extension"), ("lift_piston", "tilt_piston", "extension")
HIGH, LOW = 100e5, 40e5


def readings(encoder=1e-4, pressure=0.22e5, seed=0):
    """20 readings of two machines at rest, behind the noise of that many tosses."""
    rng, scale = np.random.default_rng(seed), np.repeat([encoder, pressure], [3, 6])
    return np.repeat([0.5, HIGH], [3, 6]) + rng.standard_normal((20, 2, 9)) * scale


def watch(noise=None):
    speed = np.array([1.2, 1.5, np.inf])
    return ReadingWatch(noise or MachineNoise(), speed, np.full(3, 10e5), np.array([0, 1, 2]), (JOINTS, PISTONS), DT)


def seen(raw, judge=None, rate=0.0, low=None):
    pressures = np.full((2, 2, 3), HIGH) if low is None else low
    return [
        (f.row, f.text) for f in (judge or watch()).look(raw, np.concatenate(pressures, axis=-1), np.full((2, 3), rate))
    ]


def test_noise_alone_is_no_fault():
    """8 sigma of a difference: none of a million readings of six encoders is beyond."""
    judge = watch()
    for seed in range(2000):
        assert seen(readings(seed=seed), judge) == []


@pytest.mark.parametrize(
    ("column", "text"),
    [
        (1, "sensor: the encoder of tilt repeats 0.5 to the bit"),
        (5, "sensor: pressure_a of extension repeats 0.5 bar to the bit"),
        (6, "sensor: pressure_b of lift_piston repeats 0.5 bar to the bit"),
    ],
)
def test_five_equal_readings_are_a_sensor_that_has_stopped_and_four_are_not(column, text):
    raw = readings()
    raw[-4:, 1, column] = 0.5 if column < 3 else 0.5e5
    found = seen(raw)
    assert not any("to the bit" in words for _, words in found)
    raw[-5:, 1, column] = raw[-1, 1, column]
    assert (1, text) in seen(raw)


def test_a_sensor_without_noise_may_repeat_itself_while_its_piston_stands():
    judge, raw = watch(MachineNoise(encoder=0.0, pressure=0.0)), readings(0.0, 0.0)
    assert seen(raw, judge, rate=0.001) == []
    assert len(seen(raw, judge, rate=0.02)) == 18


def test_a_jump_beyond_the_speed_limit_and_noise_is_named_and_one_within_is_not():
    """lift: 1.2 rad/s in a millisecond and 8 sqrt(2) 1e-4 rad, 2.33 mrad."""
    for step, found in ((0.0022, 0), (0.0025, 1), (-0.0025, 1)):
        raw = readings(encoder=1e-9)
        raw[12:, 0, 0] += step
        assert len(seen(raw)) == found
    assert seen(raw)[0] == (
        0,
        "sensor: the encoder of lift jumps by 0.0025 within a tick, "
        "more than its speed limit and noise allow (0.00233)",
    )


def test_a_joint_whose_speed_limit_nobody_knows_may_jump():
    raw = readings()
    raw[12:, 0, 2] += 1.0
    assert seen(raw) == []


def test_a_pressure_far_below_the_return_line_is_named_and_one_beside_it_is_not():
    low = np.full((2, 2, 3), HIGH)
    low[1, 1, 2] = 8.5e5
    assert seen(readings(), low=low) == []
    low[1, 1, 2] = 7.5e5
    cause = "the transducer has failed, or the hose has burst"
    expected = f"sensor: pressure_b of extension reads 7.5 bar, below the return line's 10: {cause}"
    assert seen(readings(), low=low) == [(1, expected)]


class Oil:
    """A cylinder (three of a kind, two machines) that does what its valve and oil make it do, integrated by hand."""

    def __init__(self, swing=False, unsure=0.0, ratio=1.0, overlap=0.0, spread=0.0):
        self.unsure, self.ratio, self.overlap, self.spread = unsure, ratio, overlap, spread
        self.watch, self.swing = FlowWatch(C, PISTONS, 2, PERIOD), swing
        self.x, self.p = np.full((2, 3), 0.3), np.stack([np.full((2, 3), HIGH), np.full((2, 3), LOW)])
        self.supply: np.ndarray = C.supply_pressure
        self.late, self.arms = [np.zeros((2, 3))] * 2, np.zeros(1)

    def look(self, valve, lost=None, way=None):
        """20 ms under a command, one look late; pressures [Pa] that are lost, or a way that is not the valve's."""
        told, self.late = self.late[0], [*self.late[1:], np.broadcast_to(valve, (2, 3))]
        drop = np.where(told > 0, C.supply_pressure - self.p[0], self.p[0] - C.return_pressure)
        step = PERIOD * C.edge * told * np.sqrt(drop) / C.area_a if way is None else np.broadcast_to(way, (2, 3))
        self.x = self.x + step
        if lost is not None:
            self.p = self.p - lost
        zeros = np.zeros((2, 3))
        measured = Measured(zeros, zeros, *self.p, np.zeros((2, 2)), np.zeros((2, 2)))
        nothing = np.zeros(1)
        terms = Terms(*([nothing] * 4), self.arms, self.x, zeros, nothing, nothing, nothing)
        b = self.overlap
        sure = (zeros + max(b - self.spread, 0.0), zeros + b + self.spread, zeros + self.ratio)
        knowledge = Knowledge(np.broadcast_to(self.supply, (2, 3)), zeros + b, zeros + self.unsure, *sure)
        return [f.text for f in self.watch.look(np.broadcast_to(valve, (2, 3)), measured, terms, knowledge, self.swing)]


SETTLED = BOUNDS.length + 1


def balanced(valve, ticks=SETTLED, oil=None, **more):
    """What is found on the way, and the oil. Chamber b is left alone: its area is that of the true balance of a."""
    oil = oil or Oil()
    return [text for _ in range(ticks) for text in oil.look(valve, **more)], oil


def test_a_piston_that_stands_with_its_valve_shut_is_sound():
    assert balanced(0.0)[0] == []


def test_a_valve_that_is_told_and_a_piston_that_does_not_move_are_named():
    found, _ = balanced(0.2, way=0.0)
    assert found
    assert all(text.startswith("watchdog: the valve of ") and "is commanded" in text for text in found)
    assert "and the piston does not move" in found[0]


def test_while_nobody_knows_the_supply_a_piston_may_stand_and_still_may_not_run_away():
    """At 150 bar a lift that needs 150 stands, whatever it is told; 30 bar are the deviation before the swing."""
    assert balanced(0.2, oil=Oil(swing=True, unsure=3e6), way=0.0)[0] == []
    assert balanced(0.2, oil=Oil(swing=True, unsure=3e6), way=-2e-3)[0] != []
    _, oil = balanced(0.2, oil=Oil(swing=True, unsure=3e6), way=0.0)
    oil.unsure = 0.0  # it was found; what was told before still counts with the supply that was believed
    assert balanced(0.2, BOUNDS.length - 1, oil, way=0.0)[0] == []
    assert balanced(0.2, 2, oil, way=0.0)[0] != []


def test_a_supply_that_is_believed_too_low_and_not_sure_is_held_to_be_the_nominal_one():
    """120 bar feed half of what 190 feed a chamber at 100; the first fit of a swing may be out by that much."""
    for unsure, sound in ((5e6, True), (0.0, False)):
        oil = Oil(swing=True, unsure=unsure)
        oil.supply = np.full(3, 120e5)
        assert (balanced(0.2, oil=oil)[0] == []) is sound


def swinging(sense):
    """What is found of pistons whose valves go to and fro at 1 Hz, 0.2 of their travel."""
    oil = Oil()
    commands = 0.2 * np.sin(2 * np.pi * PERIOD * np.arange(80))
    return [text for u in commands for text in oil.look(u, way=None if sense > 0 else -0.01 * u)]


def test_a_piston_that_follows_its_valve_two_looks_late_is_sound_and_one_that_goes_the_other_way_is_not():
    """Chamber b, 0.68 of a, has the same way: its edges would let through 0.6 to 1.3 of that, within the half."""
    assert swinging(1) == []
    assert any("does not balance" in text for text in swinging(-1))


def test_a_piston_that_moves_with_its_valve_shut_is_named():
    """2 mm in 0.1 s, beyond the floor of half a one."""
    _, oil = balanced(0.0)
    found, _ = balanced(0.0, 6, oil, way=4e-4)
    assert "watchdog: the piston of lift_piston moves 2.0 mm in 0.1 s, and its valve is not commanded to" in found


def test_a_piston_may_creep_less_than_the_floor_and_twice_that_in_the_swing():
    """Half a millimetre in 0.1 s while the valve is not known well."""
    assert balanced(0.0, oil=Oil(unsure=3e6), way=0.8e-4)[0] == []
    assert balanced(0.0, oil=Oil(unsure=3e6), way=1.2e-4)[0] != []
    assert balanced(0.0, 30, Oil(swing=True), way=1.8e-4)[0] == []
    assert balanced(0.0, 30, Oil(swing=True), way=2.4e-4)[0] != []


def fitting():
    """Oil whose pressures are such that one spool feeds a and drains b by one way of the piston."""
    oil = Oil()
    share = (C.area_b / C.area_a) ** 2
    oil.p[1] = C.return_pressure + share * (C.supply_pressure - oil.p[0])
    return oil


def spool(told, stays, ticks=40, **known):
    """What is said of spools that follow for half a second, and then stay while they are told something else."""
    oil = fitting()
    assert balanced(stays, ticks=25, oil=oil)[0] == []
    for name, value in known.items():
        setattr(oil, name, value)
    before = oil.x
    oil.look(stays)
    return balanced(told, ticks, oil, way=oil.x - before)[0]


def test_in_a_run_a_spool_that_stays_is_named_once_a_tenth_of_its_flow_and_a_tenth_of_a_millimetre_differ():
    """Told 0.2 of the travel the lift goes 0.1 s by 8 mm and more; with 0.15 it would go three quarters of that."""
    assert spool(0.185, 0.2) == []  # 0.2 lies 0.015 off, of 0.0185 and what the floor is worth
    found = spool(0.15, 0.2)
    goes = 1e3 * BOUNDS.window * PERIOD * C.edge[0] * 0.2 * np.sqrt(C.supply_pressure[0] - HIGH) / C.area_a[0]
    assert found[-3] == (
        f"watchdog: the valve of lift_piston is commanded {0.75 * goes:.1f} mm in 0.1 s, and the piston goes "
        f"{goes:.1f} mm"
    )
    assert len(found) > 3


def test_a_spool_is_judged_by_what_the_swing_has_found_of_its_valve_and_not_closer():
    """A valve of 4/3 of its rated flow goes with 0.15 as others with 0.2, and one without overlap as 0.05 +- 0.05."""
    assert spool(0.15, 0.2, ratio=4.0 / 3.0) == []
    assert spool(0.15, 0.2, ratio=1.1) != [] and spool(0.2, 0.2, ratio=0.75) != []
    assert spool(0.2, 0.2, overlap=0.05, spread=0.05) == [] and spool(0.2, 0.2, overlap=0.05, spread=0.01) != []
    assert spool(0.2, 0.16, spread=0.06) == [] and spool(0.2, 0.16, spread=0.01) != []
    assert spool(0.15, 0.2, unsure=3e6) == []
    assert spool(0.15, 0.2, swing=True) == []


def pulling(goes, told=1.0, drop=0.2e5, **known):
    """What is said of pistons with this drop left to feed them, if edges are laminar and go as they would with `goes`.

    Chamber b is drained by the same way. Below the laminar pressure of 1 bar a root would let through twice as much.
    """
    oil = Oil()
    for name, value in known.items():
        setattr(oil, name, value)
    oil.p = np.stack([
        C.supply_pressure - drop + np.zeros((2, 3)), C.return_pressure + drop * C.area_b / C.area_a + np.zeros((2, 3)),
    ])  # fmt: skip
    flow = C.edge * goes * drop / (drop**2 + C.laminar_pressure**2) ** 0.25
    return balanced(told, 2 * SETTLED, oil, way=PERIOD * flow / C.area_a)[0]


def test_a_cylinder_that_pulls_as_hard_as_it_can_is_sound_though_little_passes_its_open_valve():
    """Row 20's crane with a tenth less mass than believed: 0.3 bar left of 180, 0.35 of the valve's travel."""
    assert pulling(0.3, told=0.3) == []
    assert pulling(1.0) == []
    assert pulling(0.0) != [] and pulling(0.5) != []


def test_a_small_drop_is_known_no_better_than_the_supply_of_which_it_is_left():
    """Two standard deviations of a supply lower and higher, beside floor and share of the flow; one is too few."""
    assert pulling(0.5, unsure=0.018e5) == [] and pulling(0.5, unsure=0.01e5) != []
    assert pulling(1.0, told=0.25, unsure=0.12e5) == [] and pulling(1.0, told=0.25, unsure=0.08e5) != []
    high = {"drop": 0.1e5, "supply": C.supply_pressure + 0.9e5}  # what is believed of the oil that fills a
    assert pulling(1.0, **high, unsure=0.4e5) == []
    assert any("does not balance" in text for text in pulling(1.0, **high, unsure=0.05e5))
    low = {"drop": 1.5e5, "supply": C.supply_pressure - 1.4e5}
    assert pulling(1.0, **low, unsure=0.7e5) == []
    assert any("does not balance" in text for text in pulling(1.0, **low, unsure=0.05e5))
    assert pulling(-5.0, unsure=3e6, swing=True) != []  # nobody knows the supply, and still no chamber is emptied


def test_what_is_not_known_of_the_oil_counts_beside_what_scatters():
    """3, 4, 5, and two of these for the overlap; a fit that still moves is no surer than it moved."""
    valves = SimpleNamespace(
        overlap=0.02, overlap_deviation=3e-3, overlap_oil=4e-3, ratio=1.0, supply_deviation=3e5, supply_oil=4e5,
        supply_moved=1e5, line_deviation=None,
    )  # fmt: skip
    known = knowledge(SimpleNamespace(supply=HIGH, deadband=0.02), valves)
    np.testing.assert_allclose([known.unsure, known.least, known.most], [5e5, 0.01, 0.03], rtol=1e-12)
    valves.supply_moved = 6e5
    assert knowledge(SimpleNamespace(supply=HIGH, deadband=0.02), valves).unsure == 6e5


def test_a_small_drop_is_judged_for_every_overlap_that_is_likely():
    """Told 0.6, a spool opens 0.2 of its travel across an overlap of a half, and 0.6 without."""
    assert pulling(0.2, told=0.6, overlap=0.25, spread=0.25) == []
    assert pulling(0.6, told=0.6, overlap=0.25, spread=0.25) == []
    assert pulling(-0.2, told=0.6, overlap=0.25, spread=0.25) != []


def test_a_creep_of_both_chambers_is_a_spool_and_noise_of_the_encoders_is_none():
    """0.1 mm in 0.1 s, and 8 standard deviations of the difference of two readings."""
    assert balanced(0.0, way=1.8e-5)[0] == []
    assert balanced(0.0, way=2.2e-5)[0] != []
    noisy = Oil()
    noisy.watch, noisy.arms = FlowWatch(C, PISTONS, 2, PERIOD, 2e-5), np.tile(0.5 * np.eye(3), (2, 1, 1))
    most = (1e-4 + 8.0 * np.sqrt(2.0) * 0.5 * 2e-5) / BOUNDS.window
    assert balanced(0.0, 30, noisy, way=0.95 * most)[0] == []
    assert balanced(0.0, 30, noisy, way=1.05 * most)[0] != []


def test_oil_that_is_lost_from_one_chamber_is_named_with_its_chamber_and_amount():
    """Compression gives back V/B dp: 4.5 l at 800 MPa and 80 bar are 45 cm3, of a piston that stands."""
    _, oil = balanced(0.0)
    lost = np.zeros((2, 2, 3))
    lost[0, 1, 0] = 80e5
    found = oil.look(0.0, lost=lost)
    volume = 1e6 * C.area_a[0] * (C.arm_a[0] + 0.3) / C.bulk_modulus[0] * 80e5
    text = f"in 0.1 s chamber a {volume:.0f} cm3 less than its valve let through"
    assert found == [f"watchdog: the oil of lift_piston does not balance: {text}"]


def tool(rate, required, looks=BOUNDS.slow + 2):
    """What is said of a tool that moves at one speed while the law wants another, both along x."""
    judge, n = ToolWatch(2, PERIOD), np.zeros((2, 2))
    stiff = np.tile(np.eye(2), (2, 1, 1))
    reference = Reference(n, n, 1e5 * stiff, 5e4 * stiff, n, np.zeros((2, 1)), np.zeros((2, 1)))
    error = np.array([[required / 2.0, 0.0], [0.0, 0.0]])  # D^-1 K (X_d - X) = 2/s times it
    moving = np.array([[rate, 0.0], [0.0, 0.0]])
    return [f for _ in range(looks) for f in judge.look(moving, error, n, reference)]


def test_a_tool_that_does_what_the_law_wants_is_sound_and_one_that_lags_or_rushes_is_not():
    assert tool(0.3, 0.3) == []
    assert tool(0.58, 0.3) == []  # 58 mm in 0.1 s, of 50 and twice 30
    assert tool(0.3, -0.05) != []
    rushed, *_ = tool(1.2, 0.3)
    assert (rushed.row, rushed.sensor, rushed.text) == (
        0,
        False,
        "watchdog: the tool moves at 1.20 m/s, and the controller commands 0.30 m/s",
    )
    lost = tool(-0.1, 0.25)
    assert lost[0].text == "watchdog: the tool is 70 mm from where the controller commanded it in the last 0.2 s"
    assert {f.row for f in lost} == {0}


def test_the_bounds_of_the_tool_are_those_that_are_stated():
    """|X'| 0.1 s <= 50 mm + 2 |X_r'| 0.1 s, and 60 mm of way in 0.2 s."""
    assert (BOUNDS.fast, BOUNDS.slow) == (5, 10)
    assert tool(0.29, 0.0) == [] and tool(0.31, 0.0) != []  # 58 and 62 mm in 0.2 s
    still = tool(0.2, 0.49)
    assert still == [] and tool(0.2, 0.51) != []


class Gauges:
    """What a watch asks of sensors: noise, and from tick 50 on one that repeats itself in both machines."""

    def __init__(self):
        self.turn, self.chambers, self.tick = 0, np.full((2, 6), HIGH), 0
        self.raw = readings()[np.arange(21) % 20] + np.arange(21)[:, None, None] * 1e-9
        self.rng = np.random.default_rng(1)

    def sample(self):
        self.tick += 1
        now = readings(seed=self.tick)[0]
        if self.tick >= 50:
            now[:, 4] = 77.0
        self.raw[self.turn] = now
        self.turn = (self.turn + 1) % 21


def test_a_trial_that_breaks_a_limit_is_looked_at_at_once_and_its_neighbour_when_a_look_is_due():
    chain = ClosedChain(load_robot_model("hiab_xs031"))
    law, gauges = CompiledLaw(chain, C, HydraulicGains(), 2, DT, use_compiler=False), Gauges()
    judge = MachineWatch(law, ValveIdentification(C, 2, DT), C, gauges, MachineNoise(), np.arange(3), DT)
    zeros, plane = np.zeros((2, 3)), np.zeros((2, 2))
    measured = Measured(zeros, zeros, zeros + HIGH, zeros + HIGH, plane, plane)
    terms = Terms(*([np.zeros(1)] * 5), zeros + 0.3, zeros, plane, plane, zeros)
    stiff = np.tile(np.eye(2), (2, 1, 1))
    wanted = Reference(plane, plane, stiff, stiff, plane, plane[:, :1], plane[:, :1])
    found = {}
    for tick in range(1, 61):
        gauges.sample()
        alarms = [1] if tick == 55 else []
        if judge.due(zeros) or alarms:
            for row, code, text in judge.look(measured, terms, wanted, np.arange(2), alarms=alarms):
                found.setdefault(row, (tick, code.value, text))
    words = "sensor: pressure_a of tilt_piston repeats 0.00077 bar to the bit"
    assert found == {1: (55, "sensor", words), 0: (60, "sensor", words)}


def test_one_spool_alone_that_stays_is_named():
    """The quick look that spares the judging asks every cylinder of every machine."""
    oil = Oil()
    assert balanced(0.3, ticks=2 * SETTLED, oil=oil)[0] == []
    way = np.broadcast_to(PERIOD * C.edge * 0.3 * np.sqrt(C.supply_pressure - oil.p[0]) / C.area_a, (2, 3)).copy()
    way[1, 2] *= 0.7
    found = [text for _ in range(BOUNDS.window + 1) for text in oil.look(0.3, way=way)]
    assert found and all("the valve of extension is commanded" in text for text in found)


@pytest.mark.parametrize(("check", "expected"), [(0.0, -np.sqrt(20e5)), (1.0, 0.0)])
def test_behind_a_check_valve_no_oil_is_expected_to_go_back_into_a_line_that_has_fallen(check, expected):
    pressure, fills, line = (ca.SX(np.full(3, value)) for value in (100e5, 1.0, 80e5))
    for filling, flow in ((fills, expected), (0.0 * fills, -np.sqrt(100e5 - C.return_pressure))):
        root = _edge(C, pressure, filling, line, False, (C.edge_pa, C.edge_at, np.full(3, check)))
        np.testing.assert_allclose(np.array(ca.evalf(root)).ravel(), flow, rtol=1e-12)

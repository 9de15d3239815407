"""Faults of a machine: what they change, from when on, in which trial and where, and who cannot have them."""

import dataclasses

import numpy as np
import pytest
from skillframe_hydraulics.faults import NAMES, SUPPLY_S, Faults, faults_in, moved_joints
from skillframe_papers.rows.crane_runs import MOVING, Follow

from plugins.hydraulics.tests.test_machine import rngs, setup, standing
from skillframe.errors import InputError
from skillframe.execution.executor import begin
from skillframe.execution.prepare import load_robot_model
from skillframe.extend.drives import check_quantities
from skillframe.robot.chain import ClosedChain
from skillframe.robot.model import load_model
from skillframe.robot.spec import load_robot
from tests.fmu_cache import own_cache  # noqa: F401

DT = 1e-3
JOINTS = np.array([1, 0, 2])
"""Cylinder 0 moves coordinate 1, to tell one from the other."""


def broken(**draws):
    """Two trials; in the second something breaks in cylinder 0 after three ticks."""
    given = {name.replace("__", "."): np.array([0.0, value]) for name, value in draws.items()}
    return Faults({**given, "fault.time": np.array([0.0, 3 * DT]), "fault.cylinder": np.ones(2)}, JOINTS, 2, DT, 0)


def readings(faults, ticks=6):
    """(ticks, 2, 9) of sensors that show their tick's number."""
    found = []
    for k in range(ticks):
        faults.tick()
        found.append(faults.read(np.full((2, 9), 10.0 + k)))
    return np.array(found)


@pytest.mark.parametrize(
    ("name", "columns", "expected"),
    [
        ("sensor__pressure_frozen", [3, 6], [10, 11, 12, 12, 12, 12]),
        ("sensor__pressure_zero", [3, 6], [10, 11, 12, 0, 0, 0]),
        ("sensor__encoder_frozen", [1], [10, 11, 12, 12, 12, 12]),
    ],
)
def test_a_broken_sensor_reads_so_from_its_tick_on_and_no_other_does(name, columns, expected):
    found = readings(broken(**{name: 1.0}))
    for column in range(9):
        want = expected if column in columns else np.arange(10.0, 16.0)
        np.testing.assert_array_equal(found[:, 1, column], want)
    np.testing.assert_array_equal(found[:, 0], np.arange(10.0, 16.0)[:, None] * np.ones(9))


def test_an_encoder_that_steps_goes_on_counting_from_there():
    found = readings(broken(sensor__encoder_step=-0.25))
    np.testing.assert_allclose(found[:, 1, 1] - found[:, 0, 1], [0, 0, 0, -0.25, -0.25, -0.25])


def test_a_stuck_spool_stays_where_it_was_and_a_runaway_one_goes_where_it_likes():
    commands, spool = np.full((2, 3), 0.5), np.full((2, 3), 0.1)
    for faults, where in ((broken(actuator__stuck=1.0), 0.1), (broken(actuator__runaway=-1.0), -1.0)):
        for k in range(6):
            faults.tick()
            told = faults.obey(commands, spool + k if k > 3 else spool)
            expected = commands.copy()
            expected[1, 0] = where if k >= 3 else 0.5
            np.testing.assert_array_equal(told, expected)


def test_a_spool_that_nobody_sees_stays_at_what_it_was_last_told():
    faults = broken(actuator__stuck=1.0)
    for k in range(5):
        faults.tick()
        told = faults.obey(np.full((2, 3), 0.1 * k), np.full((2, 3), np.nan))
    assert told[1].tolist() == [0.2, 0.4, 0.4] and told[0, 0] == 0.4


def test_a_supply_fails_exponentially_for_all_cylinders_and_a_hose_bursts_in_one():
    faults = broken(actuator__supply_loss=0.5, actuator__burst_b=1e-4)
    for _ in range(104):
        faults.tick()
    # a hundred ticks after it began, one time constant
    np.testing.assert_allclose(faults.drop(np.full((2, 3), 100.0)), [[0] * 3, [50 * (1 - np.exp(-0.1 / SUPPLY_S))] * 3])
    assert faults.leak("b").tolist() == [[0, 0, 0], [1e-4, 0, 0]] and not faults.leak("a").any()


def pressure_a(drive):
    """True pressures of the piston sides (N, k) [Pa]."""
    return drive.bank.y[:, drive.bank.outputs.index("pressure_a")].reshape(drive.count, -1)


def test_each_cylinder_of_the_crane_moves_the_joint_of_its_name():
    chain = ClosedChain(load_robot_model("hiab_xs031"))
    assert [chain.independent[j] for j in moved_joints(chain)] == ["lift", "tilt", "extension"]


@pytest.mark.slow  # the law of a burst hose is asked above
def test_a_hose_that_bursts_empties_its_chamber_in_that_trial_alone_and_the_next_batch_is_sound():
    draws = {
        "actuator.burst_a": np.array([0.0, 1.3e-4]),
        "fault.time": np.full(2, -7.0),
        "fault.cylinder": np.full(2, 2.0),
    }
    for given, low in (
        (draws, True),
        ({"actuator.burst_a": np.zeros(2)}, False),
        (draws | {"fault.time": np.zeros(2)}, False),
    ):
        loop = begin(Follow(standing, MOVING), setup(), given, rngs(range(2)), None)
        before = pressure_a(loop.drive).copy()
        for _ in range(20):
            loop.drive._sample()
            loop.drive.advance(loop.active)
        after = pressure_a(loop.drive)
        assert (after[1, 1] < 15e5) == low  # the check valve of the return line feeds what the hole lets out
        np.testing.assert_allclose(after[0], before[0], rtol=0.02)


@pytest.mark.parametrize("name", [*NAMES, "fault.time", "fault.cylinder"])
@pytest.mark.parametrize("robot", ["panda", "panda_servo"])
def test_an_arm_has_none_of_these_faults(name, robot):
    arm = load_model(load_robot(robot))
    with pytest.raises(InputError, match=f"{name}: {robot} has no drive with such a quantity"):
        check_quantities({name: np.array([1.0])}, arm)


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("sensor.pressure_frozen", 0.5, "is 0.5, and something is broken or not; give 1 or 0"),
        ("actuator.runaway", 2.0, "2 is beyond -1 to 1, the spool's travel"),
        ("actuator.burst_a", 1.3, "1.3 m2 is beyond 0m2 to 0.01m2, a hole of 11 cm"),
        ("actuator.supply_loss", -0.1, "-0.1 is beyond 0 to 1, a share"),
        ("sensor.encoder_step", 90.0, "90 rad is beyond .*; did you mean 90deg"),
        ("fault.cylinder", 4.0, "is 4, which is none of its cylinders; give one of 1 lift_piston, 2 tilt_piston, 3"),
        ("fault.cylinder", 1.5, "is 1.5, which is none"),
        ("fault.time", -100.0, "-100 s is beyond -60s to 3600s"),
        ("fault.time", np.nan, "nan s is beyond"),
    ],
)
def test_a_fault_that_cannot_be_is_refused_with_what_it_takes(name, value, message):
    crane = load_model(load_robot("hiab_xs031"))
    with pytest.raises(InputError, match=f"{name}: {message}"):
        check_quantities({name: np.array([float(name == "fault.cylinder"), value])}, crane)


def test_a_time_without_a_fault_is_refused_and_a_fault_that_no_trial_has_costs_nothing():
    with pytest.raises(InputError, match=r"fault.time: is set, and no fault is; set one of sensor.pressure_frozen, "):
        faults_in({"fault.time": np.array([1.0])})
    assert faults_in({"fault.time": np.array([1.0]), "actuator.stuck": np.zeros(1)}) == ()


def test_a_cylinder_of_another_maker_cannot_burst_unless_its_fmu_can():
    crane = load_robot_model("hiab_xs031")
    lift, *others = crane.spec.actuation
    theirs = dataclasses.replace(lift, fmu="theirs.fmu", inputs={"command": "u", "burst_b": "hole"})
    robot = dataclasses.replace(crane, spec=dataclasses.replace(crane.spec, actuation=(theirs, *others)))
    with pytest.raises(
        InputError, match="lift_piston: its FMU has no input for burst_a, so that it cannot break so; map"
    ):
        begin(Follow(standing, MOVING), setup(robot), {"actuator.burst_a": np.ones(1) * 1e-4}, rngs([0]), None)

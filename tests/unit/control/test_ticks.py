"""What ticks.c does is what numpy does beside it, to the last bit, for what is not a number as well."""

import numpy as np
import pytest

from skillframe.control.admittance import AdmittanceLaw, Bounds, RingWatch
from skillframe.control.controller import ImpedanceController, Reading
from skillframe.control.joint_steps import JointRange, JointSteps
from skillframe.control.limits import LimitGuard
from skillframe.control.motors import InnerLoop, JointLimits, Motors
from skillframe.control.ticks import compiled_filter
from skillframe.fmu import build
from skillframe.frames import Pose, move_wrench, rotation_matrix
from skillframe.robot.interface import Control
from skillframe.robot.spec import Limits
from skillframe.signals import WrenchFilter
from skillframe.skill import Command, Impedance, no_reasons
from tests import fmu_cache

compiler = fmu_cache.compiler

COUNT, JOINTS, DT, TICKS = 3, 7, 1e-3, 60


@pytest.fixture(autouse=True)
def _with_a_compiler(compiler):
    pass


def both(monkeypatch, make, run):
    """What `run` gives of a thing made with the C file and of one without."""
    compiled = make()
    monkeypatch.setattr("skillframe.control.ticks.library", lambda source: None)
    plain = make()
    monkeypatch.undo()
    return run(compiled, np.random.default_rng(1)), run(plain, np.random.default_rng(1))


def agree(pair):
    np.testing.assert_array_equal(*(np.array(rows) for rows in pair))


def upset(array, tick):
    """The last row is lost for two ticks, half-way."""
    if 0 < tick - TICKS // 2 < 3:
        array[-1] = np.nan if tick % 2 else np.inf
    return array


def test_motors_are_held_and_their_peaks_taken_alike(monkeypatch):
    far = np.full(JOINTS, 2.0)
    limits = JointLimits(("j",) * JOINTS, (False,) * JOINTS, far, far, -far, far + 1.0, np.ones(JOINTS))

    def run(motors, rng):
        rows = []
        for tick in range(TICKS):
            torque, velocity, place = rng.normal(0.0, 0.8, (3, COUNT, JOINTS))
            given = motors.held(upset(torque, tick), velocity, place)
            rows.append(np.concatenate([given, motors.shares()[0].T, motors._peak, motors.fine()[:, None]], axis=1))
        return rows

    with np.errstate(invalid="ignore"):
        agree(both(monkeypatch, lambda: Motors([limits], 900.0, COUNT, DT), run))


@pytest.mark.parametrize("kind", ["position", "velocity"])
def test_an_inner_loop_asks_for_the_same_torques(kind, monkeypatch):
    arm, start = Control(interface=kind, delay_s=0.004).admittance, np.linspace(-1.0, 1.0, COUNT * 6).reshape(COUNT, 6)
    masses = np.random.default_rng(0).normal(size=(COUNT, 6, 6))

    def run(loop, rng):
        return [loop.torque(*rng.normal(size=(4, COUNT, 6))) for _ in range(TICKS)]

    agree(both(monkeypatch, lambda: InnerLoop(arm, start, lambda: masses, DT), run))


@pytest.mark.parametrize("turn", [0.3, np.pi])
def test_a_law_moves_by_the_same_twists_with_contact_that_rings_and_turns_of_half_a_circle(turn, monkeypatch):
    def make():
        return AdmittanceLaw(COUNT, 2e-3, Bounds((900.0, 3.0), (20.0, 2.0)), RingWatch(COUNT, 2e-3, 0.03, 20.0))

    def run(law, rng):
        rows = []
        for tick in range(TICKS):
            vectors = rng.normal(size=(2, COUNT, 3))
            vectors[1] *= turn / np.linalg.norm(vectors[1], axis=-1)[:, None]
            here = Pose(rng.normal(size=(COUNT, 3)), rotation_matrix(rng.normal(size=(COUNT, 3))))
            pose = Pose(here.position + 0.01 * vectors[0], rotation_matrix(vectors[1]) @ here.rotation)
            spring = Impedance(np.diag([900.0, 900, 0, 20, 20, 20]), None)
            twist, push = rng.normal(size=(2, COUNT, 6))
            command = Command(pose, twist, spring, push, np.zeros(COUNT, int), no_reasons(COUNT))
            wrench = upset(rng.normal(size=(COUNT, 6)) * (0.1 if tick % 3 else 30.0), tick)
            rows += [law.step(command, here, wrench, tick / TICKS), law.twist]
        return rows

    with np.errstate(invalid="ignore"):
        agree(both(monkeypatch, make, run))


@pytest.mark.parametrize("turn", [0.3, np.pi])
@pytest.mark.parametrize("damped", [True, False])
def test_an_impedance_law_gives_the_same_torques_for_turns_of_half_a_circle_too(turn, damped, monkeypatch):
    jacobian, mass = np.random.default_rng(4).normal(size=(COUNT, 6, JOINTS)), np.eye(JOINTS)

    def run(controller, rng):
        rows = []
        for tick in range(TICKS):
            vectors = rng.normal(size=(2, COUNT, 3))
            vectors[1] *= turn / np.linalg.norm(vectors[1], axis=-1)[:, None]
            here = Pose(rng.normal(size=(COUNT, 3)), rotation_matrix(rng.normal(size=(COUNT, 3))))
            pose = Pose(here.position + 0.01 * vectors[0], rotation_matrix(vectors[1]) @ here.rotation)
            twist, wanted, push = rng.normal(size=(3, COUNT, 6))
            bias, velocity = rng.normal(size=(2, COUNT, JOINTS))
            reading = Reading(here, upset(twist, tick), jacobian, bias, velocity, lambda: np.tile(mass, (COUNT, 1, 1)))
            spring = Impedance(np.diag([900.0, 900, 0, 20, 20, 20]), 30.0 * np.eye(6) if damped else None)
            command = Command(pose, wanted, spring, push, np.zeros(COUNT, int), no_reasons(COUNT))
            rows.append(np.concatenate(controller.torque(command, reading, tick / TICKS), axis=1))
        return rows

    with np.errstate(invalid="ignore"):
        agree(both(monkeypatch, lambda: ImpedanceController(COUNT), run))


@pytest.mark.parametrize("joints", [6, 7])
def test_joints_step_alike_below_and_at_their_limits(joints, monkeypatch):
    home, jacobian = np.zeros((COUNT, joints)), np.random.default_rng(3).normal(size=(COUNT, 6, joints))
    limits = JointRange(np.full(joints, 0.5), np.full(joints, -0.05), np.full(joints, 0.05))

    def run(steps, rng):
        rows = []
        for tick in range(TICKS):
            command, measured = rng.normal(0.0, 0.018, (2, COUNT, joints))
            size = (0.02, 0.2, 2.0)[tick % 3]
            rows.append(
                np.concatenate(steps.velocities(size * rng.normal(size=(COUNT, 6)), jacobian, command, measured), 1)
            )
        return rows

    agree(both(monkeypatch, lambda: JointSteps(home, limits, 0.03, 2e-3), run))


def test_the_quick_look_at_limits_passes_nothing_that_the_long_one_names(monkeypatch):
    limits = Limits(force_n=10.0, torque_n_m=1.0, energy_j=0.02, workspace_m=((-0.5,) * 3, (0.5,) * 3))

    def run(guard, rng):
        rows = []
        for tick in range(10 * TICKS):
            values = [0.1, 3.0, 6.0, 1.0] * rng.random(4)
            position, twist, wrench, command = (
                v * rng.normal(size=(COUNT, n)) for v, n in zip(values, (3, 6, 6, 6), strict=True)
            )
            wrench[:, 3:] *= 0.2
            some = guard.violations(position, upset(twist, tick - 9 * TICKS), wrench, command, np.arange(COUNT))
            guard.energy[:] %= 0.021
            rows.append([one.row for one in some] + [-1] * (COUNT - len(some)))
        return rows

    with np.errstate(invalid="ignore"):
        pair = both(monkeypatch, lambda: LimitGuard(limits, COUNT, DT), run)
    agree(pair)
    assert {-1, 0, 1, 2} == set(np.ravel(pair[0]))


def test_a_filtered_wrench_is_taken_at_another_point_alike():
    plain, rng = WrenchFilter(dt=DT).steady(), np.random.default_rng(2)
    quick = compiled_filter(COUNT, plain)
    for one in (plain, quick):
        one.start(np.ones((COUNT, 6)))
    for _ in range(TICKS):
        wrench, lever = rng.normal(size=(COUNT, 6)), rng.normal(size=(COUNT, 3))
        np.testing.assert_array_equal(quick.step(wrench, lever), move_wrench(plain.step(wrench), lever))


def test_a_folder_that_cannot_be_written_is_no_error(monkeypatch, tmp_path):
    def refuse(source):
        raise PermissionError(13, "Permission denied", str(source))

    monkeypatch.setattr(build, "build_source", refuse)
    assert build.library(tmp_path / "other.c") is None

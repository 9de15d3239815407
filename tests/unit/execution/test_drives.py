"""The loop knows its drive by the protocol alone: it runs one that no one here has thought of."""

import ast
from pathlib import Path

import numpy as np
import pytest
from skillframe_testkit.suites import HoldSkill

import skillframe
from skillframe.execution.drive import Shares
from skillframe.execution.executor import Loop, simulate
from skillframe.execution.recorder import Recorder
from skillframe.frames import Pose
from skillframe.skill import Broken, Ended, Observation
from skillframe.world.placement import fixture_poses, start_configurations
from skillframe.world.plant import Plant
from tests.laws.pushing import Push, impedance
from tests.laws.runs import generators, run, setup

PACKAGE = Path(skillframe.__file__).parent


def down(**options):
    return Push((0.0, 0.0, -1.0), impedance(), stall=False, **options)


class Bare:
    """A free tool pulled by the law's spring alone: no sensors, no filter, no tare."""

    actuators = ("tether",)

    def __init__(self, setting, count, fails=(), breaks=()):
        self.dt, self.count, self.fails, self.breaks = 1e-3, count, dict(fails), dict(breaks)
        robot, scene = setting.robot, setting.scene
        self.plant = Plant(robot, scene, count, fixture_poses(robot, {}, count), {}, timestep=self.dt)
        self.plant.reset(start_configurations(robot, scene, {}, count))
        self.coc, self.ended, self.stepped, self.energy = setting.center_of_compliance, [], [], np.zeros(count)

    def prepare(self):
        return [Broken(row, Ended.MACHINE, cause) for row, cause in self.fails.items()]

    def sense(self, tick, active):
        k = self.plant.kinematics(self.coc)
        twist = (k.jacobian @ k.velocity[..., None])[..., 0]
        self.jacobian, self.bias = k.jacobian, k.bias
        self.seen = Observation(
            np.full(self.count, tick * self.dt), self.dt,
            Pose(k.pose.at(self.coc).position, k.pose.rotation), twist, np.zeros((self.count, 6)),
        )  # fmt: skip
        return self.seen

    def act(self, command, ramp):
        law = self.seen.twist * [-20.0, -20.0, -20.0, -0.02, -0.02, -0.02]
        law[:, :3] += 1000.0 * (command.pose.position - self.seen.pose.position)
        self.law = law
        return law

    def violations(self, tick, active):
        return [Broken(r, Ended.FORCE, "the tether tore") for r, t in self.breaks.items() if t == tick and r in active]

    def advance(self, active):
        self.stepped.append(active.tolist())
        self.energy[active] += 1.0
        self.plant.step((np.swapaxes(self.jacobian, -1, -2) @ self.law[..., None])[..., 0] + self.bias, active)
        return [Broken(0, Ended.MACHINE, "the tether is gone at 7 ms")] if len(self.stepped) == 7 else []

    def end(self, rows):
        self.ended += rows.tolist()

    def contact_torque(self):
        return np.zeros(self.count)

    def shares(self):
        return Shares(self.energy, np.full(self.count, 0.25), np.full(self.count, 0.5))

    def notes(self, i):
        return [f"tether {i}"]

    def recording(self, every):
        return Recorder(self.plant, every, self.coc)

    def outcome(self, result):
        return result


def looped(drive, setting, skill=None, trace_hz=None, seconds=0.02):
    loop = Loop(skill or HoldSkill(), setting, drive, generators(drive.count), trace_hz)
    loop.prepare()
    loop.run(seconds, None)
    return loop.result()


def test_the_loop_runs_a_drive_of_another_s_and_ends_each_trial_once_where_that_says_so():
    setting = setup()
    drive = Bare(setting, 4, fails={1: "no tether at all"}, breaks={2: 10})
    result = looped(drive, setting, trace_hz=100.0)
    assert result.reason.tolist() == [
        "the tether is gone at 7 ms", "no tether at all", "the tether tore (at 0.010 s)",
        "time limit: 0.02 s of simulated time are over",
    ]  # fmt: skip
    assert result.ended_by.tolist() == ["machine", "machine", "force", "time"]
    assert result.duration_s.tolist() == [0.006, 0.0, 0.01, 0.02]
    assert drive.ended == [1, 0, 2, 3]
    assert drive.stepped == [[0, 2, 3]] * 7 + [[2, 3]] * 3 + [[3]] * 10
    assert result.energy_j.tolist() == [7.0, 0.0, 10.0, 20.0]
    assert result.peak_torque_share.tolist() == [0.25] * 4 and result.peak_speed_share.tolist() == [0.5] * 4
    assert result.traces[3].meta["actuators"] == ["tether"]
    assert [trace.meta["notes"] for trace in result.traces] == [[f"tether {i}"] for i in range(4)]


def test_contact_is_judged_by_the_loop_whatever_drives():
    """A tether of 1 kN/m that leads by 20 mm holds the tool in the valley with its 20 N; statics, at rest."""
    setting = setup()
    drive = Bare(setting, 1)
    drive.stepped = [None] * 7  # one that does not fail
    result = looped(drive, setting, down(speed=0.1), trace_hz=100.0, seconds=1.5)
    np.testing.assert_allclose(result.traces[0].wrench_true[-1, :3], [0.0, 0.0, 20.0], atol=0.2)  # 1 %: not quite still
    assert result.peak_force_n[0] >= result.peak_force_10ms_n[0] > 19.8


def test_a_run_without_its_last_tick_is_the_run():
    """Sense, act, advance in this order and once a tick: a run of 40 ms begins with one of 20 ms, bit for bit."""
    short, long = (run(down(), setup(), duration_s=seconds, trace_hz=1000).traces[0] for seconds in (0.02, 0.04))
    for name in ("position", "wrench", "command_wrench", "q"):
        np.testing.assert_array_equal(getattr(long, name)[:20], getattr(short, name)[:20])


def test_no_class_inherits_from_the_loop_and_it_imports_no_arm_and_no_oil():
    texts = (path.read_text(encoding="utf-8") for path in PACKAGE.rglob("*.py"))
    bases = {
        base
        for text in texts
        if "Loop" in text  # who inherits from it has to write its name
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.ClassDef)
        for base in map(ast.unparse, node.bases)
    }
    assert bases and not {base for base in bases if base.split(".")[-1] == "Loop"}
    tree = ast.parse((PACKAGE / "execution" / "executor.py").read_text(encoding="utf-8"))
    taken = {node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    assert {m for m in taken if m.startswith("skillframe.execution.drives")} == {"skillframe.execution.drives.choose"}
    rooms = {m.split(".")[1] for m in taken if m.startswith("skillframe.")}
    assert not rooms & {"machine", "cosim", "fmu", "robot", "signals"}
    assert {m for m in taken if m.startswith("skillframe.control")} == {"skillframe.control.contact"}


def test_simulate_hands_sensors_and_skill_generators_of_their_own():
    """A skill that draws leaves the sensors' noise as it is."""

    class Drawing(HoldSkill):
        def start(self, observation, rngs):
            super().start(observation, rngs)
            self.drawn = [rng.standard_normal(100) for rng in rngs]

    from skillframe.world.quantities import SensorSettings

    setting = setup(sensors=SensorSettings())
    plain, drawing = (
        simulate(skill, setting, {}, generators(2), duration_s=0.02, trace_hz=1000).traces
        for skill in (HoldSkill(), Drawing())
    )
    for one, other in zip(plain, drawing, strict=True):
        np.testing.assert_array_equal(one.wrench, other.wrench)


@pytest.mark.parametrize("robot", ["free_tool", "panda"])
def test_a_joint_that_no_fmu_drives_is_no_actuator(robot):
    trace = run(HoldSkill(), setup(robot), duration_s=0.01, trace_hz=100).traces[0]
    assert "actuators" not in trace.meta

"""Skills through DDS against the stand-in for the controller, in lockstep."""

import re
import threading

import numpy as np
import pytest
from nodes import HOST
from rehearsal import cell, rehearse
from skillframe_drive import identify as motions
from skillframe_drive import impedance
from skillframe_drive.cell import Cell
from skillframe_drive.fake import FakeArm
from skillframe_drive.identify import Motions
from skillframe_drive.runs import load_task, run_once
from skillframe_ros2.fake import FakeCrisp
from skillframe_ros2.link import Ros2Link

import skillframe
from skillframe import LearnedSkill
from skillframe.world.quantities import SensorSettings

MOVED = {"fixture.offset_x": 0.0033, "fixture.offset_y": 0.0022, "fixture.tilt_x": 0.0803}  # 4 mm and 4.6 degrees


class Tried:
    """A run of a skill at the tip on a stand-in in another thread.

    Attributes:
        run: the runner's result; arm: the truth; said: the stand-in's lines; fake: the stand-in.
    """

    def __init__(self, skill, world, *, coc="tip", duration_s=30.0, truth=None, **faults):
        sensors = SensorSettings(force_noise=0.3, torque_noise=0.02)
        self.arm, self.said = FakeArm("fr3", world, truth or {}, 0, sensors), []
        self.fake = FakeCrisp(self.arm, HOST, lockstep=True, faults=faults, say=self.said.append)
        ends = threading.Event()
        serving = threading.Thread(target=self.fake.run, args=(ends.is_set,))
        serving.start()
        task = load_task(Cell(robot="fr3", link="ros2", host=HOST, world=world, witness="pose"))
        try:
            link = Ros2Link(HOST)
            try:
                self.run = run_once(
                    LearnedSkill.load(skill), task, link, coc=coc, slow=1.0, dry=False, duration_s=duration_s,
                    rate_hz=100.0, done=lambda: self.arm.ground().goal,
                )  # fmt: skip
            finally:
                link.close()
        finally:
            ends.set()
            serving.join()
            self.fake.close()


def arrival(run):
    """Time from which the tool stays within 1 mm of where it ends [s]."""
    away = np.linalg.norm(run.trace.position - run.trace.position[-1], axis=-1).ravel()
    return run.trace.time[np.flatnonzero(away > 1e-3)[-1] + 1] - run.trace.time[0]


@pytest.mark.slow
def test_the_valley_is_the_simulated_one(valley_skill, monkeypatch):
    monkeypatch.setattr("skillframe_ros2.link.SILENT_S", 5.0)  # in lockstep the clock stands while the machine is busy
    tried = Tried(valley_skill, "valley")
    assert tried.run.success and tried.arm.ground().goal
    simulated = [skillframe.run(valley_skill, "valley", "fr3", seed=seed, coc="tip") for seed in range(3)]
    durations, peaks = (
        np.array([getattr(each, name) for each in simulated]) for name in ("duration_s", "peak_force_n")
    )
    assert arrival(tried.run) == pytest.approx(np.median([arrival(each) for each in simulated]), abs=0.011)
    # it ends after half a second at rest, which begins again where noise shows a motion
    assert 0.98 * durations.min() < tried.run.duration_s < durations.max() + 0.5
    assert peaks.min() - 2.0 < tried.run.peak_force_n < peaks.max() + 2.0
    assert tried.run.trace.meta["missed"] <= 1 and tried.fake.commands > 500
    stiffness, damping = (float(tried.fake._values[f"task.{each}_pos_z"]) for each in "kd")
    assert (
        damping > 1.5 * 2.0 * stiffness**0.5
    )  # from the robot's inertia of some 6 kg: the controller's own is for 1 kg


@pytest.mark.slow
def test_a_peg_whose_hole_is_moved_and_tilted_is_inserted_by_a_runner_that_is_not_told(tmp_path, monkeypatch):
    path = tmp_path / "peg.skill.json"
    skillframe.learn(skillframe.record("peg_in_hole", count=2, seed=3)).save(path)
    monkeypatch.setattr("skillframe_ros2.link.SILENT_S", 5.0)
    tried = Tried(path, "peg_in_hole", truth=MOVED)
    assert tried.arm.ground().goal and tried.run.success
    assert tried.run.trace.meta["missed"] <= 1


@pytest.mark.slow
@pytest.mark.parametrize(
    ("faults", "cause", "said"),
    [
        ({"cut": 0.3}, "no state from the robot for 100 ms", "the controller follows its last target"),
        ({"protective_stop": 0.3}, "no state from the robot for 100 ms", "the controllers are deactivated: planted"),
    ],
)
def test_a_fault_ends_the_run_in_time(valley_skill, faults, cause, said):
    tried = Tried(valley_skill, "valley", **faults)
    assert tried.run.failure.startswith(cause) and tried.run.trace.meta["ended_by"] == "link"
    assert any(said in line for line in tried.said)
    assert tried.run.duration_s == pytest.approx(0.3, abs=0.02)  # of the loop's clock, whose last tick waited 100 ms


@pytest.mark.slow
def test_a_centre_of_compliance_that_is_not_the_end_effector_is_refused_before_anything_is_sent(valley_skill):
    tried = Tried(valley_skill, "valley", coc=None)
    assert "frame tip is 200.0 mm" in tried.run.failure and tried.fake.commands == 0
    assert tried.fake._values["task.k_pos_x"] == 4000.0


@pytest.mark.slow
def test_from_the_command_line_a_check_sends_nothing(tmp_path):
    ended = rehearse("ros2", ["check", str(cell(tmp_path, "fr3", "ros2"))])
    assert ended.code == 0 and ended.said.count("ok ") == 4 and "500 states a second" in ended.said
    assert "0 commands" in ended.fake


class Weak(FakeCrisp):
    """A controller that renders 0.7 of the stiffness that it is sent along the axes, without saying so."""

    def change(self, values):
        super().change(values)
        stiffness, damping = self.gains
        self.gains = stiffness * np.repeat([0.7, 1.0], 3), damping


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "share", "friction"), [(FakeCrisp, 1.0, 0.0), (Weak, 0.7, 0.3)])
def test_planted_stiffness_and_friction_are_identified(monkeypatch, kind, share, friction):
    monkeypatch.setattr("skillframe_ros2.link.SILENT_S", 5.0)  # in lockstep the clock stands while the machine is busy
    for module in (motions, impedance):
        monkeypatch.setattr(module, "MOTIONS", Motions(tilt_s=0.5, held_s=0.2))
    sensors = SensorSettings(force_noise=0.3, torque_noise=0.02)
    arm = FakeArm("fr3", "valley", {"start.offset_z": 0.15, "robot.joint_friction": friction}, 0, sensors)
    fake, ends = kind(arm, HOST, lockstep=True), threading.Event()
    serving = threading.Thread(target=fake.run, args=(ends.is_set,))
    serving.start()
    try:
        link = Ros2Link(HOST)
        try:
            task = load_task(Cell(robot="fr3", link="ros2", host=HOST, world="valley"))
            found = impedance.identify_impedance(task, link, print, arm.tip)
        finally:
            link.close()
    finally:
        ends.set()
        serving.join()
        fake.close()
    along = [line for line in found.lines if line.text.startswith("along")]
    stiffness = [float(re.findall(r"([\d.]+) N/m where", line.text)[0]) for line in along]
    assert np.array(stiffness) / impedance.PROBES.stiffness[0] == pytest.approx([share] * 3, rel=0.04)
    assert all(bool(line.problem) == (share != 1.0) for line in along)
    assert found.vary["robot.joint_friction"][1] == pytest.approx(friction, abs=0.07)
    late = next(float(each) for line in found.lines for each in re.findall(r"(\d+) ms late", line.text))
    assert late <= 3.0  # of the way through DDS in lockstep, and of the controller's limit of the torques' rate

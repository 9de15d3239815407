"""The contact preset's figures: quiet sliding at a commanded force, Coulomb's ratio, small penetration."""

import mujoco
import numpy as np
import pytest

from skillframe.frames import Pose, norm
from skillframe.skill import Command, Impedance, Skill, Status, no_reasons
from skillframe.world.placement import fixture_poses
from skillframe.world.plant import Plant
from skillframe.world.quantities import SensorSettings
from tests.laws.pushing import Push, impedance
from tests.laws.runs import SILENT, run, setup

DOWN = (0.0, 0.0, -1.0)
FORCE, SETTLE, SPEED = 10.0, 1.5, 0.015


class Slide(Skill):
    """Press down with a commanded force, and after a while move along x."""

    def __init__(self, turn_stiffness=60.0):
        diagonal = [1000.0, 1000.0, 0.0, turn_stiffness, turn_stiffness, 20.0]
        self.impedance = Impedance(np.diag(diagonal))

    def start(self, observation, rngs):
        count = len(rngs)
        self.pose = Pose(observation.pose.position.copy(), observation.pose.rotation.copy())
        self.push, self.status, self.reason = np.zeros((count, 6)), np.full(count, Status.RUNNING), no_reasons(count)
        self.push[:, 2] = -FORCE

    def step(self, observation):
        twist = np.zeros_like(self.push)
        twist[:, 0] = SPEED * (observation.time > SETTLE)
        self.pose = Pose(self.pose.position + observation.dt * twist[:, :3], self.pose.rotation)
        return Command(self.pose, twist, self.impedance, self.push, self.status, self.reason)


def penetration(setting, trace, draws=None):
    """Deepest overlap of any contact over a trace [m], found again by the engine's collision detection."""
    robot, scene = setting.robot, setting.scene
    fixture = fixture_poses(robot, draws or {}, 1)
    plant = Plant(robot, scene, 1, fixture, {})
    data = mujoco.MjData(plant.model)
    plant.reset(trace.q[:1])
    data.mocap_pos[0] = fixture.position[0]
    deepest = 0.0
    for qpos in plant.engine_order(trace.q):
        data.qpos[:] = qpos
        mujoco.mj_kinematics(plant.model, data)
        mujoco.mj_collision(plant.model, data)
        if data.ncon:
            deepest = max(deepest, -float(data.contact.dist[: data.ncon].min()))
    return deepest


@pytest.mark.slow
@pytest.mark.parametrize("robot", ["free_tool", "panda"])
@pytest.mark.parametrize("fillet", [0.005, 0.0005])
@pytest.mark.parametrize("sensors", [SILENT, SensorSettings()], ids=["silent", "noisy"])
def test_sliding_at_a_commanded_force_is_quiet_and_obeys_coulomb(robot, fillet, sensors):
    """A flat-ended peg with a fillet, or hardly any, at 10 N over a plate, also with noisy encoders in the loop."""
    friction = np.array([0.1, 0.2, 0.4])
    setting = setup(robot, "hose_coupler", params={"radius": 0.0165, "length": 0.08, "fillet": fillet}, sensors=sensors)
    draws = {"start.offset_x": -0.02, "world.friction": friction}
    result = run(Slide(), setting, draws, 3, duration_s=4.5, trace_hz=1000)
    for mu, trace in zip(friction, result.traces, strict=True):
        force = trace.wrench_true[trace.time > SETTLE + 0.5, :3]
        ratio = norm(force[:, :2]).mean() / force[:, 2].mean()
        print(f"{robot}, fillet {1e3 * fillet:g} mm, friction {mu:g}: Fz {force[:, 2].mean():.2f} +- "
              f"{force[:, 2].std():.3f} N, friction ratio {ratio:.4f}")  # fmt: skip
        assert force[:, 2].min() > 0.0  # contact is never lost
        assert force[:, 2].std() <= 0.35
        assert force[:, 2].mean() == pytest.approx(FORCE, rel=0.02)
        assert ratio == pytest.approx(mu, rel=0.02)


@pytest.mark.slow
@pytest.mark.parametrize(("world", "stiffness", "draw", "speed", "duration"), [
    ("valley", impedance("x"), {"start.offset_x": 0.02}, 0.03, 2.0),
    ("peg_in_hole", impedance("x", "y"), {"start.tilt_y": 0.14}, 0.02, 5.0),
    ("peg_in_hole", impedance("x", "y"), {"start.tilt_y": 0.03, "start.offset_x": 0.002}, 0.02, 5.0),
])  # fmt: skip
@pytest.mark.parametrize("robot", ["free_tool", "panda"])
def test_contacts_overlap_by_less_than_130_micrometres(robot, world, stiffness, draw, speed, duration):
    setting = setup(robot, world)
    result = run(Push(DOWN, stiffness, speed=speed), setting, draw, duration_s=duration, trace_hz=1000)
    assert result.success.all()
    found = penetration(setting, result.traces[0])
    print(f"{robot} in {world}: penetration {1e6 * found:.0f} um, largest force {result.peak_force_n[0]:.0f} N")
    assert found <= 130e-6

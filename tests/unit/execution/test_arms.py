"""Several arms in the one loop: what a coordinator sees, what each arm feels, and one arm with another at rest."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from skillframe_testkit.suites import HoldSkill, ScriptedSkill
from skillframe_worlds import peg_in_hole

from skillframe.errors import SkillframeError, UnknownName
from skillframe.execution.drives.arms import FirstArm, simulate_arms
from skillframe.execution.executor import Setup, simulate
from skillframe.execution.prepare import load_robot_model
from skillframe.frames import Pose, matrix_from_quaternion, norm, rotation_matrix, rotation_vector
from skillframe.robot.kinematics import at
from skillframe.skill import Command, Impedance, Skill, Status, no_reasons
from skillframe.world.placement import fixture_poses, start_configurations
from skillframe.world.plant import Plant
from skillframe.world.quantities import SensorSettings
from skillframe.world.scene import Holder

QUIET = SensorSettings(
    force_noise=0.0, torque_noise=0.0, force_bias=0.0, torque_bias=0.0, position_noise=0.0, rotation_noise=0.0
)


@cache
def scene():
    """The peg in a hole that a second arm can hold."""
    whole = peg_in_hole.build(peg_in_hole.PegParams())
    return replace(whole, holder=Holder(tool=whole.tool, position=(0.0, 0.0, 0.15)))


@cache
def robot(name="dual_panda"):
    return load_robot_model(name)


def setup(**changes):
    return replace(Setup(robot=robot(), scene=scene(), center_of_compliance=np.zeros((2, 3)), sensors=QUIET), **changes)


def rngs(count):
    return [np.random.default_rng(i) for i in range(count)]


class Approach(Skill):
    """Both arms move towards each other, and what was seen is kept."""

    def __init__(self, speed=0.02):
        self.speed = speed

    def start(self, observation, rngs):
        self.home, self.first, self.seen = observation.pose, observation, []

    def step(self, observation):
        n, arms = observation.time.shape
        self.seen.append(observation)
        ahead = np.array([1.0, -1.0])[:, None] * np.array([1.0, 0.0, 0.0]) * self.speed
        pose = self.home._replace(position=self.home.position + ahead * observation.time[..., None])
        twist = np.zeros((n, arms, 6))
        twist[..., :3] = ahead
        gain = Impedance(np.diag([800.0] * 3 + [40.0] * 3))
        return Command(pose, twist, gain, np.zeros((n, arms, 6)), np.zeros(n, np.int64), no_reasons(n))


def test_a_coordinator_sees_a_row_for_every_arm():
    skill = Approach()
    simulate_arms(skill, setup(), {}, rngs(3), duration_s=0.01)
    seen = skill.first
    assert seen.time.shape == (3, 2)
    assert seen.pose.position.shape == (3, 2, 3) and seen.pose.rotation.shape == (3, 2, 3, 3)
    assert seen.twist.shape == seen.wrench.shape == (3, 2, 6)


@pytest.mark.slow
def test_trials_are_bit_identical_in_any_company():
    draws = {"start.tilt_y": np.array([0.1, -0.05, 0.02]), "robot.joint_friction": np.array([0.0, 0.3, 0.5])}
    noisy = setup(sensors=SensorSettings())
    together = simulate_arms(Approach(), noisy, draws, rngs(3), duration_s=0.3, trace_hz=100)
    for i in range(3):
        mine = {key: value[i : i + 1] for key, value in draws.items()}
        alone = simulate_arms(Approach(), noisy, mine, [np.random.default_rng(i)], duration_s=0.3, trace_hz=100)
        for arm in ("left", "right"):
            for name in ("position", "wrench", "q", "command_wrench"):
                a, b = getattr(alone.arm_traces[0][arm], name), getattr(together.arm_traces[i][arm], name)
                assert np.array_equal(a, b)


def test_each_arm_has_its_own_part_of_pinocchio_s_kinematics():
    q = start_configurations(robot(), scene(), {}, 1)
    plant = Plant(robot(), scene(), 1, fixture_poses(robot(), {}, 1), {})
    plant.reset(q)
    nominal = at(robot(), q[0], np.zeros(14))
    point = np.array([0.01, 0.02, 0.1])
    for view, frame in zip(plant.arms(), robot().tool_frames, strict=True):
        found = view.kinematics(point)
        # two independent codes on the same figures: rounding only
        assert np.allclose(found.pose.position[0], nominal.pose(frame).position, atol=1e-10)
        assert np.allclose(found.jacobian[0], nominal.jacobian(frame, point), atol=1e-10)
        assert len(view.dofs) == 7
    left, right = (view.dofs for view in plant.arms())
    assert not plant.mass_matrix()[0][np.ix_(left, right)].any()


def test_the_fixture_starts_where_the_robot_is_told_in_the_second_arm_s_hand():
    draws = {"fixture.offset_z": np.array([0.004])}
    wanted = fixture_poses(robot(), draws, 1)
    plant = Plant(robot(), scene(), 1, wanted, draws)
    plant.reset(start_configurations(robot(), scene(), draws, 1))
    held = plant.fixture_pose()
    assert np.allclose(held.position, wanted.position, atol=1e-8)  # tolerance of the inverse kinematics, with lever
    assert np.allclose(held.rotation, wanted.rotation, atol=1e-8)


def test_arms_in_contact_feel_opposite_forces():
    result = simulate_arms(
        Approach(), setup(), {"start.offset_x": np.array([0.02])}, rngs(1), duration_s=1.0, trace_hz=100
    )
    left, right = (result.arm_traces[0][arm].wrench_true[:, :3] for arm in ("left", "right"))
    assert norm(left).max() > 5.0
    assert np.abs(left + right).max() < 1e-9 * norm(left).max()  # Newton's third law, to rounding


def test_the_sensors_of_both_arms_read_that_force():
    result = simulate_arms(
        Approach(0.01), setup(), {"start.offset_x": np.array([0.02])}, rngs(1), duration_s=1.5, trace_hz=100
    )
    for trace in result.arm_traces[0].values():
        late = trace.time > 1.0  # the push has built up; what is left is the tools' inertia
        assert np.abs(trace.wrench[late, 0] - trace.wrench_true[late, 0]).max() < 1.0


def test_arms_that_hold_do_not_move():
    result = simulate(HoldSkill(duration=0.5), setup(center_of_compliance=np.zeros(3)), {}, rngs(1), trace_hz=100)
    assert result.status[0] == Status.SUCCESS
    assert result.joint_path_rad.max() < 1e-3  # settling of the law on a compensated arm


def test_a_skill_for_one_arm_runs_on_the_first_while_the_second_stands_still():
    sideways = ScriptedSkill(lambda time: np.outer(0.03 * time, [0.0, 1.0, 0.0]))
    away = {"start.offset_z": np.array([0.05])}
    result = simulate(sideways, setup(center_of_compliance=np.zeros(3)), away, rngs(1), duration_s=1.0, trace_hz=100)
    moved = [norm(t.position[-1] - t.position[0]) for t in result.arm_traces[0].values()]
    assert moved[0] > 0.02
    assert moved[1] < 1e-4
    assert len(result.traces) == 1 and result.traces[0].meta["arm"] == "left"


def test_the_first_arm_s_damping_is_the_skill_s_own():
    class Damped(HoldSkill):
        def step(self, observation):
            wanted = super().step(observation)
            return wanted._replace(impedance=Impedance(np.eye(6), 7.0 * np.eye(6)))

    both = FirstArm(Damped())
    skill = Approach()
    simulate_arms(skill, setup(), {}, rngs(2), duration_s=0.002)
    both.start(skill.first, rngs(2))
    gains = both.step(skill.first).impedance
    assert np.array_equal(gains.damping[1, 0], 7.0 * np.eye(6))
    assert np.array_equal(gains.stiffness[0, 0], np.eye(6))
    assert gains.stiffness[0, 1, 0, 0] > 1000.0


def test_a_limit_broken_by_one_arm_ends_the_trial_and_names_the_arm():
    limits = replace(robot().spec.limits, force_n=10.0)
    weak = replace(robot(), spec=replace(robot().spec, limits=limits))
    result = simulate_arms(
        Approach(0.05), setup(robot=weak), {"start.offset_x": np.array([0.02, 0.02])}, rngs(2), duration_s=2.0
    )
    assert all("arm '" in text and "force limit" in text for text in result.failure)
    assert not result.success.any()


def test_joint_friction_has_its_share_in_the_wrist():
    plant = Plant(robot(), scene(), 1, fixture_poses(robot(), {}, 1), {"robot.joint_friction": np.array([0.4])})
    loss = plant.batch.expand("dof_frictionloss")[0]
    assert np.allclose(loss, [0.4, 0.4, 0.4, 0.4, 0.2, 0.2, 0.2] * 2)


def test_a_robot_with_one_arm_is_refused_in_words():
    for run in (simulate_arms, simulate):
        with pytest.raises(SkillframeError, match="needs a robot with two arms"):
            run(Approach(), setup(robot=robot("panda")), {}, rngs(1))


def test_a_world_with_nothing_to_hold_is_refused_in_words():
    bare = replace(scene(), holder=None)
    with pytest.raises(SkillframeError, match="whose fixture can be held"):
        simulate_arms(Approach(), setup(scene=bare), {}, rngs(1))


def test_an_unknown_quantity_is_refused():
    with pytest.raises(UnknownName):
        simulate_arms(Approach(), setup(), {"start.tilt_w": np.zeros(1)}, rngs(1))


def test_a_robot_with_one_arm_finds_the_fixture_standing_still():
    alone = setup(robot=robot("panda"), center_of_compliance=np.zeros(3))
    plain = replace(alone, scene=replace(scene(), holder=None))
    found = [simulate(HoldSkill(duration=0.1), s, {}, rngs(1), trace_hz=100).traces[0] for s in (alone, plain)]
    assert np.array_equal(found[0].q, found[1].q)
    assert np.array_equal(found[0].wrench, found[1].wrench)


def test_how_far_each_tool_has_turned_since_the_start_is_in_the_result():
    """As the first and the last sample of its trace say; a millisecond of 0.5 rad/s lies between."""

    class Turn(Approach):
        def step(self, observation):
            command = super().step(observation)
            angle = np.zeros((*observation.time.shape, 3))
            angle[:, 0, 2] = 0.5 * observation.time[:, 0]
            return command._replace(pose=Pose(self.home.position, rotation_matrix(angle) @ self.home.rotation))

    result = simulate_arms(Turn(), setup(), {}, rngs(2), duration_s=0.3, trace_hz=1000)
    for i, by_arm in enumerate(result.arm_traces):
        for arm, name in enumerate(result.arms):
            first, last = matrix_from_quaternion(by_arm[name].quaternion[[0, -1]])
            np.testing.assert_allclose(result.turned_rad[i, arm], rotation_vector(last @ first.T), atol=2e-3)
    assert (result.turned_rad[:, 0, 2] > 0.02).all()  # behind the 0.15 rad asked for by the lag of a soft law

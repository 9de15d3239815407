import numpy as np
import pytest

from skillframe.control.impedance import null_space_damping
from skillframe.frames import Pose, cross, norm, rotate, rotation_matrix
from skillframe.robot.kinematics import at
from skillframe.world.placement import fixture_poses, start_configurations
from skillframe.world.plant import Plant
from tests.references import attach_payload

ALL = np.arange
GRAVITY = np.array([0.0, 0.0, -9.81])


def hold(plant, ticks=1):
    """Compensate gravity exactly, so that nothing moves."""
    for _ in range(ticks):
        plant.step(plant.kinematics(np.zeros(3)).bias.copy(), ALL(plant.count))


def press(plant, force, ticks, damping=60.0):
    """Push the tip with a constant force (3,) against gravity-compensated, damped motion until it rests."""
    tip = np.array(plant.scene.tool.frames["tip"])
    wrench = np.concatenate([force, np.zeros(3)])
    for _ in range(ticks):
        kinematics = plant.kinematics(tip)
        twist = (kinematics.jacobian @ kinematics.velocity[..., None])[..., 0]
        law = wrench - np.array([damping] * 3 + [1.0] * 3) * twist
        torque = (np.swapaxes(kinematics.jacobian, 1, 2) @ law[..., None])[..., 0] + kinematics.bias
        quiet = null_space_damping(kinematics.jacobian, plant.mass_matrix(), 10.0)
        plant.step(torque + (quiet @ kinematics.velocity[..., None])[..., 0], ALL(plant.count))


@pytest.mark.parametrize("robot_name", ["free_tool", "panda"])
@pytest.mark.parametrize("tilt", [(0.0, 0.0, 0.0), (0.4, 0.0, 0.0), (0.2, -0.5, 0.3)])
def test_a_tool_held_still_weighs_on_the_sensor_as_in_closed_form(plant, robot_name, tilt):
    """F = R^T m g and T = c x F in the sensor's axes, as the wrench on the tool."""
    now = plant(robot_name, "free", {f"start.tilt_{a}": v for a, v in zip("xyz", tilt, strict=True)})
    hold(now)
    tool, rotation = now.scene.tool, now.tool_pose().rotation[0]
    weight = rotation.T @ (tool.mass * GRAVITY)
    expected = np.concatenate([weight, cross(np.array(tool.center_of_mass), weight)])
    np.testing.assert_allclose(now.sensor_wrench()[0], expected, atol=1e-9)


def test_the_sensor_reads_the_tool_s_inertial_forces_when_it_accelerates(plant):
    """Held by nothing, a free tool falls: the sensor between carrier and tool reads nothing."""
    now = plant("free_tool", "free")
    now.step(np.zeros((1, 6)), ALL(1))
    np.testing.assert_allclose(now.sensor_wrench(), 0.0, atol=1e-9)


@pytest.mark.parametrize("robot_name", ["free_tool", "panda"])
def test_the_contact_wrench_balances_the_push_at_rest(plant, robot_name):
    now = plant(robot_name, "hose_coupler")
    force = np.array([0.5, 0.0, -10.0])
    press(now, force, 2200)
    tip = np.array(now.scene.tool.frames["tip"])
    wrench = now.contact_wrench(tip)[0]
    # the rest of a creep of some um/s under regularised friction, times 60 Ns/m
    np.testing.assert_allclose(wrench[:3], -force, atol=5e-3)
    np.testing.assert_allclose(now.contact_force(), norm(wrench[:3]), rtol=1e-12)
    np.testing.assert_allclose(wrench[3:], 0.0, atol=2e-3)  # pressed at the tip's middle: no moment there


def test_the_sensor_is_contact_plus_weight_once_the_tool_rests(plant):
    now = plant("free_tool", "hose_coupler")
    press(now, np.array([0.0, 0.0, -8.0]), 1500)
    pose, tool = now.tool_pose(), now.scene.tool
    contact = now.contact_wrench(np.zeros(3))[0]
    in_base = rotate(pose.rotation, now.sensor_wrench().reshape(2, 3)).reshape(6)
    weight = tool.mass * GRAVITY
    lever = rotate(pose.rotation, np.array(tool.center_of_mass))[0]
    np.testing.assert_allclose(in_base - contact, np.concatenate([weight, cross(lever, weight)]), atol=2e-3)


def test_moving_the_point_moves_the_contact_torque_by_the_lever(plant):
    now = plant("free_tool", "valley", {"start.offset_x": 0.01})
    press(now, np.array([0.0, 0.0, -10.0]), 300)
    tip, offset = np.array(now.scene.tool.frames["tip"]), np.array([0.02, -0.03, 0.05])
    here, there = now.contact_wrench(tip)[0], now.contact_wrench(offset)[0]
    lever = rotate(now.tool_pose().rotation, offset - tip)[0]
    np.testing.assert_allclose(there[:3], here[:3])
    np.testing.assert_allclose(there[3:], here[3:] - cross(lever, here[:3]), atol=1e-12)


def slide_ratio(now):
    """Tangential over normal force of the ball on the slope it slides down."""
    press(now, np.array([0.0, 0.0, -10.0]), 150, damping=200.0)
    normal = np.array([-np.sin(np.pi / 4), 0.0, np.cos(np.pi / 4)])  # of the side at x > 0
    force = now.contact_wrench(np.array(now.scene.tool.frames["tip"]))[:, :3]
    along = force @ normal
    return norm(force - along[:, None] * normal) / along


def test_friction_can_differ_from_trial_to_trial(plant):
    friction = np.array([0.1, 0.2, 0.35])
    now = plant("free_tool", "valley", {"start.offset_x": 0.03, "world.friction": friction}, count=3)
    np.testing.assert_allclose(slide_ratio(now), friction, rtol=0.02)


def test_a_moved_fixture_moves_what_is_touched_and_the_goal_but_not_the_robot(plant):
    height = np.array([0.0, 0.001])
    now = plant("free_tool", "hose_coupler", {"fixture.offset_z": height}, count=2)
    np.testing.assert_array_equal(now.tool_pose().position[0], now.tool_pose().position[1])
    state = now.tip_state()
    np.testing.assert_allclose(state.tip.position[1, 2], state.tip.position[0, 2] - 0.001, atol=1e-12)
    press(now, np.array([0.0, 0.0, -10.0]), 1000)
    np.testing.assert_allclose(np.diff(now.tool_pose().position[:, 2]), 0.001, atol=1e-6)
    np.testing.assert_allclose(now.tip_state().tip.position[0], now.tip_state().tip.position[1], atol=1e-6)


def test_a_tilted_fixture_turns_the_wrench_that_goals_see(plant):
    now = plant("free_tool", "hose_coupler", {"fixture.tilt_x": 0.1}, count=1)
    press(now, np.array([0.0, 0.0, -10.0]), 50)
    tip = np.array(now.scene.tool.frames["tip"])
    turn = rotation_matrix(np.array([0.1, 0.0, 0.0]))
    np.testing.assert_allclose(now.tip_state().wrench[0, :3], turn.T @ now.contact_wrench(tip)[0, :3], atol=1e-12)


def test_a_grasp_moves_the_tool_in_the_grip_and_not_the_wrist(plant):
    draws = {"grasp.offset_x": np.array([0.0, 0.003]), "grasp.tilt_y": np.array([0.0, 0.05])}
    now = plant("panda", "peg_in_hole", draws, count=2)
    wrist, tip = now.tool_pose(), now.tip_state().tip
    np.testing.assert_array_equal(wrist.position[0], wrist.position[1])
    nominal = np.array(now.scene.tool.frames["tip"])
    held = Pose(np.array([0.003, 0.0, 0.0]), rotation_matrix(np.array([0.0, 0.05, 0.0])))
    fixture = fixture_poses(now.robot, {}, 2)
    expected = fixture.inverse().compose(Pose(wrist.position, wrist.rotation).compose(held)).at(nominal)
    np.testing.assert_allclose(tip.position[1], expected.position[1], atol=1e-12)
    np.testing.assert_allclose(tip.rotation[1], expected.rotation[1], atol=1e-12)


def test_a_varied_mass_changes_the_plant_and_leaves_the_nominal_one_alone(robot, scene):
    """The truth's gravity load grows with its links. A controller that reads a nominal plant does not learn of it."""
    model, task = robot("panda"), scene("free")
    draws = {"robot.mass_scale": np.array([1.0, 1.3])}
    fixture, start = fixture_poses(model, draws, 2), start_configurations(model, task, draws, 2)
    truth, nominal = Plant(model, task, 2, fixture, draws), Plant(model, task, 2, fixture, {})
    truth.reset(start)
    qpos, qvel = truth.state
    nominal.set_state(qpos, qvel, ALL(2))
    tool = task.tool
    loaded = attach_payload(model.model, model.tool_frames[0], tool.mass, tool.center_of_mass, tool.inertia)
    expected = at(loaded, start[0], np.zeros(7))
    bare, light = at(model.model, start[0], np.zeros(7)), nominal.kinematics(np.zeros(3)).bias
    np.testing.assert_allclose(light, [expected.bias] * 2, atol=1e-10)
    np.testing.assert_allclose(nominal.mass_matrix(), [expected.mass] * 2, atol=1e-10)
    heavy = truth.kinematics(np.zeros(3)).bias
    np.testing.assert_allclose(heavy[0], expected.bias, atol=1e-10)
    np.testing.assert_allclose(heavy[1], expected.bias + 0.3 * bare.bias, atol=1e-9)  # links heavier, tool as it was
    np.testing.assert_allclose(truth.mass_matrix()[1], expected.mass + 0.3 * bare.mass, atol=1e-9)


def test_trials_that_are_not_stepped_stand_still(plant):
    now = plant("free_tool", "free", count=3)
    before = now.state[0].copy()
    now.step(np.zeros((3, 6)), np.array([1]))
    after = now.state[0]
    np.testing.assert_array_equal(after[[0, 2]], before[[0, 2]])
    assert not np.array_equal(after[1], before[1])


def test_a_reset_puts_everything_back(plant, robot, scene):
    now = plant("free_tool", "valley", count=2)
    start = start_configurations(robot("free_tool"), now.scene, {}, 2)
    press(now, np.array([0.0, 0.0, -5.0]), 100)
    now.reset(start)
    np.testing.assert_allclose(now.configuration, start, atol=1e-12)
    np.testing.assert_array_equal(now.state[1], 0.0)
    np.testing.assert_array_equal(now.contact_force(), 0.0)

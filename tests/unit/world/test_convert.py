import mujoco
import numpy as np
import pinocchio as pin
import pytest

from skillframe.errors import SkillframeError
from skillframe.frames import skew
from skillframe.robot.kinematics import at, random_configuration
from skillframe.robot.model import load_model
from skillframe.robot.spec import load_robot, robot_names
from skillframe.world.convert import build_spec
from skillframe.world.placement import fixture_poses
from skillframe.world.plant import Plant
from tests.references import attach_payload

ROBOTS = sorted(robot_names())
STATES = 20


def test_the_contact_preset_is_what_was_measured(robot, scene):
    """Chosen by measurement and locked: solimp that starts near 0 is what removes chatter while sliding (5 N of false
    noise with stiff values), impratio 20 is what keeps a jammed peg from creeping in; a ring-shaped contact needs
    condim 3 and the elliptic cone."""
    model = build_spec(robot("free_tool"), scene("peg_in_hole")).compile()
    option = model.opt
    assert option.timestep == 0.001
    assert option.integrator == mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    assert option.cone == mujoco.mjtCone.mjCONE_ELLIPTIC
    assert option.impratio == 20.0
    assert option.solver == mujoco.mjtSolver.mjSOL_NEWTON
    assert (option.iterations, option.tolerance, option.noslip_iterations) == (50, 1e-10, 0)
    assert not option.disableflags & mujoco.mjtDisableBit.mjDSBL_MULTICCD
    assert not option.enableflags & mujoco.mjtEnableBit.mjENBL_OVERRIDE
    collides = (model.geom_contype != 0) | (model.geom_conaffinity != 0)
    assert collides.sum() == 34  # 32 boxes, the bottom and the peg
    np.testing.assert_array_equal(model.geom_solref[collides], [[0.004, 1.0]] * 34)
    np.testing.assert_array_equal(model.geom_solimp[collides], [[0.01, 0.95, 1e-4, 0.5, 1.0]] * 34)
    np.testing.assert_array_equal(model.geom_condim[collides], 3)
    np.testing.assert_array_equal(model.geom_friction[collides], [[0.2, 0.0, 0.0]] * 34)


def test_a_diverging_trial_is_never_reset_by_the_engine(robot, scene):
    model = build_spec(robot("free_tool"), scene("valley")).compile()
    assert model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_AUTORESET


def test_the_arena_of_a_trial_is_small_enough_for_256_of_them(robot, scene):
    model = build_spec(robot("panda"), scene("peg_in_hole")).compile()
    assert 256 * model.narena < 1e9


def velocity_map(model, configuration):
    """Pinocchio's velocity out of MuJoCo's (nv, nv): a free base's linear velocity is in base axes for MuJoCo."""
    result = np.eye(model.nv)
    if model.joints[1].nq == 7:
        result[:3, :3] = pin.Quaternion(configuration[3:7]).matrix().T
    return result


def states(robot_model, scene):
    """A plant and a loaded Pinocchio model at the same random states. Velocities in both orders."""
    rng = np.random.default_rng(1)
    model = robot_model.model
    tool = scene.tool
    loaded = attach_payload(model, robot_model.tool_frames[0], tool.mass, tool.center_of_mass, tool.inertia)
    configurations = np.stack([random_configuration(model, rng) for _ in range(STATES)])
    plant = Plant(robot_model, scene, STATES, fixture_poses(robot_model, {}, STATES), {})
    plant.reset(configurations)
    velocity = rng.normal(size=(STATES, model.nv))
    qpos, _ = plant.state
    plant.set_state(qpos.copy(), velocity, np.arange(STATES))
    maps = np.stack([velocity_map(model, q) for q in configurations])
    return plant, loaded, configurations, velocity, maps


@pytest.mark.parametrize("name", ROBOTS)
def test_mass_matrix_equals_pinocchio_s_with_the_tool_in_the_grip(robot, scene, name):
    plant, loaded, configurations, velocity, maps = states(robot(name), scene("valley"))
    for i, (q, v, turn) in enumerate(zip(configurations, velocity, maps, strict=True)):
        expected = turn.T @ at(loaded, q, turn @ v).mass @ turn
        np.testing.assert_allclose(plant.mass_matrix()[i], expected, atol=1e-10)


@pytest.mark.parametrize("name", ROBOTS)
def test_bias_forces_equal_pinocchio_s_with_the_tool_in_the_grip(robot, scene, name):
    plant, loaded, configurations, velocity, maps = states(robot(name), scene("valley"))
    bias = plant.kinematics(np.zeros(3)).bias
    for i, (q, v, turn) in enumerate(zip(configurations, velocity, maps, strict=True)):
        state = at(loaded, q, turn @ v)
        transport = np.zeros(len(v))  # d(turn)/dt v: the base's axes turn under a velocity written in base axes
        if not np.array_equal(turn, np.eye(len(v))):
            transport[:3] = -skew((turn @ v)[3:6]) @ (turn @ v)[:3]
        expected = turn.T @ (state.bias + state.mass @ transport)
        np.testing.assert_allclose(bias[i], expected, atol=1e-10)


@pytest.mark.parametrize("name", ROBOTS)
def test_tool_pose_and_jacobian_equal_pinocchio_s_at_any_point_of_the_tool(robot, scene, name):
    plant, loaded, configurations, velocity, maps = states(robot(name), scene("valley"))
    frame, offset = robot(name).tool_frames[0], np.array([0.03, -0.02, 0.2])
    kinematics = plant.kinematics(offset)
    for i, (q, v, turn) in enumerate(zip(configurations, velocity, maps, strict=True)):
        state = at(loaded, q, turn @ v)
        np.testing.assert_allclose(kinematics.pose.position[i], state.pose(frame).position, atol=1e-10)
        np.testing.assert_allclose(kinematics.pose.rotation[i], state.pose(frame).rotation, atol=1e-10)
        np.testing.assert_allclose(kinematics.jacobian[i], state.jacobian(frame, offset) @ turn, atol=1e-10)
        np.testing.assert_allclose(kinematics.jacobian[i] @ v, state.twist(frame, offset), atol=1e-10)


@pytest.mark.parametrize("name", ROBOTS)
def test_a_configuration_survives_the_way_into_the_engine_s_order_and_back(robot, scene, name):
    plant, _, configurations, _, _ = states(robot(name), scene("valley"))
    there = plant.configuration
    same = np.minimum(np.abs(there - configurations).max(-1), np.abs(np.abs(there) - np.abs(configurations)).max(-1))
    assert same.max() < 1e-12  # a quaternion may come back with the other sign


def write_robot(folder, joints):
    """A branched arm, its URDF's joints named against the order of the tree, so that Pinocchio sorts them otherwise."""
    links = "".join(
        f'<link name="{n}"><inertial><origin xyz="0.02 {0.01 * i} 0.05"/><mass value="{1 + 0.3 * i}"/>'
        f'<inertia ixx="0.01" iyy="0.012" izz="0.008" ixy="0.001" ixz="0" iyz="0"/></inertial></link>'
        for i, n in enumerate(("l1", "l2", "l3", "l4", "tool"))
        if f'child link="{n}"' in joints
    )
    (folder / "arm.urdf").write_text(f'<robot name="arm"><link name="base"/>{links}{joints}</robot>')
    (folder / "robot.toml").write_text('urdf = "arm.urdf"\n[[arm]]\nname = "arm"\ntool_frame = "tool"\n')
    return folder / "robot.toml"


def joint(name, kind, parent, child, axis, extra=""):
    limit = "" if kind == "continuous" else '<limit lower="-1.5" upper="1.5" effort="50" velocity="2"/>'
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="0.1 0.05 0.2" rpy="0.3 -0.2 0.5"/><axis xyz="{axis}"/>{limit}{extra}</joint>'
    )


MIXED = (
    joint("z_first", "revolute", "base", "l1", "0 0 1")
    + joint("m_slide", "prismatic", "l1", "l2", "1 0 0")
    + joint("a_turns", "continuous", "l2", "tool", "0.6 0 0.8")
    + joint("b_side", "revolute", "l1", "l3", "0 0.28 0.96")
    + joint("c_skew_slide", "prismatic", "l3", "l4", "0.6 0.8 0")
)


def test_slides_skew_axes_continuous_joints_and_side_branches_agree_with_pinocchio(tmp_path, scene):
    model = load_model(load_robot(write_robot(tmp_path, MIXED)))
    plant, loaded, configurations, velocity, _ = states(model, scene("valley"))
    kinematics = plant.kinematics(np.array([0.0, 0.0, 0.2]))
    # order of velocities: the engine's, which goes through the tree as Pinocchio does
    for i, (q, v) in enumerate(zip(configurations, velocity, strict=True)):
        state = at(loaded, q, v)
        np.testing.assert_allclose(plant.mass_matrix()[i], state.mass, atol=1e-10)
        np.testing.assert_allclose(kinematics.bias[i], state.bias, atol=1e-10)
        jacobian = state.jacobian(model.tool_frames[0], np.array([0.0, 0.0, 0.2]))
        np.testing.assert_allclose(kinematics.jacobian[i], jacobian, atol=1e-10)
    turned = np.cos(plant.configuration - configurations)  # a continuous joint may come back a turn later
    np.testing.assert_allclose(turned, 1.0, atol=1e-12)


def test_joint_damping_friction_and_limits_reach_the_plant(tmp_path, scene):
    dynamics = '<dynamics damping="0.7" friction="0.4"/>'
    joints = joint("j", "revolute", "base", "l1", "0 0 1", dynamics) + joint("k", "revolute", "l1", "tool", "0 1 0")
    model = load_model(load_robot(write_robot(tmp_path, joints)))
    compiled = build_spec(model, scene("free")).compile()
    np.testing.assert_allclose(compiled.dof_damping, [0.7, 0.0])
    np.testing.assert_allclose(compiled.dof_frictionloss, [0.4, 0.0])
    np.testing.assert_allclose(compiled.jnt_range, [[-1.5, 1.5]] * 2)


def test_a_joint_that_the_world_cannot_hold_is_named(tmp_path, scene):
    model = load_model(load_robot(write_robot(tmp_path, joint("flat", "planar", "base", "tool", "0 0 1"))))
    with pytest.raises(SkillframeError, match="flat"):
        build_spec(model, scene("free"))


def test_a_joint_that_follows_another_says_how_to_simulate_it(tmp_path, scene):
    follower = joint("k", "prismatic", "base", "l1", "-1 0 0", '<mimic joint="j"/>')
    joints = joint("j", "prismatic", "base", "tool", "1 0 0") + follower
    model = load_model(load_robot(write_robot(tmp_path, joints)))
    with pytest.raises(SkillframeError, match="mimic = false"):
        build_spec(model, scene("free"))

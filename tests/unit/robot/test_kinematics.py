"""Laws of kinematics and dynamics, and inverse kinematics as the inverse of forward kinematics."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from skillframe.frames import Pose, rotation_matrix, rotation_vector
from skillframe.robot.kinematics import (
    UnreachablePose,
    at,
    inverse_kinematics,
    random_configuration,
    tool_pose,
)
from skillframe.robot.model import load_model
from skillframe.robot.spec import load_robot

DOWN = np.diag([1.0, -1.0, -1.0])


@pytest.fixture(scope="module", params=["panda", "free_tool", "ur5e", "fr3", "kuka_iiwa14"])
def robot(request):
    return load_model(load_robot(request.param))


@pytest.fixture(scope="module")
def panda():
    return load_model(load_robot("panda"))


def states(robot, count=20):
    rng = np.random.default_rng(1)
    return [(random_configuration(robot.model, rng), rng.normal(size=robot.model.nv)) for _ in range(count)]


def test_the_mass_matrix_is_symmetric_and_positive_definite(robot):
    for q, v in states(robot):
        mass = at(robot, q, v).mass
        np.testing.assert_array_equal(mass, mass.T)
        assert np.linalg.eigvalsh(mass).min() > 0.0


def test_kinetic_energy_is_that_of_the_bodies(robot):
    for q, v in states(robot):
        data = robot.model.createData()
        energy = pin.computeKineticEnergy(robot.model, data, q, v)
        assert 0.5 * v @ at(robot, q, v).mass @ v == pytest.approx(energy, rel=1e-12)


def test_power_of_the_bias_forces_is_the_change_of_potential_and_kinetic_energy(robot):
    # free motion: M a + b = 0, so the total energy stays; central differences over 1e-5 s: error ~ 1e-10 of ~ 100 W
    for q, v in states(robot):
        state = at(robot, q, v)
        a = -np.linalg.solve(state.mass, state.bias)
        energies = []
        for h in (-1e-5, 1e-5):
            data = robot.model.createData()
            moved, speed = pin.integrate(robot.model, q, h * v + 0.5 * h * h * a), v + h * a
            energies.append(pin.computeMechanicalEnergy(robot.model, data, moved, speed))
        scale = 1.0 + abs(v @ state.bias)
        assert abs(energies[1] - energies[0]) / 2e-5 < 1e-4 * scale


@pytest.mark.parametrize("offset", [None, np.array([0.05, -0.03, 0.2])])
def test_the_jacobian_is_the_derivative_of_the_points_pose(robot, offset):
    h = 1e-6  # central differences: error h^2 ~ 1e-12, rounding 1e-16 / h ~ 1e-10
    frame, shift = robot.tool_frames[0], np.zeros(3) if offset is None else offset
    for q, v in states(robot, 10):
        before, after = (
            tool_pose(robot.model, pin.integrate(robot.model, q, s * h * v), frame).at(shift) for s in (-1, 1)
        )
        twist = np.concatenate(
            [after.position - before.position, rotation_vector(after.rotation @ before.rotation.T)]
        ) / (2 * h)
        state = at(robot, q, v)
        np.testing.assert_allclose(state.twist(frame, offset), twist, atol=1e-8)
        np.testing.assert_allclose(state.jacobian(frame, offset) @ v, twist, atol=1e-8)
        np.testing.assert_allclose(state.pose(frame).position, tool_pose(robot.model, q, frame).position, atol=1e-14)


def test_the_pandas_flange_follows_its_published_denavit_hartenberg_table(panda):
    a, d = [0, 0, 0, 0.0825, -0.0825, 0, 0.088], [0.333, 0, 0.316, 0, 0.384, 0, 0]
    alpha = [0, -np.pi / 2, np.pi / 2, np.pi / 2, -np.pi / 2, np.pi / 2, np.pi / 2]

    def modified_dh(i, angle):
        (ca, sa), (c, s) = (np.cos(alpha[i]), np.sin(alpha[i])), (np.cos(angle), np.sin(angle))
        return np.array(
            [[c, -s, 0, a[i]], [s * ca, c * ca, -sa, -d[i] * sa], [s * sa, c * sa, ca, d[i] * ca], [0, 0, 0, 1]]
        )

    for q, _ in states(panda):
        flange = np.eye(4)
        for i in range(7):
            flange = flange @ modified_dh(i, q[i])
        flange = flange @ np.block([[np.eye(3), np.array([[0], [0], [0.107]])], [np.zeros((1, 3)), np.ones((1, 1))]])
        pose = tool_pose(panda.model, q, panda.tool_frames[0])
        np.testing.assert_allclose(np.c_[pose.rotation, pose.position], flange[:3], atol=1e-14)


def test_inverse_kinematics_undoes_forward_kinematics_within_the_limits(panda):
    rng = np.random.default_rng(2)
    for _ in range(60):
        pose = tool_pose(panda.model, random_configuration(panda.model, rng), panda.tool_frames[0])
        q = inverse_kinematics(panda, "arm", pose, panda.home)
        found = tool_pose(panda.model, q, panda.tool_frames[0])
        np.testing.assert_allclose(found.position, pose.position, atol=1e-8)  # asked for 1e-9
        np.testing.assert_allclose(found.rotation, pose.rotation, atol=1e-8)
        assert (q >= panda.model.lowerPositionLimit).all()
        assert (q <= panda.model.upperPositionLimit).all()


def test_near_home_inverse_kinematics_stays_near_home_and_is_repeatable(panda):
    rng = np.random.default_rng(3)
    for _ in range(40):
        place = np.array([0.5, 0.0, 0.45]) + rng.uniform(-0.05, 0.05, 3)
        pose = Pose(place, rotation_matrix(rng.uniform(-0.2, 0.2, 3)) @ DOWN)
        q = inverse_kinematics(panda, 0, pose, panda.home)
        assert np.abs(q - panda.home).max() < 0.7  # no change of the elbow's branch
        np.testing.assert_array_equal(q, inverse_kinematics(panda, 0, pose, panda.home))


def test_a_pose_out_of_reach_is_refused_with_what_is_missing(panda):
    with pytest.raises(UnreachablePose, match="arm 'arm' does not reach") as error:
        inverse_kinematics(panda, "arm", Pose(np.array([1.5, 0.0, 0.3]), DOWN), panda.home)
    assert 0.3 < error.value.residual_m < 1.0  # 1.5 m against 0.855 m of reach from 0.333 m of height


def _narrowed(panda, name, upper):
    """The arm with less range [rad] in one joint."""
    model = panda.model.copy()
    limits = model.upperPositionLimit
    limits[model.joints[model.getJointId(name)].idx_q] = upper
    model.upperPositionLimit = limits
    return replace(panda, model=model)


@pytest.mark.parametrize("upper", [-1.8, -2.1, -2.4])
@pytest.mark.slow
def test_a_joint_named_in_a_refusal_stands_at_its_limit_and_that_limit_is_what_holds_the_arm(panda, upper):
    name = "joint4"  # the elbow alone decides how far the arm reaches; every other joint has a way round
    pose = Pose(np.array([0.7, 0.0, 0.45]), DOWN)  # the whole arm reaches it
    inverse_kinematics(panda, "arm", pose, panda.home)
    with pytest.raises(UnreachablePose, match=rf"held by joint limits \(rad or m\): .*{name} at {upper}") as error:
        inverse_kinematics(_narrowed(panda, name, upper), "arm", pose, panda.home)
    assert error.value.limits[name] == upper
    less = upper - 0.1  # the further the limit is in the way, the more is missing
    with pytest.raises(UnreachablePose) as worse:
        inverse_kinematics(_narrowed(panda, name, less), "arm", pose, panda.home)
    assert worse.value.residual_m + worse.value.residual_rad > error.value.residual_m + error.value.residual_rad


def test_no_limit_is_named_where_none_holds_the_arm(save, urdf):
    parts = [urdf.link("l0")]
    for i, axis in enumerate(["0 0 1", "1 0 0", "1 0 0", "0 0 1", "1 0 0", "0 0 1"]):
        parts += [urdf.link(f"l{i + 1}", urdf.inertial(1, 0.3))]
        parts += [urdf.joint(f"j{i}", f"l{i}", f"l{i + 1}", "continuous", axis, inside="")]
    arm = load_model(load_robot(save(urdf.robot(*parts), '[[arm]]\nname = "arm"\ntool_frame = "l6"')))
    with pytest.raises(UnreachablePose) as error:
        inverse_kinematics(arm, "arm", Pose(np.array([50.0, 0.0, 0.0]), DOWN), arm.home)
    assert error.value.limits == {} and "limits" not in str(error.value)


@pytest.mark.parametrize("base", ["free_tool", "tree"])
def test_a_free_base_is_placed_exactly_and_its_joints_stay(save, urdf, base):
    toml = 'base = "free"\n[[arm]]\nname = "arm"\ntool_frame = "l3"'
    robot = load_model(load_robot("free_tool" if base == "free_tool" else save(urdf.tree(5, 4), toml)))
    rng = np.random.default_rng(4)
    for _ in range(20):
        q0 = random_configuration(robot.model, rng)
        pose = Pose(rng.uniform(-1, 1, 3), rotation_matrix(rng.uniform(-2, 2, 3)))
        q = inverse_kinematics(robot, "arm", pose, q0)
        found = tool_pose(robot.model, q, robot.tool_frames[0])
        np.testing.assert_allclose(found.position, pose.position, atol=1e-14)
        np.testing.assert_allclose(found.rotation, pose.rotation, atol=1e-14)
        np.testing.assert_array_equal(q[7:], q0[7:])


def test_inverse_kinematics_works_with_continuous_joints_and_several_arms(save, urdf):
    arms = "".join(f'[[arm]]\nname = "{n}"\ntool_frame = "{n}6"\n' for n in "lr")
    parts, axes = [urdf.link("base")], ["0 0 1", "1 0 0", "1 0 0", "0 0 1", "1 0 0", "0 0 1"]
    for side in "lr":
        for i, axis in enumerate(axes):
            parent = f"{side}{i}" if i else "base"
            parts += [urdf.link(f"{side}{i + 1}", urdf.inertial(1, 0.3))]
            parts += [urdf.joint(f"{side}j{i}", parent, f"{side}{i + 1}", "continuous", axis, inside="")]
    robot = load_model(load_robot(save(urdf.robot(*parts), arms)))
    rng = np.random.default_rng(5)
    for _ in range(10):
        q0, q1 = (random_configuration(robot.model, rng) for _ in range(2))
        pose = tool_pose(robot.model, q1, robot.tool_frames[1])
        q = inverse_kinematics(robot, "r", pose, q0)
        np.testing.assert_allclose(tool_pose(robot.model, q, robot.tool_frames[1]).position, pose.position, atol=1e-8)
        np.testing.assert_array_equal(q[: robot.model.nq // 2], q0[: robot.model.nq // 2])  # the other arm stays


def test_the_shipped_panda_stands_at_its_home_as_its_readme_says(panda):
    pose = tool_pose(panda.model, panda.home, panda.tool_frames[0])
    np.testing.assert_allclose(pose.position, [0.5, 0.0, 0.45], atol=1e-6)  # home is written with six digits
    np.testing.assert_allclose(pose.rotation, DOWN, atol=1e-12)
    margin = np.minimum(panda.home - panda.model.lowerPositionLimit, panda.model.upperPositionLimit - panda.home)
    assert margin.min() > 0.8
    np.testing.assert_array_equal(panda.model.effortLimit, [87, 87, 87, 87, 12, 12, 12])

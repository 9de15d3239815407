"""The wrench that the controller exerts, against that of the simulation's impedance controller."""

import numpy as np
import pytest
from direct_link import arm
from skillframe_drive.link import Spring
from skillframe_ros2 import law
from skillframe_ros2.fake import FakeCrisp, exponential, logarithm

from skillframe.control.controller import ImpedanceController, Reading
from skillframe.frames import Pose, rotation_matrix
from skillframe.skill import Command, Impedance, no_reasons


def full(rng, size):
    """A symmetric positive definite matrix (6, 6) whose axes are not those of the tool."""
    turn = np.linalg.qr(rng.normal(size=(6, 6)))[0]
    matrix = turn @ np.diag(size * rng.uniform(0.05, 1.0, 6)) @ turn.T
    return 0.5 * (matrix + matrix.T)


@pytest.fixture(scope="module")
def moving_arm():
    """An FR3 that moves in all joints, its tool tilted."""
    moving = arm("fr3", noise=0.0, bias=0.0)
    for _ in range(300):
        moving.step(np.array([3.0, -2.0, 2.0, 1.5, 0.6, -0.5, 0.4]))
    return moving


@pytest.mark.parametrize("seed", range(3))
def test_the_controller_exerts_the_torques_of_equation_1_for_matrices_that_are_not_diagonal(moving_arm, seed):
    rng = np.random.default_rng(seed)
    at, lever = moving_arm.pose.at(moving_arm.tip), moving_arm.pose.rotation[0] @ moving_arm.tip
    jacobian = moving_arm.jacobian.copy()
    jacobian[:3] += np.cross(np.eye(3), lever).T @ jacobian[3:]  # v + w x r
    twist = jacobian @ moving_arm.velocity
    assert np.abs(twist).max() > 0.02
    desired = Pose(
        at.position + rng.normal(0, 0.01, (1, 3)), rotation_matrix(rng.normal(0, 0.05, (1, 3))) @ at.rotation
    )
    command = Command(
        desired, rng.normal(0, 0.1, (1, 6)), Impedance(full(rng, 1000.0), full(rng, 150.0)), rng.normal(0, 5.0, (1, 6)),
        np.zeros(1, dtype=np.int64), no_reasons(1),
    )  # fmt: skip
    reading = Reading(
        at, twist[None], jacobian[None], np.zeros((1, 7)), moving_arm.velocity[None], lambda: np.eye(7)[None]
    )
    _, wrench = ImpedanceController(1).torque(command, reading)
    spring = Spring(desired, at, twist, *command.impedance, wrench[0])
    stiffness, damping = (law.diagonal(each, at.rotation[0]) for each in command.impedance)

    fake = FakeCrisp(moving_arm, "127.0.0.1")
    try:
        fake.change(law.parameters(stiffness, damping) | {"nullspace.damping": 0.0})
        fake._target = fake._smooth = logarithm(desired)
        fake._wrench = law.target_wrench(spring, stiffness, damping)
        assert fake._law() == pytest.approx(jacobian.T @ wrench[0], abs=1e-8)
        assert np.abs(fake._wrench).max() > 1.0  # couplings, feed-forward and desired motion
        fake._wrench = np.zeros(6)
        assert np.abs(fake._law() - jacobian.T @ wrench[0]).max() > 0.1
    finally:
        fake.close()


def test_the_controller_s_own_wrench_is_a_spring_and_a_damper_along_the_tool_s_axes():
    """A tool whose x axis is base y: 10 mm and 0.1 m/s along base y are along its x, and a turn about z about its z."""
    measured = Pose(np.zeros((1, 3)), rotation_matrix(np.array([[0.0, 0.0, np.pi / 2]])))
    desired = Pose(np.array([[0.0, 0.01, 0.0]]), rotation_matrix(np.array([[0.0, 0.0, np.pi / 2 + 0.1]])))
    twist = np.array([0.0, 0.1, 0.0, 0.2, 0.0, 0.0])  # the turn about base x is about its -y
    stiffness, damping = np.array([100.0, 200.0, 300.0, 4.0, 5.0, 6.0]), np.array([30.0, 40.0, 50.0, 1.0, 2.0, 3.0])
    expected = [100.0 * 0.01 - 30.0 * 0.1, 0.0, 0.0, 0.0, 2.0 * 0.2, 6.0 * 0.1]
    assert law.exerted(desired, measured, twist, stiffness, damping) == pytest.approx(expected, abs=1e-12)
    assert law.diagonal(np.diag(stiffness), measured.rotation[0]) == pytest.approx([200.0, 100.0, 300.0, 5.0, 4.0, 6.0])


def test_an_error_beyond_the_clip_is_exerted_whole():
    """The controller's own part is limited, and the target wrench has the rest."""
    far = Pose(np.array([[0.3, 0.0, 0.0]]), np.eye(3)[None])
    here = Pose(np.zeros((1, 3)), np.eye(3)[None])
    wrench = np.array([300.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    spring = Spring(far, here, np.zeros(6), np.diag([1000.0] * 6), np.eye(6), wrench)
    assert law.exerted(far, here, np.zeros(6), np.full(6, 1000.0), np.ones(6))[0] == pytest.approx(100.0)
    assert law.target_wrench(spring, np.full(6, 1000.0), np.ones(6))[0] == pytest.approx(200.0)


@pytest.mark.parametrize("angle", [0.0, 1e-6, 0.7, 2.0, 3.1, np.pi])
def test_the_logarithm_of_a_pose_is_undone(angle):
    axis = np.array([[0.6, -0.64, 0.48]])
    pose = Pose(np.array([[0.5, -0.1, 0.3]]), rotation_matrix(angle * axis))
    again = exponential(logarithm(pose))
    assert again.position == pytest.approx(pose.position, abs=1e-9)
    assert again.rotation == pytest.approx(pose.rotation, abs=1e-9)
    if angle == 0.7:  # its translation is not the position: constant twist for one second
        from scipy.linalg import logm

        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = pose.rotation[0], pose.position[0]
        assert logarithm(pose)[:3] == pytest.approx(logm(matrix)[:3, 3].real, abs=1e-9)


def test_null_space_damping_leaves_the_tip_alone(moving_arm):
    fake = FakeCrisp(moving_arm, "127.0.0.1")
    try:
        fake.change(law.parameters(np.zeros(6), np.ones(6)))
        jacobian = moving_arm.jacobian
        torque = fake._null_space(jacobian)
        assert np.abs(torque).max() > 1e-3
        assert jacobian @ np.linalg.solve(moving_arm.mass_matrix(), torque) == pytest.approx(np.zeros(6), abs=1e-9)
        assert torque @ moving_arm.velocity < 0.0
    finally:
        fake.close()

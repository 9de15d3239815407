import numpy as np

from skillframe.control.controller import REFRESH, ImpedanceController, Reading
from skillframe.control.impedance import critical_damping, task_inertia
from skillframe.frames import Pose
from skillframe.skill import Command, Impedance, no_reasons

MASS = np.diag([2.0, 2.0, 2.0, 0.1, 0.1, 0.1])


def reading(count=2, freedoms=6, velocity=0.0):
    jacobian = np.zeros((count, 6, freedoms))
    jacobian[:, :, :6] = np.eye(6)
    speed = np.full((count, freedoms), velocity)
    calls = []

    def mass_matrix():
        calls.append(1)
        mass = np.eye(freedoms)
        mass[:6, :6] = MASS
        return np.broadcast_to(mass, (count, freedoms, freedoms))

    pose = Pose(np.zeros((count, 3)), np.broadcast_to(np.eye(3), (count, 3, 3)))
    bias = np.arange(freedoms) * np.ones((count, 1))
    return Reading(pose, speed[:, :6], jacobian, bias, speed, mass_matrix), calls


def command(stiffness, damping=None, count=2, position=0.0, twist=0.0, feedforward=0.0):
    pose = Pose(np.full((count, 3), position), np.broadcast_to(np.eye(3), (count, 3, 3)))
    zero = np.zeros((count, 6))
    return Command(
        pose, zero + twist, Impedance(stiffness, damping), zero + feedforward, np.zeros(count, int), no_reasons(count)
    )


def test_torque_is_the_transposed_jacobian_times_the_law_plus_the_bias():
    now, _ = reading()
    torque, law = ImpedanceController(2).torque(command(1000.0 * np.eye(6), np.eye(6), position=0.01), now)
    np.testing.assert_allclose(law[:, :3], 10.0)
    np.testing.assert_allclose(torque, law + now.bias)


def test_the_ramp_fades_desired_twist_and_feed_forward_but_never_the_damping_of_motion():
    now, _ = reading(velocity=0.5)
    controller, wanted = ImpedanceController(2), command(np.zeros((6, 6)), 2.0 * np.eye(6), twist=1.0, feedforward=3.0)
    np.testing.assert_allclose(controller.torque(wanted, now, 0.0)[1], -1.0)
    np.testing.assert_allclose(controller.torque(wanted, now, 0.5)[1], 1.5)
    np.testing.assert_allclose(controller.torque(wanted, now, 1.0)[1], 4.0)


def test_damping_is_designed_once_for_a_stiffness_and_not_again():
    now, calls = reading(velocity=0.1)
    controller, stiffness = ImpedanceController(2), 500.0 * np.eye(6)
    _, law = controller.torque(command(stiffness), now)
    expected = critical_damping(stiffness[None], task_inertia(now.jacobian[:1], MASS[None]))
    np.testing.assert_allclose(law[0], -0.1 * expected[0].sum(-1))
    controller.torque(command(stiffness.copy()), now)
    assert len(calls) == 1


def test_a_stiffness_changed_in_place_is_noticed():
    now, _ = reading(velocity=0.1)
    controller, stiffness = ImpedanceController(2), 100.0 * np.eye(6)
    _, soft = controller.torque(command(stiffness), now)
    stiffness *= 9.0
    _, stiff = controller.torque(command(stiffness), now)
    np.testing.assert_allclose(stiff, 3.0 * soft)  # d = 2 sqrt(k m)


def test_only_the_row_whose_stiffness_changed_gets_a_new_damping():
    now, _ = reading(velocity=0.1)
    controller, both = ImpedanceController(2), np.repeat(100.0 * np.eye(6)[None], 2, axis=0)
    _, before = controller.torque(command(both), now)
    changed = both.copy()
    changed[1] *= 4.0
    _, after = controller.torque(command(changed), now)
    np.testing.assert_array_equal(after[0], before[0])
    np.testing.assert_allclose(after[1], 2.0 * before[1])


def test_a_robot_without_redundancy_has_no_null_space_torque_and_a_seventh_joint_has():
    now, _ = reading(freedoms=7, velocity=0.2)
    torque, law = ImpedanceController(2).torque(command(np.eye(6), np.eye(6)), now)
    np.testing.assert_allclose(torque[:, :6], law + now.bias[:, :6], atol=1e-6)
    np.testing.assert_allclose(torque[:, 6] - now.bias[:, 6], -10.0 * 0.2)  # -d m q'


def test_the_null_space_projector_is_refreshed_every_so_many_ticks():
    now, calls = reading(freedoms=7)
    controller = ImpedanceController(2)
    for _ in range(2 * REFRESH):
        controller.torque(command(np.eye(6), np.eye(6)), now)
    assert len(calls) == 2

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from skillframe.control.impedance import (
    DAMPING_FLOOR,
    critical_damping,
    impedance_wrench,
    null_space_damping,
    task_inertia,
)
from skillframe.frames import Pose, move_twist, move_wrench, pose_error, rotation_matrix

seeds = st.integers(0, 2**31)


def random_pose(rng, count=1, angle=1.0):
    return Pose(rng.normal(size=(count, 3)), rotation_matrix(angle * rng.normal(size=(count, 3))))


def positive_definite(rng, size, count=1, low=0.1, high=10.0):
    basis, _ = np.linalg.qr(rng.normal(size=(count, size, size)))
    values = np.exp(rng.uniform(np.log(low), np.log(high), size=(count, 1, size)))
    return (basis * values) @ np.swapaxes(basis, -1, -2)


@given(seeds)
def test_at_the_desired_pose_and_twist_the_wrench_is_the_feed_forward(seed):
    rng = np.random.default_rng(seed)
    pose, feedforward = random_pose(rng, 3), rng.normal(size=(3, 6))
    wrench = impedance_wrench(
        pose, pose, np.zeros((3, 6)), positive_definite(rng, 6, 3, high=1e3), positive_definite(rng, 6, 3), feedforward
    )
    np.testing.assert_allclose(wrench, feedforward, atol=1e-12)  # a rotation times its transpose is 1 to 2e-16


@given(seeds)
def test_damping_never_puts_power_into_the_tool(seed):
    rng = np.random.default_rng(seed)
    pose, twist = random_pose(rng), rng.normal(size=(1, 6))
    damping = critical_damping(positive_definite(rng, 6, high=1e3), positive_definite(rng, 6))
    wrench = impedance_wrench(pose, pose, -twist, np.zeros((6, 6)), damping, np.zeros((1, 6)))
    assert (wrench * twist).sum() < 0.0


@given(seeds)
def test_the_spring_pulls_towards_the_desired_pose(seed):
    rng = np.random.default_rng(seed)
    here, wanted = random_pose(rng), random_pose(rng)
    error = pose_error(wanted, here)
    wrench = impedance_wrench(wanted, here, np.zeros((1, 6)), np.eye(6), np.zeros((6, 6)), np.zeros((1, 6)))
    np.testing.assert_allclose(wrench, error, atol=1e-12)  # unit stiffness: the very same numbers
    np.testing.assert_allclose(rotation_matrix(error[:, 3:]) @ here.rotation, wanted.rotation, atol=1e-9)


@given(seeds, st.floats(0.1, 2.0))
def test_critical_damping_of_decoupled_axes_is_two_zeta_root_of_k_m(seed, ratio):
    rng = np.random.default_rng(seed)
    stiffness, inertia = rng.uniform(10.0, 1000.0, 6), rng.uniform(0.1, 10.0, 6)
    damping = critical_damping(np.diag(stiffness)[None], np.diag(inertia)[None], ratio, floor=(0.0, 0.0))
    np.testing.assert_allclose(damping[0], np.diag(2.0 * ratio * np.sqrt(stiffness * inertia)), rtol=1e-9, atol=1e-9)


@given(seeds)
def test_critical_damping_holds_in_any_axes(seed):
    """Turning stiffness and inertia turns the damping: each half is a tensor."""
    rng = np.random.default_rng(seed)
    stiffness, inertia = np.zeros((1, 6, 6)), positive_definite(rng, 6)
    stiffness[:, :3, :3], stiffness[:, 3:, 3:] = positive_definite(rng, 3, high=1e3), positive_definite(rng, 3, high=50)
    turn = np.kron(np.eye(2), rotation_matrix(rng.normal(size=3)))
    turned = critical_damping(turn @ stiffness @ turn.T, turn @ inertia @ turn.T)
    np.testing.assert_allclose(turned, turn @ critical_damping(stiffness, inertia) @ turn.T, atol=1e-8)


def test_a_compliant_axis_keeps_the_damping_floor_and_the_others_their_design():
    damping = critical_damping(
        np.diag([0.0, 900.0, 900.0, 0.0, 25.0, 25.0])[None], np.diag([4.0] * 3 + [0.25] * 3)[None]
    )
    np.testing.assert_allclose(np.diag(damping[0]), [DAMPING_FLOOR[0], 120.0, 120.0, DAMPING_FLOOR[1], 5.0, 5.0])


@given(seeds)
def test_designed_damping_is_symmetric_and_never_below_the_floor(seed):
    rng = np.random.default_rng(seed)
    stiffness = positive_definite(rng, 6, low=1e-3, high=1e3)
    damping = critical_damping(stiffness, positive_definite(rng, 6))[0]
    np.testing.assert_allclose(damping, damping.T, atol=1e-10)
    for part, least in ((slice(0, 3), DAMPING_FLOOR[0]), (slice(3, 6), DAMPING_FLOOR[1])):
        assert np.linalg.eigvalsh(damping[part, part]).min() > least - 1e-9


def test_the_energy_of_a_mass_on_the_controlled_spring_only_falls():
    """Translation of a free body under equation (1), semi-implicit Euler at 1 ms. Damped, so the integrator's own
    energy error (of order dt^2, 1e-6 relative) is far below what is dissipated."""
    inertia = np.diag([2.6, 2.6, 2.6, 0.05, 0.05, 0.05])[None]
    stiffness = np.diag([0.0, 1000.0, 1000.0, 20.0, 20.0, 20.0])
    damping = critical_damping(stiffness, inertia)[0]
    x, v, dt = np.array([0.02, 0.01, -0.03]), np.array([0.3, -0.2, 0.1]), 1e-3
    wanted = Pose(np.zeros((1, 3)), np.eye(3)[None])
    energies = []
    for _ in range(2000):
        energies.append(0.5 * 2.6 * v @ v + 0.5 * x @ stiffness[:3, :3] @ x)
        twist = np.concatenate([v, np.zeros(3)])[None]
        force = impedance_wrench(wanted, Pose(x[None], np.eye(3)[None]), -twist, stiffness, damping, np.zeros((1, 6)))[
            0, :3
        ]
        v = v + dt * force / 2.6
        x = x + dt * v
    assert np.all(np.diff(energies) <= 1e-9)
    assert energies[-1] < 1e-3 * energies[0]


@given(seeds)
def test_power_is_the_same_at_any_point_of_the_tool(seed):
    rng = np.random.default_rng(seed)
    twist, wrench, shift = rng.normal(size=(4, 6)), rng.normal(size=(4, 6)), rng.normal(size=(4, 3))
    here = (twist * wrench).sum(-1)
    there = (move_twist(twist, shift) * move_wrench(wrench, shift)).sum(-1)
    np.testing.assert_allclose(there, here, atol=1e-10)


@given(seeds)
def test_the_task_inertia_of_a_unit_jacobian_is_the_mass_matrix(seed):
    mass = positive_definite(np.random.default_rng(seed), 6)
    # eps = 1e-6 in the mobility changes inertias of up to 10 kg by up to 1e-5 of themselves
    np.testing.assert_allclose(task_inertia(np.eye(6)[None], mass), mass, rtol=1e-4, atol=1e-4)


@given(seeds)
def test_null_space_torques_do_no_work_on_the_task_and_dissipate(seed):
    rng = np.random.default_rng(seed)
    jacobian, mass = rng.normal(size=(1, 6, 7)), positive_definite(rng, 7)
    if np.linalg.cond(jacobian[0] @ np.linalg.solve(mass[0], jacobian[0].T)) > 1e6:
        return  # near a singularity the regularisation (1e-9) shows
    velocity = rng.normal(size=7)
    torque = null_space_damping(jacobian, mass, 10.0)[0] @ velocity
    np.testing.assert_allclose(
        jacobian[0] @ np.linalg.solve(mass[0], torque), 0.0, atol=1e-4 * (1.0 + np.abs(torque).max())
    )
    assert velocity @ torque <= 1e-9


def test_a_motion_in_the_null_space_decays_at_the_stated_rate():
    """For q' in the kernel of J the torque is -d M q': the velocity decays as exp(-d t)."""
    rng = np.random.default_rng(4)
    jacobian, mass = rng.normal(size=(1, 6, 7)), positive_definite(rng, 7)
    velocity = np.linalg.svd(jacobian[0])[2][-1]
    acceleration = np.linalg.solve(mass[0], null_space_damping(jacobian, mass, 10.0)[0] @ velocity)
    np.testing.assert_allclose(acceleration, -10.0 * velocity, rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize("where", ["stiffness", "inertia"])
def test_a_row_that_is_no_number_has_no_damping_and_leaves_the_others_theirs(where):
    rng = np.random.default_rng(1)
    given = {"stiffness": positive_definite(rng, 6, 3, high=1e3), "inertia": positive_definite(rng, 6, 3)}
    whole = critical_damping(**given)
    given[where][1] = np.nan
    found = critical_damping(**given)
    assert np.isnan(found[1][:3, :3]).all()
    np.testing.assert_array_equal(found[[0, 2]], whole[[0, 2]])


@pytest.mark.parametrize("count", [1, 5])
def test_rows_are_worked_out_independently_and_bit_for_bit(count):
    rng = np.random.default_rng(0)
    stiffness, inertia = positive_definite(rng, 6, 5, high=1e3), positive_definite(rng, 6, 5)
    whole = critical_damping(stiffness, inertia)
    np.testing.assert_array_equal(critical_damping(stiffness[:count], inertia[:count]), whole[:count])

"""Laws of rotations, poses and wrenches. Examples would only repeat the formulas."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from skillframe import frames
from skillframe.frames import Pose

RNG = np.random.default_rng(3)
ROTATIONS = frames.rotation_matrix(RNG.normal(size=(64, 3)))
POSITIONS = RNG.normal(size=(64, 3))
POSES = Pose(POSITIONS, ROTATIONS)
ROUNDING = 1e-14  # a few operations on numbers of order one

coordinates = st.floats(-1.0, 1.0, allow_nan=False)
axes = st.tuples(coordinates, coordinates, coordinates).filter(lambda v: np.linalg.norm(v) > 1e-3)
angles_below_pi = st.floats(0.0, np.pi - 1e-3)


def unit(axis):
    return np.array(axis) / np.linalg.norm(axis)


def pick(pose, i):
    return Pose(pose.position[i], pose.rotation[i])


def assert_same(a, b, tolerance=1e-13):
    np.testing.assert_allclose(a.position, b.position, atol=tolerance)
    np.testing.assert_allclose(a.rotation, b.rotation, atol=tolerance)


def test_continuous_quaternions_keep_their_orientation_and_never_jump():
    turns = frames.rotation_matrix(np.linspace(0, 9, 50)[:, None] * np.array([0.3, 0.5, 0.8]))
    quaternion = frames.quaternion_from_matrix(turns)
    smooth = frames.continuous(quaternion)
    assert np.allclose(frames.matrix_from_quaternion(smooth), turns)
    assert (smooth[1:] * smooth[:-1]).sum(-1).min() > 0.0 > (quaternion[1:] * quaternion[:-1]).sum(-1).min()


def test_composition_of_poses_is_associative():
    a, b, c = (pick(POSES, slice(i, i + 20)) for i in (0, 20, 40))
    assert_same(a.compose(b).compose(c), a.compose(b.compose(c)))


def test_composing_with_the_inverse_gives_the_identity_from_both_sides():
    identity = Pose(np.zeros((64, 3)), np.broadcast_to(np.eye(3), (64, 3, 3)))
    assert_same(POSES.compose(POSES.inverse()), identity)
    assert_same(POSES.inverse().compose(POSES), identity)


def test_rotations_are_orthonormal_and_right_handed():
    np.testing.assert_allclose(
        ROTATIONS @ np.swapaxes(ROTATIONS, -1, -2), np.broadcast_to(np.eye(3), (64, 3, 3)), atol=ROUNDING
    )
    np.testing.assert_allclose(np.linalg.det(ROTATIONS), 1.0, atol=ROUNDING)


def test_a_point_fixed_in_a_frame_moves_as_the_composed_pose_does():
    offset = RNG.normal(size=(64, 3))
    as_pose = POSES.compose(Pose(offset, np.broadcast_to(np.eye(3), (64, 3, 3))))
    assert_same(POSES.at(offset), as_pose)


@given(axes, angles_below_pi)
def test_logarithm_undoes_exponential_below_pi(axis, angle):
    vector = angle * unit(axis)
    # atan2 loses at most a few ulp of pi, divided by the sine, which is above 1e-3 here
    np.testing.assert_allclose(frames.rotation_vector(frames.rotation_matrix(vector)), vector, atol=1e-11)


@pytest.mark.parametrize("angle", [0.0, 1e-300, 1e-12, 1e-9, 1e-7, 1e-6, 2e-6, 1e-4])
def test_logarithm_undoes_exponential_near_zero_to_relative_precision(angle):
    for axis in (unit([1, 2, 3]), unit([0, 0, 1]), unit([-1, 1, 0])):
        # sine - asymmetric part cancels at 1e-16 absolute: relative to the angle plus that rounding
        np.testing.assert_allclose(
            frames.rotation_vector(frames.rotation_matrix(angle * axis)), angle * axis, atol=3e-16
        )


@pytest.mark.parametrize("gap", [0.0, 1e-12, 1e-8, 1e-6, 1e-5, 9e-5, 1.1e-4, 1e-3])
def test_exponential_undoes_logarithm_near_pi(gap):
    for axis in (unit([1, 2, 3]), unit([0, 0, 1]), unit([-1, 1, 0]), unit([1e-5, 1, -1e-5])):
        rotation = frames.rotation_matrix((np.pi - gap) * axis)
        again = frames.rotation_matrix(frames.rotation_vector(rotation))
        # just outside the special branch the sine is 1e-4, so rounding of 1e-16 grows to 1e-12
        np.testing.assert_allclose(again, rotation, atol=3e-12)


@given(axes, st.floats(0.0, 50.0))
def test_the_angle_of_a_logarithm_is_never_above_pi(axis, angle):
    assert frames.norm(frames.rotation_vector(frames.rotation_matrix(angle * unit(axis)))) <= np.pi + 1e-15


def test_logarithm_of_a_batch_equals_logarithms_one_by_one():
    near_pi = frames.rotation_matrix(np.array([[np.pi, 0, 0], [0, 3.14159, 0], [0.1, 0.2, 0.3], [0, 0, 0]]))
    one_by_one = np.stack([frames.rotation_vector(r) for r in near_pi])
    assert np.array_equal(frames.rotation_vector(near_pi), one_by_one)


@given(axes, st.floats(-np.pi, np.pi))
def test_quaternion_and_matrix_round_trip(axis, angle):
    rotation = frames.rotation_matrix(angle * unit(axis))
    quaternion = frames.quaternion_from_matrix(rotation)
    np.testing.assert_allclose(frames.norm(quaternion), 1.0, atol=ROUNDING)
    assert quaternion[3] >= 0.0
    np.testing.assert_allclose(frames.matrix_from_quaternion(quaternion), rotation, atol=1e-14)


@given(axes, angles_below_pi)
def test_quaternions_put_the_scalar_last(axis, angle):
    quaternion = frames.quaternion_from_matrix(frames.rotation_matrix(angle * unit(axis)))
    expected = np.append(np.sin(angle / 2) * unit(axis), np.cos(angle / 2))
    np.testing.assert_allclose(quaternion, expected, atol=1e-14)


def test_both_signs_and_any_length_of_a_quaternion_mean_the_same_rotation():
    q = RNG.normal(size=(32, 4))
    expected = frames.matrix_from_quaternion(q)
    np.testing.assert_allclose(frames.matrix_from_quaternion(-3.0 * q), expected, atol=ROUNDING)


def test_power_does_not_depend_on_the_point_where_wrench_and_twist_are_taken():
    wrench, twist, shift = RNG.normal(size=(64, 6)), RNG.normal(size=(64, 6)), RNG.normal(size=(64, 3))
    moved = (frames.move_wrench(wrench, shift) * frames.move_twist(twist, shift)).sum(-1)
    np.testing.assert_allclose(moved, (wrench * twist).sum(-1), atol=1e-13)


def test_power_does_not_depend_on_the_axes():
    wrench, twist = RNG.normal(size=(64, 6)), RNG.normal(size=(64, 6))
    turned = (frames.rotate_spatial(ROTATIONS, wrench) * frames.rotate_spatial(ROTATIONS, twist)).sum(-1)
    np.testing.assert_allclose(turned, (wrench * twist).sum(-1), atol=1e-13)


def test_moving_a_wrench_there_and_back_changes_nothing():
    wrench, shift = RNG.normal(size=(64, 6)), RNG.normal(size=(64, 3))
    np.testing.assert_allclose(frames.move_wrench(frames.move_wrench(wrench, shift), -shift), wrench, atol=ROUNDING)


def test_moving_leaves_its_argument_alone():
    wrench = np.ones((4, 6))
    frames.move_wrench(wrench, np.ones(3))
    frames.move_twist(wrench, np.ones(3))
    assert np.all(wrench == 1.0)


def test_a_shift_with_more_dimensions_than_the_wrench_gives_one_wrench_a_shift():
    wrench, shifts = RNG.normal(size=6), RNG.normal(size=(5, 3))
    expected = np.stack([frames.move_wrench(wrench, shift) for shift in shifts])
    np.testing.assert_array_equal(frames.move_wrench(wrench, shifts), expected)


def test_cross_and_skew_are_the_cross_product():
    a, b = RNG.normal(size=(2, 7, 3)), RNG.normal(size=(7, 3))
    np.testing.assert_allclose(frames.cross(a, b), np.cross(a, b), atol=ROUNDING)
    np.testing.assert_allclose((frames.skew(a) @ b[..., None])[..., 0], np.cross(a, b), atol=ROUNDING)


def test_a_zero_vector_has_no_direction_and_stays_zero():
    assert np.array_equal(frames.unit(np.zeros((2, 3))), np.zeros((2, 3)))
    np.testing.assert_allclose(frames.norm(frames.unit(POSITIONS)), 1.0, atol=ROUNDING)


def test_the_quaternion_of_a_matrix_is_the_same_to_the_bit_alone_and_among_many():
    """All four rows of Shepperd's method, their ties, and what is no rotation."""
    rng = np.random.default_rng(0)
    special = [np.eye(3), *(np.diag(d) for d in ([1.0, -1, -1], [-1.0, 1, -1], [-1.0, -1, 1])), np.zeros((3, 3))]
    odd = [np.full((3, 3), value) for value in (np.nan, np.inf, 1.0)]
    many = np.concatenate([frames.rotation_matrix(3.0 * rng.normal(size=(400, 3))), special, odd])
    with np.errstate(invalid="ignore"):
        together = frames.quaternion_from_matrix(many)
        for count in (1, 2, 4):
            for i in range(0, len(many) - count):
                np.testing.assert_array_equal(
                    frames.quaternion_from_matrix(many[i : i + count]), together[i : i + count]
                )
        np.testing.assert_array_equal(frames.quaternion_from_matrix(many[3]), together[3])

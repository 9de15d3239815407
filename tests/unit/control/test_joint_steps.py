"""From a twist to joint velocities: exact far from singularities, in its direction at limits, never wound up."""

import numpy as np
import pytest

from skillframe.control.joint_steps import LEASH_SLACK, POSTURE, JointRange, JointSteps

DT = 2e-3
FREE = JointRange(np.full(7, np.inf), np.full(7, -np.inf), np.full(7, np.inf))


def jacobian(joints=7, seed=1):
    """Far from singular: a row for each joint, all of them for the seventh, and a bit of every other."""
    whole = np.concatenate([np.eye(6), np.ones((6, 1))], axis=1)[None, :, :joints]
    return whole + 0.2 * np.random.default_rng(seed).normal(size=(1, 6, joints))


def steps(limits, joints=7, start=None, delay=0.03):
    limits = JointRange(*(part[:joints] for part in limits))
    return JointSteps(np.zeros((1, joints)) if start is None else start, limits, delay, DT)


def range_of(velocity=np.inf, lower=-np.inf, upper=np.inf):
    return JointRange(*(np.full(7, float(value)) for value in (velocity, lower, upper)))


TWIST = np.array([[0.01, -0.02, 0.005, 0.1, 0.05, -0.2]])
REST = np.zeros((1, 7))


@pytest.mark.parametrize("joints", [6, 7])
def test_far_from_a_singularity_the_twist_is_made(joints):
    j = jacobian(joints)
    speed, made = steps(FREE, joints).velocities(TWIST, j, REST[:, :joints], REST[:, :joints])
    np.testing.assert_allclose(made, TWIST, rtol=1e-3, atol=1e-6)  # l^2 = 1e-6 beside squares of singular values near 1
    np.testing.assert_allclose((j @ speed[..., None])[..., 0], made, atol=1e-15)


def test_a_spare_joint_goes_back_to_where_it_began_and_the_tool_does_not_notice():
    j, away = jacobian(), np.full((1, 7), 0.1)
    speed, made = steps(FREE).velocities(np.zeros((1, 6)), j, away, away)
    kernel = np.linalg.svd(j[0])[2][6]
    np.testing.assert_allclose(made, np.zeros((1, 6)), atol=1e-5)
    np.testing.assert_allclose(speed[0], -POSTURE * kernel * (kernel @ away[0]), atol=5e-5)  # l bends 0.05 by 1e-3


def test_near_a_singularity_joints_stay_slow():
    """Along a direction that is all but lost, 0.01 m/s would need 5 rad/s; with l = 0.05, 2e-5 / 0.05^2."""
    j = np.eye(6)[None].copy()
    j[0, 0, 0] = 2e-3
    speed, made = steps(FREE, 6).velocities(np.array([[0.01, 0.02, 0, 0, 0, 0]]), j, REST[:, :6], REST[:, :6])
    assert speed[0, 0] == pytest.approx(2e-5 / 0.05**2, rel=0.01)
    assert made[0, 1] == pytest.approx(0.02, rel=0.01)


def test_the_fastest_joint_is_at_its_limit_and_the_direction_is_kept():
    j = jacobian()
    free, wanted = steps(FREE).velocities(TWIST, j, REST, REST)
    speed, made = steps(range_of(velocity=0.01)).velocities(TWIST, j, REST, REST)
    assert np.abs(speed).max() == pytest.approx(0.01)
    np.testing.assert_allclose(made / np.linalg.norm(made), wanted / np.linalg.norm(wanted), atol=1e-12)
    assert np.abs(free).max() > 0.01


def test_a_joint_at_the_end_of_its_range_is_held_and_the_others_make_the_twist():
    j = jacobian()
    free, _ = steps(FREE).velocities(TWIST, j, REST, REST)
    upper = np.full(7, np.inf)
    upper[np.argmax(free[0])] = 0.0
    speed, made = steps(JointRange(np.full(7, np.inf), np.full(7, -np.inf), upper)).velocities(TWIST, j, REST, REST)
    assert speed[0, np.argmax(free[0])] == 0.0
    np.testing.assert_allclose(made, TWIST, rtol=0.01, atol=1e-4)


def test_no_step_ever_leaves_the_range_even_where_several_joints_are_at_its_end():
    rng = np.random.default_rng(4)
    limits = range_of(lower=-1e-4, upper=1e-4)
    for seed in range(50):
        speed, made = steps(limits).velocities(20.0 * rng.normal(size=(1, 6)), jacobian(seed=seed), REST, REST)
        assert np.all(np.abs(DT * speed) <= 1e-4 + 1e-12)
        np.testing.assert_allclose(made[0], jacobian(seed=seed)[0] @ speed[0], atol=1e-12)


def test_from_the_end_of_its_range_a_joint_may_come_back():
    j = np.eye(6)[None]
    at_end = np.full((1, 6), 1.0)
    speed, _ = steps(range_of(upper=1.0), 6).velocities(-TWIST, j, at_end, at_end)
    np.testing.assert_allclose(speed[0, 0], -0.01, rtol=1e-3)
    assert speed[0, 1] == 0.0


def test_a_command_too_far_ahead_of_the_joints_waits_until_they_follow_and_one_that_comes_back_does_not():
    leash = 2.0 * 0.03 + LEASH_SLACK
    j = np.eye(6)[None]
    for ahead, waits in ((1.01 * leash, True), (0.99 * leash, False)):
        command = np.zeros((1, 6))
        command[0, 0] = ahead
        for sign in (1.0, -1.0):
            speed, made = steps(range_of(velocity=2.0), 6).velocities(sign * TWIST, j, command, REST[:, :6])
            assert (not speed.any()) == (waits and sign > 0.0)
            assert (not made.any()) == (waits and sign > 0.0)


def test_a_row_does_not_depend_on_its_neighbours_be_they_stuck_or_not_finite():
    j = np.concatenate([jacobian(seed=s) for s in range(3)])
    j[2] = np.nan
    twist = np.tile(TWIST, (3, 1))
    many = JointSteps(np.zeros((3, 7)), range_of(0.02, -1e-5, 1e-5), 0.03, DT)
    alone = steps(range_of(0.02, -1e-5, 1e-5))
    for _ in range(3):
        three, one = (s.velocities(twist[:n], j[:n], np.zeros((n, 7)), np.zeros((n, 7)))[0]
                      for s, n in ((many, 3), (alone, 1)))  # fmt: skip
        np.testing.assert_array_equal(three[:1], one)

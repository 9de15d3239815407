from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from skillframe_dualarm.document import CONFIGURATIONS, Arm, Phase, configured, relative
from skillframe_dualarm.runtime import DualArm, stiffnesses

from skillframe.frames import Pose, rotation_matrix
from skillframe.skill import Observation, Status

TIP = (0.0, 0.0, 0.15)
FRAMES = {"wrist": (0.0, 0.0, 0.0), "tip": TIP}
PHASE = Phase(arms=(Arm(center_of_compliance=TIP, share=1.0), Arm(center_of_compliance=TIP)))
DT = 1e-3


def observe(time, position, rotation, twist=None):
    n = len(position)
    twist = np.zeros((n, 2, 6)) if twist is None else twist
    return Observation(np.full((n, 2), time), DT, Pose(position, rotation), twist, np.zeros((n, 2, 6)))


def facing(rng, n=3):
    """Two arms near each other, in random attitudes."""
    return rng.normal(size=(n, 2, 3)), rotation_matrix(rng.normal(size=(n, 2, 3)))


def started(phase, seed=0, n=3):
    rng = np.random.default_rng(seed)
    position, rotation = facing(rng, n)
    skill = DualArm(phase)
    skill.start(observe(0.0, position, rotation), [np.random.default_rng(i) for i in range(n)])
    return skill, position, rotation, rng


@pytest.mark.parametrize("name", CONFIGURATIONS)
def test_the_first_command_asks_for_the_poses_that_are(name):
    skill, position, rotation, _ = started(configured(PHASE, name, FRAMES))
    command = skill.step(observe(0.0, position, rotation))
    assert np.array_equal(command.pose.position, position) and np.array_equal(command.pose.rotation, rotation)
    assert not command.feedforward.any() and not command.status.any()


@given(seed=st.integers(0, 1000), name=st.sampled_from(list(CONFIGURATIONS)))
def test_stiffness_is_zero_along_what_is_compliant_and_whole_elsewhere(seed, name):
    turn = rotation_matrix(np.random.default_rng(seed).normal(size=(1, 3)))
    for arm in configured(PHASE, name, FRAMES).arms:
        kept, taken = stiffnesses(PHASE, arm, turn)
        whole = np.diag([600.0] * 3 + [40.0] * 3)
        assert np.allclose(kept + taken, whole, atol=1e-10)  # rounding of rotations
        assert np.linalg.eigvalsh(kept[0]).min() > -1e-10
        x, y = turn[0, :, 0], turn[0, :, 1]
        assert np.allclose(kept[0, :3, :3] @ x, 0.0 if "translation" in arm.compliant else 600.0 * x, atol=1e-10)
        assert np.allclose(kept[0, 3:, 3:] @ y, 0.0 if "rotation" in arm.compliant else 40.0 * y, atol=1e-10)


@settings(max_examples=30)
@given(seed=st.integers(0, 1000))
def test_the_relative_task_exerts_one_wrench_on_both_arms_and_none_against_opposite_errors(seed):
    skill, position, rotation, rng = started(relative(configured(PHASE, "E", FRAMES)), seed)
    skill.step(observe(0.0, position, rotation))
    ahead = skill.step(observe(DT, position, rotation)).pose.position
    error = np.zeros((3, 2, 3))
    error[:, 0] = rng.normal(size=(3, 3)) * 0.01
    wrench = skill.step(observe(2 * DT, ahead + error, rotation)).feedforward
    assert np.array_equal(wrench[:, 0], wrench[:, 1])
    error[:, 1] = -error[:, 0]
    slip = skill._twist.copy()
    opposite = skill.step(observe(2 * DT, ahead + error, rotation, slip)).feedforward
    # what is left is one tick's advance (0.02 mm, half of it common) against the common stiffness
    assert np.abs(opposite).max() < 600.0 * 0.02 * DT


@settings(max_examples=20)
@given(seed=st.integers(0, 1000))
def test_a_pair_that_is_off_as_a_whole_is_held_with_the_whole_stiffness_that_compliance_took_away(seed):
    """Both arms off by the same e: (e_1 + e_2) / 2 is e, and F = K_c e + D_c (v_d - v), both written out."""
    skill, position, rotation, rng = started(relative(configured(PHASE, "E", FRAMES)), seed, n=1)
    skill.step(observe(0.0, position, rotation))
    ahead = skill.step(observe(DT, position, rotation)).pose.position
    off = 0.01 * rng.normal(size=3)
    wrench = skill.step(observe(DT, ahead - off, rotation, skill._twist.copy())).feedforward[0, 0]
    x = rotation[0, :, :, 0]  # both arms' compliant axes of translation, 600 N/m each
    held = 600.0 * 0.5 * sum(np.outer(a, a) for a in x) @ off
    # another tick's advance is 0.02 mm, of which the pair has half
    assert np.abs(wrench[:3] - held).max() < 600.0 * 0.02 * DT


def test_independent_arms_exert_nothing_on_each_other():
    skill, position, rotation, rng = started(configured(PHASE, "E", FRAMES))
    assert not skill.step(observe(DT, position + rng.normal(size=position.shape), rotation)).feedforward.any()


def test_arms_approach_at_the_stated_speed_in_their_shares():
    phase = replace(PHASE, arms=(replace(PHASE.arms[0], share=0.75), replace(PHASE.arms[1], share=0.25)))
    skill, position, rotation, _ = started(phase)
    for k in range(11):
        command = skill.step(observe(k * DT, position, rotation))
    way = np.linalg.norm(command.pose.position - position, axis=-1)
    assert np.allclose(way, 0.02 * 10 * DT * np.array([0.75, 0.25]), atol=1e-12)
    assert np.allclose(np.linalg.norm(command.twist[..., :3], axis=-1), [0.015, 0.005], atol=1e-12)


def test_the_first_arm_moves_along_the_desired_direction_and_the_second_against_it():
    phase = replace(PHASE, arms=tuple(replace(arm, share=0.5) for arm in PHASE.arms))
    skill, position, rotation, _ = started(phase, n=1)
    for k in range(2):
        twist = skill.step(observe(k * DT, position, rotation)).twist[0, :, :3]
    forward = rotation[0, 0] @ np.array(phase.desired_direction)
    assert np.allclose(twist, 0.02 * 0.5 * np.stack([forward, -forward]), atol=1e-12)


def test_the_push_of_blocked_arms_never_exceeds_its_limit_and_they_come_to_rest():
    skill, position, rotation, _ = started(replace(PHASE, stall_s=0.5), n=1)
    for k in range(6000):
        command = skill.step(observe(k * DT, position, rotation))
        assert 600.0 * np.linalg.norm(command.pose.position - position, axis=-1).max() <= 30.0 * (1.0 + 1e-9)
        if command.status[0]:
            break
    assert command.status[0] == Status.SUCCESS and "came to rest while pushing" in command.reason[0]


def test_time_runs_out_in_words():
    skill, position, rotation, _ = started(replace(PHASE, time_limit_s=0.01), n=1)
    for k in range(12):
        command = skill.step(observe(k * DT, position, rotation))
    assert command.status[0] == Status.FAILURE and "still under way" in command.reason[0]


def test_rows_are_independent_of_each_other():
    phase = relative(configured(PHASE, "E", FRAMES))
    many, position, rotation, rng = started(phase)
    alone = DualArm(phase)
    alone.start(observe(0.0, position[1:2], rotation[1:2]), [rng])
    for k in range(5):
        moved = position + 0.001 * rng.normal(size=position.shape)
        a, b = many.step(observe(k * DT, moved, rotation)), alone.step(observe(k * DT, moved[1:2], rotation[1:2]))
        assert np.array_equal(a.pose.position[1:2], b.pose.position)
        assert np.array_equal(a.feedforward[1:2], b.feedforward)

"""Laws of the replay: what it plays, seen from any point of the tool, against the recording itself."""

import numpy as np
import pytest
from skillframe_baselines.common import RATE, SETTLE, resampled
from skillframe_testkit.suites import SkillConformance, example_demonstrations, play, random_observations

from skillframe.demonstration.record import Demonstration
from skillframe.document.file import learned
from skillframe.errors import InputError
from skillframe.extend import LearnOptions
from skillframe.extend.registry import registry
from skillframe.frames import (
    Pose,
    move_twist,
    move_wrench,
    norm,
    quaternion_from_matrix,
    rotation_matrix,
    rotation_vector,
)
from skillframe.skill import Observation, Status

DT = 0.005
DURATION = 2.0


class TestReplayConforms(SkillConformance):
    skill_type = "replay"


@pytest.mark.slow  # the same law in another mode
class TestAbsoluteReplayConforms(SkillConformance):
    skill_type = "replay"

    @property
    def document(self):
        return replay(wave(), mode="absolute")


def wave(rate=500.0):
    """A motion that turns and translates smoothly, with a wrench, of known derivative."""
    time = np.arange(0.0, DURATION + 0.5 / rate, 1.0 / rate)
    position = np.stack([0.4 + 0.03 * np.sin(2 * time), 0.02 * np.cos(time), 0.2 - 0.03 * time], axis=1)
    rotation = rotation_matrix(np.stack([np.pi - 0.2 * time, 0.1 * np.sin(time), 0.05 * time], axis=1))
    wrench = np.stack([np.sin(time), np.cos(time), 5 + 0 * time, 0.1 * time, 0 * time, 0.1 + 0 * time], axis=1)
    return Demonstration(time=time, position=position, quaternion=quaternion_from_matrix(rotation), wrench=wrench)


def replay(demonstration, at=None, axes="base", **settings):
    return learned(registry().skill("replay"), [demonstration], LearnOptions(at=at, axes=axes, settings=settings))


def still(pose, times):
    """One trial that stays where it is while time goes on."""
    zero = np.zeros((1, 6))
    return [Observation(np.array([t]), DT, Pose(pose.position[None], pose.rotation[None]), zero, zero) for t in times]


def commands(document, start, times):
    return play(registry().skill("replay").build(document), still(start, times), [0])


def pose_at(demonstration, i):
    return Pose(demonstration.pose.position[i], demonstration.pose.rotation[i])


@pytest.mark.parametrize("mode", ["shifted", "absolute"])
@pytest.mark.parametrize("axes", ["base", "phase_start"])
def test_started_where_it_was_recorded_it_plays_the_recording(mode, axes):
    demonstration = wave()
    played = commands(replay(demonstration, axes=axes, mode=mode), pose_at(demonstration, 0), demonstration.time[::50])
    for command, i in zip(played, range(0, len(demonstration), 50), strict=True):
        # a moving average over 10 ms of a curve with second derivative below 0.2 m/s^2 is off by less than 2 um
        np.testing.assert_allclose(command.pose.position[0], demonstration.position[i], atol=5e-6)
        turn = rotation_vector(command.pose.rotation[0] @ demonstration.pose.rotation[i].T)
        assert norm(turn) < 5e-5


@pytest.mark.parametrize("coc", [[0.0, 0.0, 0.1], [0.05, -0.02, 0.2]])
@pytest.mark.parametrize("mode", ["shifted", "absolute"])
def test_at_another_centre_of_compliance_the_tool_moves_the_same(coc, mode):
    demonstration, times = wave(), np.arange(0.0, DURATION, 0.1)
    document = replay(demonstration, mode=mode, blend=1e-3)
    other = {**document, "frame": {**document["frame"], "center_of_compliance": coc}}
    start, offset = pose_at(demonstration, 0), np.array(coc)
    there = commands(other, start.at(offset), times)
    for one, two in zip(commands(document, start, times), there, strict=True):
        back = two.pose.at(-offset)
        # between samples the points of a turning tool are interpolated along chords: 0.2 m * (2e-3 rad)^2 / 8 = 0.1 um
        np.testing.assert_allclose(back.position, one.pose.position, atol=2e-7)
        np.testing.assert_allclose(back.rotation, one.pose.rotation, atol=1e-12)
        arm = two.pose.position - one.pose.position
        np.testing.assert_allclose(move_twist(one.twist, arm), two.twist, atol=5e-4)  # chords again: 0.2 m * 2e-3 rad/s
        np.testing.assert_allclose(move_wrench(one.feedforward, arm), two.feedforward, atol=1e-5)


def test_shifted_in_base_axes_it_makes_the_recorded_displacement_from_any_start():
    demonstration = wave()
    turn = rotation_matrix(np.array([0.1, -0.2, 0.3]))
    start = Pose(np.array([1.0, 2.0, 3.0]), turn @ demonstration.pose.rotation[0])
    last = commands(replay(demonstration), start, [0.0, DURATION + 0.1])[-1]
    np.testing.assert_allclose(
        last.pose.position[0] - start.position, demonstration.position[-1] - demonstration.position[0], atol=1e-12
    )
    change = demonstration.pose.rotation[-1] @ demonstration.pose.rotation[0].T
    np.testing.assert_allclose(last.pose.rotation[0], change @ start.rotation, atol=1e-9)


def test_shifted_in_the_axes_of_the_start_it_is_the_same_motion_seen_from_the_tool():
    demonstration = wave()
    start = Pose(np.array([1.0, 2.0, 3.0]), rotation_matrix(np.array([0.4, -0.2, 0.3])))
    last = commands(replay(demonstration, axes="phase_start"), start, [0.0, DURATION + 0.1])[-1]
    expected = pose_at(demonstration, 0).inverse().compose(pose_at(demonstration, -1))
    seen = start.inverse().compose(Pose(last.pose.position[0], last.pose.rotation[0]))
    np.testing.assert_allclose(seen.position, expected.position, atol=1e-12)
    np.testing.assert_allclose(seen.rotation, expected.rotation, atol=1e-9)


def test_absolute_reaches_the_recorded_poses_from_any_start_once_the_error_is_blended_away():
    demonstration = wave()
    start = Pose(
        demonstration.position[0] + 0.02, rotation_matrix(np.array([0.2, 0, 0])) @ demonstration.pose.rotation[0]
    )
    first, *_, last = commands(replay(demonstration, mode="absolute"), start, [0.0, 0.25, 0.5])
    np.testing.assert_allclose(first.pose.position[0], start.position, atol=1e-12)
    np.testing.assert_allclose(last.pose.position[0], demonstration.position[250], atol=5e-6)
    assert norm(rotation_vector(last.pose.rotation[0] @ demonstration.pose.rotation[250].T)) < 5e-5


@pytest.mark.parametrize("mode", ["shifted", "absolute"])
def test_the_desired_twist_is_the_derivative_of_the_desired_pose(mode):
    demonstration, h = wave(), 1e-6
    start = Pose(
        demonstration.position[0] + 0.01, rotation_matrix(np.array([0.3, 0, 0])) @ demonstration.pose.rotation[0]
    )
    document = replay(demonstration, mode=mode)
    for t in (0.1003, 0.3003, 0.7003, 1.5003):  # between samples, where the derivative exists
        _, before, at, after = commands(document, start, [0.0, t - h, t, t + h])
        velocity = (after.pose.position[0] - before.pose.position[0]) / (2 * h)
        turning = rotation_vector(after.pose.rotation[0] @ before.pose.rotation[0].T) / (2 * h)
        np.testing.assert_allclose(at.twist[0], np.concatenate([velocity, turning]), atol=1e-8)  # rounding / h


def test_the_feedforward_is_what_the_person_s_tool_exerted_on_the_environment():
    demonstration = wave()
    last = commands(replay(demonstration), pose_at(demonstration, 0), [0.0, 1.0])[-1]
    np.testing.assert_allclose(last.feedforward[0], -demonstration.wrench[500], atol=1e-4)  # 10 ms mean of sin and cos
    quiet = commands(replay(demonstration, feedforward=False), pose_at(demonstration, 0), [0.0, 1.0])[-1]
    assert not np.any(quiet.feedforward)


def test_it_succeeds_once_the_recording_is_over_and_has_settled():
    demonstration = wave()
    ends = [DURATION + SETTLE - 1e-6, DURATION + SETTLE + 1e-6]
    before, after = commands(replay(demonstration), pose_at(demonstration, 0), [0.0, *ends])[1:]
    assert before.status[0] == Status.RUNNING and before.reason[0] == ""
    assert after.status[0] == Status.SUCCESS and after.reason[0]
    assert not np.any(after.twist)


def test_time_counts_from_the_start_of_the_skill():
    demonstration = wave()
    early = commands(replay(demonstration), pose_at(demonstration, 0), [0.0, 0.5])[-1]
    late = commands(replay(demonstration), pose_at(demonstration, 0), [8.0, 8.5])[-1]
    np.testing.assert_array_equal(early.pose.position, late.pose.position)


@pytest.mark.parametrize("rate", [37.0, 100.0, 500.0, 1000.0])
def test_the_stored_trajectory_keeps_both_ends_at_a_hundred_hertz(rate):
    demonstration = wave(rate)
    stored = resampled(demonstration)
    assert len(stored["time"]) == int(np.ceil(demonstration.duration * RATE)) + 1
    for name in ("position", "wrench"):
        np.testing.assert_allclose(stored[name][0], getattr(demonstration, name)[0], atol=1e-12)
        np.testing.assert_allclose(stored[name][-1], getattr(demonstration, name)[-1], atol=1e-12)


def test_attitudes_near_half_a_turn_are_averaged_across_the_sign_of_the_quaternion():
    demonstration = wave()
    flipped = np.where(np.arange(len(demonstration))[:, None] % 2 == 0, 1.0, -1.0) * demonstration.quaternion
    other = Demonstration(
        time=demonstration.time, position=demonstration.position, quaternion=flipped, wrench=demonstration.wrench
    )
    np.testing.assert_allclose(resampled(other)["quaternion"], resampled(demonstration)["quaternion"], atol=1e-12)


def test_averaging_before_decimation_halves_the_noise_of_a_fast_recording():
    demonstration = wave()
    noise = np.random.default_rng(4).normal(0.0, 1e-3, demonstration.position.shape)
    noisy = Demonstration(
        time=demonstration.time, position=demonstration.position + noise, quaternion=demonstration.quaternion,
        wrench=demonstration.wrench,
    )  # fmt: skip
    left = np.array(resampled(noisy)["position"]) - np.array(resampled(demonstration)["position"])
    # five samples a step: 1 / sqrt(5) = 0.447 of the noise; 201 x 3 values put the estimate within 3 % (one sigma)
    assert 0.40 < left.std() / 1e-3 < 0.50


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"mode": "relative"}, "unknown value 'relative'"),
        ({"stifness": 1.0}, "did you mean 'stiffness"),
        ({"stiffness_rotation": 0.0}, "must be positive"),
        ({"blend": -1.0}, "must be positive"),
        ({"feedforward": "yes"}, "expected true or false"),
    ],
)
def test_settings_that_make_no_sense_are_refused(settings, said):
    with pytest.raises(InputError, match=said):
        replay(wave(), **settings)


def test_more_or_fewer_than_one_demonstration_is_refused():
    for demonstrations in ([], [wave(), wave()]):
        with pytest.raises(InputError, match=f"got {len(demonstrations)}"):
            learned(registry().skill("replay"), demonstrations)


def broken(document, change):
    import copy

    copied = copy.deepcopy(document)
    change(copied)
    return copied


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda d: d.pop("trajectory"), "trajectory"),
        (lambda d: d["trajectory"].pop("wrench"), "wrench"),
        (lambda d: d["trajectory"]["position"].pop(), "do not fit"),
        (lambda d: d["trajectory"]["position"].__setitem__(0, "x"), "cannot be read"),
        (lambda d: d["trajectory"].update(time=[0.0] * len(d["trajectory"]["time"])), "no motion over time"),
        (lambda d: d["phases"].clear(), "one phase, got 0"),
        (lambda d: d["phases"][0].pop("stop"), "missing stop"),
        (lambda d: d["phases"][0].update(mode="sideways"), "sideways"),
        (lambda d: d["phases"][0]["stiffness"].update(rotation=-1.0), "must be positive"),
    ],
)
def test_a_damaged_document_is_refused_by_its_key(change, said):
    with pytest.raises(InputError, match=said):
        registry().skill("replay").check(broken(replay(wave()), change))


def test_rows_that_start_at_different_poses_each_play_from_their_own():
    observations = random_observations(np.random.default_rng(2), 5, 3, 1.0)
    last = play(registry().skill("replay").build(replay(wave())), observations, range(5))[-1]
    moved = last.pose.position - observations[0].pose.position
    np.testing.assert_allclose(moved, np.tile(moved[0], (5, 1)), atol=1e-12)


def test_it_says_what_it_does():
    document = learned(registry().skill("replay"), example_demonstrations()[:1])
    text = "\n".join(registry().skill("replay").describe(document))
    assert "2000 N/m, 100 Nm/rad" in text and "2.4" in text and "knowing nothing of the fixture" in text

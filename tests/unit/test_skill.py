import numpy as np
import pytest
from skillframe_testkit.suites import HoldSkill, ScriptedSkill, play, random_observations

from skillframe.frames import Pose
from skillframe.skill import Command, Impedance, Skill, Status, no_reasons, per_trial, row, stack_commands

OBSERVATIONS = random_observations(np.random.default_rng(5), 6, 20, 0.05)


class Wander(Skill):
    """Written over arrays: drifts by its own generator, pushes against the wrench, gives up where it is pushed hard."""

    def start(self, observation, rngs):
        self.home = observation.pose
        self.drift = np.stack([rng.normal(size=3) for rng in rngs])

    def step(self, observation):
        n = len(observation.time)
        stiffness = np.eye(6) * (100.0 + observation.wrench[:, :1, None] ** 2)
        hard = np.abs(observation.wrench[:, 2]) > 8.0
        reason = no_reasons(n)
        reason[hard] = "pushed hard"
        return Command(
            Pose(self.home.position + self.drift * observation.time[:, None], self.home.rotation),
            np.zeros((n, 6)),
            Impedance(stiffness, 2.0 * stiffness),
            -0.5 * observation.wrench,
            np.where(hard, Status.FAILURE, Status.RUNNING).astype(np.int64),
            reason,
        )


def assert_equal(a, b):
    for name in ("twist", "feedforward", "status", "reason"):
        assert np.array_equal(getattr(a, name), getattr(b, name))
    for x, y in zip(a.pose, b.pose, strict=True):
        assert np.array_equal(x, y)
    for x, y in zip(a.impedance, b.impedance, strict=True):
        assert np.array_equal(np.broadcast_to(x, (6, 6, 6)), np.broadcast_to(y, (6, 6, 6)))


def test_a_scalar_skill_looped_over_trials_equals_the_same_skill_written_over_arrays():
    for batch, looped in zip(
        play(Wander(), OBSERVATIONS, range(6)), play(per_trial(Wander), OBSERVATIONS, range(6)), strict=True
    ):
        assert_equal(batch, looped)


def test_each_trial_of_a_looped_skill_gets_its_own_instance_and_generator():
    made = []

    def make():
        made.append(Wander())
        return made[-1]

    play(per_trial(make), OBSERVATIONS[:1], range(6))
    drifts = np.concatenate([skill.drift for skill in made])
    assert len(made) == 6
    assert len(np.unique(drifts[:, 0])) == 6


def test_a_row_of_an_observation_is_a_batch_of_one():
    one = row(OBSERVATIONS[3], 4)
    assert one.time.shape == (1,) and one.pose.rotation.shape == (1, 3, 3) and one.wrench.shape == (1, 6)
    assert np.array_equal(one.wrench[0], OBSERVATIONS[3].wrench[4])


def test_gains_shared_by_all_rows_are_spread_when_commands_are_stacked():
    holds = play(HoldSkill(), [row(OBSERVATIONS[0], 0)], [0]) * 3
    stacked = stack_commands(holds)
    assert stacked.impedance.stiffness.shape == (3, 6, 6)
    assert stacked.impedance.damping is None


def test_without_damping_in_one_command_the_controller_designs_it_for_all():
    plain = play(HoldSkill(), [row(OBSERVATIONS[0], 0)], [0])[0]
    damped = plain._replace(impedance=Impedance(plain.impedance.stiffness, np.eye(6)))
    assert stack_commands([damped, damped]).impedance.damping is not None
    assert stack_commands([damped, plain]).impedance.damping is None


def test_status_and_reason_are_kept_per_trial():
    last = play(per_trial(lambda: HoldSkill(duration=0.5)), OBSERVATIONS, range(6))[-1]
    assert last.status.tolist() == [Status.SUCCESS] * 6
    assert set(last.reason) == {"held for 0.5 s"}


def test_a_skill_cannot_be_made_without_both_methods():
    class Half(Skill):
        def start(self, observation, rngs): ...

    with pytest.raises(TypeError, match="step"):
        Half()


def test_a_scripted_skill_follows_its_script_from_where_it_started():
    skill = ScriptedSkill(lambda t: np.stack([0 * t, 0 * t, -0.01 * t], axis=1))
    last = play(skill, OBSERVATIONS, range(6))[-1]
    moved = last.pose.position - OBSERVATIONS[0].pose.position
    np.testing.assert_allclose(moved, np.tile([0, 0, -0.01 * OBSERVATIONS[-1].time[0]], (6, 1)), atol=1e-15)

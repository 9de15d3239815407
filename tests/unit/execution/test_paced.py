"""A skill by a slow clock: asked as often as an arm takes commands, in seconds of its own."""

import numpy as np

from skillframe.execution.drive import PacedSkill
from skillframe.frames import Pose
from skillframe.skill import Command, Impedance, Observation, Skill, no_reasons


class Notes(Skill):
    """Notes what it sees; its command is numbered by its place."""

    def start(self, observation, rngs):
        self.started, self.seen, self.again = observation, [], []

    def step(self, observation):
        self.seen.append(observation)
        pose = Pose(np.full((1, 3), float(len(self.seen))), np.eye(3)[None])
        return Command(pose, np.zeros((1, 6)), Impedance(np.eye(6)), np.zeros((1, 6)), np.zeros(1, int), no_reasons(1))

    def restart(self, rows, observation, rngs):
        self.again.append((rows, observation))

    def journal(self, trial):
        return [(2.0, "began")]


def seen_at(tick):
    twist = np.array([[0.01, 0, 0, 0, 0.2, 0]])
    return Observation(np.array([1e-3 * tick]), 1e-3, Pose(np.zeros((1, 3)), np.eye(3)[None]), twist, np.ones((1, 6)))


def run(every, pace, ticks):
    inner = Notes()
    skill = PacedSkill(inner, every, pace)
    skill.start(seen_at(0), [np.random.default_rng(0)])
    return skill, inner, [skill.step(seen_at(tick)).pose.position[0, 0] for tick in range(ticks)]


def test_a_skill_is_asked_at_the_rate_of_commands_and_its_last_command_stands_between():
    _, inner, commands = run(every=8, pace=1.0, ticks=20)
    assert commands == [1.0] * 8 + [2.0] * 8 + [3.0] * 4
    assert [o.time[0] for o in inner.seen] == [0.0, 0.008, 0.016]
    assert {o.dt for o in inner.seen} == {0.008}


def test_who_asks_for_what_stands_between_gets_the_same_commands_and_none_when_one_is_due():
    skill, inner, commands = run(every=8, pace=1.0, ticks=1)
    assert inner.seen
    due = []
    for tick in range(1, 20):
        command = skill.between()
        if command is None:
            due.append(tick)
            command = skill.step(seen_at(tick))
        commands.append(command.pose.position[0, 0])
    assert due == [8, 16]
    assert commands == [1.0] * 8 + [2.0] * 8 + [3.0] * 4


def test_its_clock_runs_slower_and_what_moves_looks_as_fast_as_it_was_taught():
    _, inner, _ = run(every=2, pace=2.5, ticks=11)
    np.testing.assert_allclose([o.time[0] for o in inner.seen], np.arange(6) * 0.002 / 2.5)
    assert inner.seen[1].dt == inner.seen[1].time[0] - inner.seen[0].time[0]
    np.testing.assert_allclose(inner.seen[3].twist, [[0.025, 0, 0, 0, 0.5, 0]])
    np.testing.assert_array_equal(inner.seen[3].wrench, np.ones((1, 6)))


def test_what_it_noted_is_told_in_seconds_of_the_run_and_a_restart_is_handed_on():
    skill, inner, _ = run(every=2, pace=2.5, ticks=1)
    assert skill.journal(0) == [(5.0, "began")]
    skill.restart(np.array([0]), seen_at(500), [np.random.default_rng(0)])
    assert inner.again[0][1].time[0] == 0.2


def test_a_second_start_asks_at_once():
    skill, inner, _ = run(every=8, pace=1.0, ticks=3)
    skill.start(seen_at(0), [np.random.default_rng(0)])
    skill.step(seen_at(0))
    assert len(inner.seen) == 1

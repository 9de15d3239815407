"""A person who goes through stages: many tools are held as each would be alone, to the last bit."""

from __future__ import annotations

import numpy as np
import pytest
from skillframe_teaching.staged import StagedTeacher
from skillframe_teaching.teacher import HANDS, TeacherSettings

from skillframe.execution.prepare import load_world
from skillframe.frames import Pose, rotation_matrix
from skillframe.skill import Observation, row
from skillframe.world.scene import REACTION_S

COUNT, TICKS, DT = 4, 700, 0.001
THERE = (100, 300, 300, 10_000)  # tick at which each ball is at the valley's bottom; the last never


def scenario():
    """A valley, fixtures that stand apart, and what is observed of each tool at each tick."""
    scene = load_world("valley", {"wall_distance": 0.04})
    rng = np.random.default_rng(1)
    fixture = Pose(rng.normal(size=(COUNT, 3)), rotation_matrix(0.3 * rng.normal(size=(COUNT, 3))))
    down = np.diag([1.0, -1.0, -1.0])
    tip, hand = (np.array(scene.tool.frames[name]) for name in ("tip", scene.tool.hand))
    resting = np.array(scene.start_tip) - [0.0, 0.0, 0.004]

    def observed(tick):
        away = np.array([tick < there for there in THERE])[:, None] * [0.03, 0.0, 0.03]
        tips = fixture.at(resting + away + 1e-4 * np.sin(0.01 * tick))
        pose = Pose(tips.position, tips.rotation @ down).at(hand - tip)
        return Observation(np.full(COUNT, tick * DT), DT, pose, np.zeros((COUNT, 6)), np.zeros((COUNT, 6)))

    return scene, fixture, observed


def flat(command):
    """All numbers of a command, a row for each trial."""
    values = (*command.pose, command.twist, command.feedforward, *command.impedance)
    return np.concatenate([value.reshape(len(command.status), -1) for value in values], axis=1)


@pytest.mark.parametrize("settings", [{}, {"kind": "teleoperation", "delay_s": 0.05}])
@pytest.mark.slow
def test_tools_held_together_are_held_as_each_would_be_alone(settings):
    scene, fixture, observed = scenario()
    person = TeacherSettings(**settings)
    together = StagedTeacher(scene, fixture, person)
    alone = [StagedTeacher(scene, Pose(*(v[i : i + 1] for v in fixture)), person) for i in range(COUNT)]
    together.start(observed(0), [np.random.default_rng(i) for i in range(COUNT)])
    for i, each in enumerate(alone):
        each.start(row(observed(0), i), [np.random.default_rng(i)])
    for tick in range(TICKS):
        seen = observed(tick)
        command = flat(together.step(seen))
        assert all(np.array_equal(command[i], flat(each.step(row(seen, i)))[0]) for i, each in enumerate(alone))
    assert [together.journal(i) for i in range(COUNT)] == [each.journal(0) for each in alone]


def test_each_goes_over_to_the_next_stage_a_reaction_after_his_own_tool_is_there():
    scene, fixture, observed = scenario()
    person = StagedTeacher(scene, fixture, TeacherSettings())
    person.start(observed(0), [np.random.default_rng(i) for i in range(COUNT)])
    commands = [person.step(observed(tick)) for tick in range(TICKS)]
    for i, there in enumerate(THERE[:3]):
        ((time, words),) = person.journal(i)
        assert time == pytest.approx(there * DT + REACTION_S, abs=2.0 * DT) and words == "stage 2 begins"
    assert person.journal(3) == []
    assert commands[-1].impedance.stiffness[0, 0, 0] == HANDS["sliding"].stiffness
    way = fixture.rotation @ np.array(scene.task.then[0].direction)
    pushed = commands[-1].twist[:3, :3] / np.linalg.norm(commands[-1].twist[:3, :3], axis=1)[:, None]
    assert np.all((pushed * way[:3]).sum(-1) > 0.8), "the second stage's push"

"""A coordinator obeys the laws of a skill, with a dimension of arms. The checks see it when it does not."""

import numpy as np
import pytest
from skillframe_testkit.checks import check_skill
from skillframe_testkit.checks.skills import example_document, rows_are_independent

from skillframe.extend import CoordinatorType
from skillframe.frames import Pose
from skillframe.skill import Command, Impedance, Skill, no_reasons


class Stand(Skill):
    """Holds every arm where it is. `alter` may spoil the command."""

    def __init__(self, alter):
        self.alter = alter

    def start(self, observation, rngs):
        self.home = observation.pose

    def step(self, observation):
        shape = observation.time.shape
        command = Command(
            self.home, np.zeros((*shape, 6)), Impedance(np.eye(6)), np.zeros((*shape, 6)),
            np.zeros(shape[0], dtype=np.int64), no_reasons(shape[0]),
        )  # fmt: skip
        return self.alter(command, observation)


def kind(alter=lambda command, observation: command, arms=3):
    return CoordinatorType(
        name="stand", summary="stands", build=lambda document: Stand(alter), example=lambda: {"phases": [{}]},
        describe=lambda document: ["stand"], centers=lambda document: np.zeros((arms, 3)),
    )  # fmt: skip


@pytest.mark.slow
def test_a_coordinator_of_any_number_of_arms_that_keeps_the_contract_has_no_problems():
    assert all(check_skill(kind(arms=arms)) == [] for arms in (1, 2, 3))


@pytest.mark.slow
def test_a_coordinator_that_forgets_its_arms_is_caught():
    problems = check_skill(kind(lambda c, o: c._replace(twist=c.twist[:, 0])))
    assert any("twist has shape (8, 6), expected (8, 3, 6)" in problem for problem in problems)


@pytest.mark.slow
def test_arms_may_know_each_other_but_trials_may_not():
    def moved(command, by):
        return command._replace(pose=Pose(command.pose.position + by, command.pose.rotation))

    def arms(command, observation):
        return moved(command, 1e-3 * observation.time[:, :1, None] * observation.wrench[:, ::-1, :3])

    def trials(command, observation):
        return moved(command, 1e-3 * observation.time[..., None] * observation.wrench[::-1, :, :3])

    assert check_skill(kind(arms)) == []
    assert list(rows_are_independent(kind(trials), example_document(kind(trials))))

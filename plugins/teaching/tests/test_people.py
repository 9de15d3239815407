"""Simulated people with habits, each in a row of its own."""

from __future__ import annotations

from math import cos, radians

import numpy as np
import pytest
from skillframe_teaching.people import OFF_S, PERIOD_S, People, Person, off_by
from skillframe_teaching.teacher import Teacher, TeacherSettings

from skillframe.execution.executor import Setup, simulate
from skillframe.execution.prepare import load_robot_model, load_world
from skillframe.frames import norm, unit
from skillframe.world.placement import fixture_poses

PUSH = (0.0, 0.0, -1.0)
SURE = radians(0.01)  # an aim without noise to speak of


def paths(make, count, seconds):
    """Positions (T, 3) of the hand in empty space, of `count` trials."""
    robot, scene = load_robot_model("free_tool"), load_world("free", {})
    hand = make(scene.task, fixture_poses(robot, {}, count))
    setup = Setup(robot=robot.guided(), scene=scene, center_of_compliance=np.array(scene.tool.frames["wrist"]))
    rngs = [np.random.default_rng([4, i]) for i in range(count)]
    traces = simulate(hand, setup, {}, rngs, duration_s=seconds, trace_hz=100.0).traces
    return [trace.position for trace in traces]


@pytest.mark.parametrize("direction", [PUSH, (0.6, 0.0, -0.8), (0.0, 1.0, 0.0)])
def test_a_direction_off_by_an_angle_is_that_angle_off_and_of_unit_length(direction):
    for azimuth in (0.0, 1.0, 4.0):
        found = np.array(off_by(direction, radians(10.0), azimuth))
        assert norm(found) == pytest.approx(1.0)
        assert found @ np.array(direction) == pytest.approx(cos(radians(10.0)))


@pytest.mark.slow
def test_biased_people_go_astray_hesitating_ones_stand_and_those_who_are_wrong_first_turn_round():
    people = [
        Person(aim_noise=SURE), Person(aim_noise=SURE, push=off_by(PUSH, radians(10.0), 0.0)),
        Person(aim_noise=SURE, hesitates=True), Person(aim_noise=SURE, wrong=(0.0, 0.0, 1.0)),
    ]  # fmt: skip
    sure, biased, hesitating, wrong = paths(lambda task, at: People(task, at, people), 4, PERIOD_S)
    away = [unit(path[-1] - path[0]) for path in (sure, biased)]
    assert away[0] @ away[1] == pytest.approx(cos(radians(10.0)), abs=0.005)  # tremor: 2 degrees over 40 mm
    travelled = [norm(path[-1] - path[0]) for path in (sure, hesitating)]
    assert travelled[1] / travelled[0] == pytest.approx(1.0 - OFF_S / PERIOD_S, abs=0.08)  # and the hand's 60 ms
    heights = wrong[:, 2] - wrong[0, 2]
    assert 0.009 < heights.max() < 0.014 and heights[-1] < heights.max() - 0.01


@pytest.mark.slow
def test_a_person_without_habits_is_the_teacher_but_for_where_a_hesitating_one_would_begin():
    """The rows' generators give one number to the moment of letting go; without noise nothing else is random."""
    still = TeacherSettings(aim_noise=0.0, tremor_force=0.0, tremor_torque=0.0)
    (ours,) = paths(lambda task, at: People(task, at, [Person(aim_noise=0.0)], still), 1, 0.5)
    (theirs,) = paths(lambda task, at: Teacher(task, at, still), 1, 0.5)
    np.testing.assert_array_equal(ours, theirs)

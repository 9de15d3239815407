"""Phases that follow each other are one where both hold the tool's attitude and push the same way."""

import numpy as np
import pytest
from skillframe_segmenter.learning import alternatives, neighbours, one_push, turn_alike
from skillframe_segmenter.merge import leaning


def learned(degrees, **rotation):
    a = np.deg2rad(degrees)
    held = {"desired_direction": None, "compliant_axes": [], "fully_compliant": False}
    translation = {"desired_direction": [0.0, float(np.sin(a)), -float(np.cos(a))]}
    return {"phases": [{"translation": translation, "rotation": {**held, **rotation}}]}


@pytest.mark.parametrize(("degrees", "one"), [(0.0, True), (34.0, True), (36.0, False), (53.0, False)])
def test_pushes_less_than_35_degrees_apart_are_one(degrees, one):
    assert one_push(learned(0.0), learned(degrees)) is one


@pytest.mark.parametrize(
    "turns",
    [{"desired_direction": [0.0, 0.0, 1.0]}, {"compliant_axes": [[0.0, 1.0, 0.0]]}, {"fully_compliant": True}],
)
def test_a_phase_that_turns_the_tool_or_lets_it_turn_stays_on_its_own(turns):
    assert not one_push(learned(0.0), learned(0.0, **turns))
    assert not one_push(learned(0.0, **turns), learned(0.0))


def test_a_phase_without_a_direction_stays_on_its_own():
    resting = learned(0.0)
    resting["phases"][0]["translation"]["desired_direction"] = None
    assert not one_push(learned(0.0), resting)


def test_phases_that_follow_each_other_in_any_demonstration_are_looked_at():
    assert neighbours([{"labels": [0, 1, 0]}, {"labels": [0, 2]}]) == [(0, 1), (0, 2)]


def test_what_a_phase_shows_elsewhere_outweighs_one_short_look_and_not_a_long_one():
    says = np.array([1.0, 1.0, 0.0])[:, None, None]
    short, long = (leaning(says, np.array([40.0, 40.0, n]))[2, 0, 0] for n in (4.0, 400.0))
    assert short > 0.6 and long < 0.01


def test_shares_that_agree_and_a_phase_seen_once_stay_as_they_are():
    alike = np.full((3, 2, 5), 0.4)
    np.testing.assert_allclose(leaning(alike, np.array([5.0, 10.0, 20.0])), alike, rtol=1e-12)
    once = np.linspace(0.0, 1.0, 10).reshape(1, 2, 5)
    np.testing.assert_array_equal(leaning(once, np.array([6.0])), once)


def test_a_detour_is_looked_at_where_another_demonstration_does_without_it():
    there_and_back, twice, without = {"labels": [0, 1, 0, 2]}, {"labels": [0, 1, 0, 1, 2]}, {"labels": [0, 2]}
    assert alternatives([there_and_back, twice, without]) == [(0, 1)]
    assert alternatives([there_and_back, twice]) == []


def test_a_peg_that_is_aligned_between_approach_and_insertion_makes_no_detour():
    one_way, other_way = {"labels": [0, 1, 0]}, {"labels": [0, 2, 0]}
    assert (0, 1) not in alternatives([one_way, one_way])
    assert alternatives([one_way, other_way]) == [(1, 2)]


X, Y, Z = np.eye(3).tolist()


@pytest.mark.parametrize(
    ("one", "two", "alike"),
    [
        ({"desired_direction": Y}, {"desired_direction": [0.0, -1.0, 0.0]}, True),  # righted from either side
        ({"desired_direction": Y}, {"compliant_axes": [Y]}, True),  # shown from both sides within one of them
        ({"desired_direction": Y}, {"compliant_axes": [X, Y]}, True),
        ({"desired_direction": Y}, {"fully_compliant": True}, True),
        ({"desired_direction": Y}, {"desired_direction": Z}, False),  # righted, and turned until it locks
        ({"desired_direction": Y}, {"compliant_axes": [Z]}, False),
        ({"desired_direction": Y}, {}, False),  # the attitude held
        ({}, {}, True),
    ],
)
def test_phases_may_stand_in_for_each_other_if_both_can_turn_as_the_other_turns(one, two, alike):
    """One push explains lowering and interlocking. What tells them apart is the axis that they turn about."""
    bodies = learned(0.0, **one), learned(0.0, **two)
    assert turn_alike(*bodies) is alike
    assert turn_alike(*bodies[::-1]) is alike

"""Phases that follow each other are one where both hold the tool's attitude and push the same way."""

import numpy as np
import pytest
from skillframe_segmenter.learning import _one_push, neighbours


def learned(degrees, **rotation):
    a = np.deg2rad(degrees)
    held = {"desired_direction": None, "compliant_axes": [], "fully_compliant": False}
    translation = {"desired_direction": [0.0, float(np.sin(a)), -float(np.cos(a))]}
    return {"phases": [{"translation": translation, "rotation": {**held, **rotation}}]}


@pytest.mark.parametrize(("degrees", "one"), [(0.0, True), (34.0, True), (36.0, False), (53.0, False)])
def test_pushes_less_than_35_degrees_apart_are_one(degrees, one):
    assert _one_push(learned(0.0), learned(degrees)) is one


@pytest.mark.parametrize(
    "turns",
    [{"desired_direction": [0.0, 0.0, 1.0]}, {"compliant_axes": [[0.0, 1.0, 0.0]]}, {"fully_compliant": True}],
)
def test_a_phase_that_turns_the_tool_or_lets_it_turn_stays_on_its_own(turns):
    assert not _one_push(learned(0.0), learned(0.0, **turns))
    assert not _one_push(learned(0.0, **turns), learned(0.0))


def test_a_phase_without_a_direction_stays_on_its_own():
    resting = learned(0.0)
    resting["phases"][0]["translation"]["desired_direction"] = None
    assert not _one_push(learned(0.0), resting)


def test_phases_that_follow_each_other_in_any_demonstration_are_looked_at():
    assert neighbours([{"labels": [0, 1, 0]}, {"labels": [0, 2]}]) == [(0, 1), (0, 2)]

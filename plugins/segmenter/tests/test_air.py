"""A short way through the air up to a touch has a push, however far the hand was off."""

from __future__ import annotations

import numpy as np
import pytest
from skillframe_segmenter.air import learned_in_air

from skillframe.demonstration.record import Demonstration
from skillframe.document.file import learned
from skillframe.extend import LearnOptions
from skillframe.extend.registry import registry

RATE, SPEED = 200.0, 0.02
OFF = np.deg2rad(36.0)  # 2.4 standard deviations of an aim: none is explained from the middle


def aslant(length, force=0.0):
    """Three straight ways down, each `OFF` from -z, evenly about it, so that -z is their middle by symmetry.

    `force` [N] acts on the tool square to its way and to the vertical: no push explains all three, and it does no work.
    """
    result = []
    for i, turn in enumerate(np.deg2rad([0.0, 120.0, 240.0])):
        way = np.array([np.sin(OFF) * np.cos(turn), np.sin(OFF) * np.sin(turn), -np.cos(OFF)])
        count = round(length / SPEED * RATE)
        rng = np.random.default_rng(i)
        wrench = rng.normal(0.0, 0.05, (count, 6))
        wrench[:, :3] += force * np.array([-np.sin(turn), np.cos(turn), 0.0])
        position = np.linspace(0.0, length, count)[:, None] * way + rng.normal(0.0, 1e-5, (count, 3))
        quaternion, source = np.tile([1.0, 0.0, 0.0, 0.0], (count, 1)), f"way{i}"
        time = np.arange(count) / RATE
        shown = Demonstration(time=time, position=position, quaternion=quaternion, wrench=wrench, source=source)
        result.append(shown)
    return result


def translation(demonstrations):
    learn = registry().skill("lmc").learn
    return learned_in_air(learn, demonstrations, LearnOptions())["phases"][0]["translation"]


def test_three_short_ways_about_the_vertical_are_a_push_along_it():
    alone = registry().skill("lmc").learn(aslant(0.009), LearnOptions())["phases"][0]["translation"]
    assert alone["desired_direction"] is None  # or the test would show nothing
    found = translation(aslant(0.009))
    # noise tilts intervals of 1 mm by about a degree
    assert -found["desired_direction"][2] > np.cos(np.deg2rad(3.0))
    assert "taken as it went" in found["evidence"]["message"] and "off by 36 degrees" in found["evidence"]["message"]


@pytest.mark.parametrize(
    ("why", "length", "force"),
    [
        ("a way as long as this would have averaged the hand's wandering out", 0.03, 0.0),
        ("what touched may have turned the tool aside", 0.009, 5.0),
    ],
)
def test_what_is_long_or_touches_is_left_as_it_was_learned(why, length, force):
    assert translation(aslant(length, force))["desired_direction"] is None, why


def test_a_phase_of_a_policy_is_learned_so():
    document = learned(registry().skill("policy"), aslant(0.009), LearnOptions())
    assert len(document["phases"]) == 1
    assert document["phases"][0]["translation"]["desired_direction"][2] < -0.99


def test_a_skill_that_tells_no_evidence_is_asked_once():
    asked = []

    def learn(parts, options):
        asked.append(options)
        return {"phases": [{"path": []}]}

    assert learned_in_air(learn, aslant(0.009), LearnOptions()) == {"phases": [{"path": []}]}
    assert len(asked) == 1

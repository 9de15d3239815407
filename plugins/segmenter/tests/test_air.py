"""A short way through the air up to a touch has a push, however far the hand was off."""

from __future__ import annotations

import numpy as np
import pytest
from skillframe_segmenter.air import learned_in_air

from skillframe.demonstration.record import Demonstration
from skillframe.document.source import learned
from skillframe.extend.records import LearnOptions
from skillframe.extend.registry import registry

RATE, SPEED = 200.0, 0.02
OFF = np.deg2rad(36.0)  # a cone of three quarters of it, 27 degrees, would be needed, and 25 are allowed


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


def translation(demonstrations, **settings):
    learn = registry().skill("lmc").learn
    return learned_in_air(learn, demonstrations, LearnOptions(settings=settings))["phases"][0]["translation"]


def test_three_short_ways_about_the_vertical_are_a_push_along_it():
    alone = registry().skill("lmc").learn(aslant(0.009), LearnOptions())["phases"][0]["translation"]
    assert alone["desired_direction"] is None  # or the test would show nothing
    found = translation(aslant(0.009))
    # 3 degrees: the learner's last search has a disc of that radius
    assert -found["desired_direction"][2] > np.cos(np.deg2rad(3.0))
    # the search's cells are 1.6 degrees wide, and noise tilts intervals of 1 mm by about a degree
    assert np.degrees(found["evidence"]["pyramid_angle_rad"]) == pytest.approx(27.0, abs=2.0)
    assert "taken as it went" in found["evidence"]["message"]


@pytest.mark.parametrize(
    ("why", "length", "force", "settings"),
    [
        ("a way as long as this would have averaged the hand's wandering out", 0.03, 0.0, {}),
        ("what touched may have turned the tool aside", 0.009, 5.0, {}),
        ("a person gave a bound", 0.009, 0.0, {"pyramid_max_rad": np.deg2rad(25.0)}),
    ],
)
def test_what_is_long_or_touches_or_was_bounded_is_left_as_it_was_learned(why, length, force, settings):
    assert translation(aslant(length, force), **settings)["desired_direction"] is None, why


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

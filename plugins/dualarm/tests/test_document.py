import json
from dataclasses import replace

import numpy as np
import pytest
from skillframe_dualarm.document import CONFIGURATIONS, Arm, Phase, body, configured, describe, read_phase, relative
from skillframe_dualarm.dual_peg import DualPegParams, build
from skillframe_testkit.suites import WorldConformance

from skillframe.errors import InputError, UnknownName
from skillframe.extend.registry import registry
from skillframe.frames import Pose
from skillframe.world.scene import State

TIP = (0.0, 0.0, 0.15)
FRAMES = {"wrist": (0.0, 0.0, 0.0), "tip": TIP}
PHASE = Phase(arms=(Arm(center_of_compliance=TIP, share=1.0), Arm(center_of_compliance=TIP)))


class TestDualPeg(WorldConformance):
    world = "dual_peg"


@pytest.mark.parametrize("name", CONFIGURATIONS)
def test_a_document_comes_back_from_json_as_it_was(name):
    phase = configured(PHASE, name, FRAMES)
    assert read_phase(json.loads(json.dumps(body(phase)))) == phase


def test_the_published_configurations_differ_in_centre_and_in_who_gives_way():
    a, b, c, d, e = (configured(PHASE, name, FRAMES) for name in "ABCDE")
    assert a.arms[0].center_of_compliance == (0.0, 0.0, 0.0) and b.arms[0].center_of_compliance == TIP
    assert not c.arms[0].compliant and c.arms[1].compliant == ("translation", "rotation")
    assert d.arms[0].compliant == d.arms[1].compliant == ("rotation",)
    assert e.arms[0].compliant == e.arms[1].compliant == ("translation", "rotation")


def test_an_unknown_configuration_is_refused_with_the_choices():
    with pytest.raises(UnknownName, match="A, B, C, D, E"):
        configured(PHASE, "F", FRAMES)


def test_the_relative_task_gives_way_alike_in_both_arms_and_leaves_the_motion_as_it_was():
    task = relative(configured(PHASE, "B", FRAMES))
    assert task.mode == "relative"
    assert task.arms[0].compliant == task.arms[1].compliant == ("translation", "rotation")
    assert [arm.share for arm in task.arms] == [1.0, 0.0]


ARMS = PHASE.arms
WRONG = {
    "no unit vector": {"desired_direction": (0.0, 0.0, 2.0)},
    "should be positive": {"speed": 0.0},
    "add up to 1": {"arms": (ARMS[0], replace(ARMS[1], share=0.5))},
    "'rotatoin'": {"arms": (replace(ARMS[0], compliant=("rotatoin",)), ARMS[1])},
    "are compliant alike": {"mode": "relative", "arms": (replace(ARMS[0], compliant=("rotation",)), ARMS[1])},
    "mode": {"mode": "both"},
}


@pytest.mark.parametrize("words", WRONG)
def test_what_makes_no_sense_is_refused_in_words(words):
    with pytest.raises(InputError, match=words):
        read_phase(body(replace(PHASE, **WRONG[words])))


def test_two_phases_or_three_arms_are_refused():
    document = body(PHASE)
    with pytest.raises(InputError, match="one phase"):
        read_phase({**document, "phases": document["phases"] * 2})
    document["phases"][0]["arms"].append(document["phases"][0]["arms"][0])
    with pytest.raises(InputError, match="expected 2 values"):
        read_phase(document)


def test_a_document_is_told_in_words():
    lines = describe(body(configured(PHASE, "D", FRAMES)))
    assert lines[0] == "two arms approach along z at 20 mm/s, each arm for itself"
    assert lines[1].startswith("the arm with the tool makes 100 % of the motion and is compliant about y")
    assert "as a relative task" in describe(body(relative(configured(PHASE, "E", FRAMES))))[0]


def test_the_plugin_provides_a_coordinator_whose_arms_have_their_own_centres():
    kind = registry().behaviour("dual_arm")
    assert kind is registry().coordinator("dual_arm")
    assert np.array_equal(kind.centers(body(configured(PHASE, "A", FRAMES))), [[0.0, 0.0, 0.0], TIP])


@pytest.mark.parametrize(
    ("words", "value"),
    {
        "clearance: 0 m is": {"clearance": 0.0},
        "length: 0.2 m is": {"length": 0.2},
        "done_depth": {"done_depth": 0.1},
    }.items(),
)
def test_a_peg_that_cannot_be_is_refused(words, value):
    with pytest.raises(InputError, match=words):
        build(DualPegParams(**value))


def test_the_two_arms_peg_is_in_once_its_tip_is_50_of_60_millimetres_deep_and_in_the_hole():
    """Beside the hole, or past what holds it, a tip may be as deep, or below it. The hole's radius is 16.75 mm."""

    def done(x, z):
        tip = Pose(np.array([[x, 0.0, z]]), np.eye(3)[None])
        return bool(build(DualPegParams()).goal(State(tip, np.zeros((1, 6))))[0])

    assert not done(0.0, -0.0499) and done(0.0, -0.0501)
    assert done(0.016, -0.055) and not done(0.017, -0.055) and not done(0.1, -0.055)
    assert done(0.0, -0.0619) and not done(0.0, -0.0621) and not done(0.0, -0.2)

"""A record of taking the part out: place, way and orientation turned round in time, and what it does not show."""

from dataclasses import replace

import numpy as np
import pytest
from skillframe_teaching.disassembly import record_removal, removal, taking_out

from skillframe import record
from skillframe.demonstration.record import resolve_point
from skillframe.errors import InputError
from skillframe.frames import Pose, norm, rotation_vector
from skillframe.world.placement import nominal_fixture
from skillframe.world.scene import State
from skillframe.world.shapes import TOOL_DOWN
from tests.laws.runs import robot, scene


def state(scene, height):
    tip = Pose(np.array([[0.0, 0.0, height]]), np.diag([1.0, -1.0, -1.0])[None])
    return State(tip, np.zeros((1, 6)))


def test_a_removal_begins_in_the_assembled_pose_and_ends_where_runs_start():
    peg = scene("peg_in_hole")
    out = removal(peg)
    height = peg.start_tip[2]
    assert out.task.starts[0]["start.offset_z"] + height == pytest.approx(-peg.way.of_m)
    assert out.task.direction == tuple(-x for x in peg.task.direction)
    assert not out.goal(state(peg, height - 1e-6))[0] and out.goal(state(peg, height + 1e-6))[0]


def test_a_removal_turned_round_gives_the_place_and_the_orientation_of_the_assembled_part():
    arm, peg = robot("panda"), scene("peg_in_hole")
    (shown,) = record_removal(arm, peg, taking_out(peg), count=1, seed=3).demonstrations
    tip = shown.pose.at(resolve_point("tip", shown.meta["frames"]))
    there = nominal_fixture(arm).at(np.array([0.0, 0.0, -peg.way.of_m])).position
    # the arm's own accuracy, some hundredths of a millimetre, and what contacts sink
    assert norm(tip.position[0] - there) < 1e-4
    assert norm(rotation_vector(tip.rotation[0] @ np.diag([1.0, -1.0, -1.0]))) < 2e-3
    assert tip.position[-1, 2] - tip.position[0, 2] > peg.way.of_m
    assert shown.meta["teacher"] == "disassembly"


@pytest.mark.parametrize("changed", [{"direction": None}, {"aligned": (0.0, 0.0, 0.0, 1.0)}])
def test_what_does_not_come_straight_out_of_a_hole_is_refused(changed):
    peg = scene("peg_in_hole")
    assert removal(replace(peg, task=replace(peg.task, aligned=TOOL_DOWN))) is not None
    with pytest.raises(InputError, match="comes straight out of a hole"):
        removal(replace(peg, task=replace(peg.task, **changed)))


def test_a_valley_has_no_assembled_pose():
    with pytest.raises(InputError, match="valley has none"):
        record("valley", teacher="disassembly")

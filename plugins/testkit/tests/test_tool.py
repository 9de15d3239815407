"""What a world says of its tool is enough for a person to hold it."""

from dataclasses import replace

import pytest
from skillframe_teaching.sessions import record
from skillframe_teaching.teacher import TeacherSettings

from plugins.testkit.tests.planted_worlds import Used, plate
from skillframe.execution.prepare import load_robot_model


@pytest.mark.slow
def test_a_tool_whose_wrist_is_not_named_is_held_at_its_origin():
    scene = plate(Used(tolerance=0.02))  # wide, so that the first attempt succeeds within a second
    bare = replace(scene, tool=replace(scene.tool, frames={"tip": (0.0, 0.0, 0.15)}))
    assert bare.tool.frames == scene.tool.frames
    assert len(record(load_robot_model("free_tool"), bare, TeacherSettings(), count=1, seed=1)) == 1

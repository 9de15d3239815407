"""A person who looks: where he leads the tip, when he holds it back, and what he inserts that a mere push does not."""

import numpy as np
import pytest
from skillframe_teaching.eyes import FULL_M, HELD_NS_M, LOWERED_M_S, URGE_N, SeeingTeacher
from skillframe_teaching.sessions import record
from skillframe_teaching.teacher import Teacher, TeacherSettings

from skillframe.api.inputs import robot_of, scene_of
from skillframe.errors import InputError, SkillframeError
from skillframe.execution.prepare import load_world
from skillframe.frames import Pose
from skillframe.skill import Observation

STILL = {"aim_noise": 0.0, "tremor_force": 0.0, "tremor_torque": 0.0}


def added(tips, velocities=None):
    """The wrench (N, 6) that looking adds at the handle for upright tools with their tips at places of the fixture."""
    scene = load_world("peg_in_hole", {})
    n, down = len(tips), np.diag([1.0, -1.0, -1.0])
    arm = down @ (np.array(scene.tool.frames["tip"]) - np.array(scene.tool.frames[scene.tool.hand]))
    twist = np.zeros((n, 6))
    twist[:, :3] = 0.0 if velocities is None else velocities
    pose = Pose(np.array(tips) - arm, np.tile(down, (n, 1, 1)))
    seen = Observation(np.full(n, 1.0), 1e-3, pose, twist, np.zeros((n, 6)))
    fixture = Pose(np.zeros((n, 3)), np.tile(np.eye(3), (n, 1, 1)))
    found = []
    for person in (
        SeeingTeacher(scene, fixture, TeacherSettings(vision_error=0.0, **STILL)),
        Teacher(scene.task, fixture, TeacherSettings(**STILL)),
    ):
        person.start(seen, np.random.default_rng(0).spawn(n))
        found.append(person.step(seen).feedforward)
    return found[0] - found[1], arm


def test_he_leads_the_tip_to_the_mouth_without_leaning_it_and_no_harder_than_stated():
    tips = np.array([[0.01, 0.0, 0.0], [0.0, -0.001, 0.005], [0.0, 0.0, 0.02]])
    wrench, arm = added(tips)
    expected = np.array([[-URGE_N, 0.0, 0.0], [0.0, URGE_N * 0.001 / FULL_M, 0.0], [0.0, 0.0, 0.0]])
    np.testing.assert_allclose(wrench[:, :3], expected, atol=1e-12)
    np.testing.assert_allclose(wrench[:, 3:], np.cross(arm, expected), atol=1e-12)  # no moment about the tip


def test_he_holds_back_a_part_that_falls_in_and_not_one_that_he_lowers():
    wrench, _ = added(np.zeros((2, 3)), [[0.0, 0.0, -0.5 * LOWERED_M_S], [0.0, 0.0, -LOWERED_M_S - 0.1]])
    np.testing.assert_allclose(wrench[:, 2], [0.0, HELD_NS_M * 0.1], atol=1e-12)


@pytest.mark.slow
def test_a_peg_beside_its_hole_is_shown_by_one_who_looks_and_not_by_one_who_pushes():
    """4 mm beside a hole, with a fillet of 0.5 mm: a push straight down rests on the rim."""
    beside = {"world.fillet": "0.5mm", "start.offset_x": "4mm", "start.tilt_y": 0.0}
    scene, draws = scene_of("peg_in_hole", beside, depth=1)
    arguments = {"count": 1, "seed": 3, "draws": draws, "attempts": 1, "duration_s": 5.0}  # who looks needs 4 s
    robot = robot_of("free_tool")
    with pytest.raises(SkillframeError, match="the teacher failed 1 times"):
        record(robot, scene, TeacherSettings(**STILL), **arguments)
    shown = record(robot, scene, TeacherSettings(vision_error=2e-4), **arguments)
    assert len(shown) == 1 and shown[0].meta["simulated"]["vision_error"] == 2e-4


@pytest.mark.parametrize(
    "settings", [{"vision_error": -1.0}, {"vision_error": np.nan}, {"vision_error": 1e-3, "kind": "teleoperation"}]
)
def test_what_is_no_sight_is_refused(settings):
    with pytest.raises(InputError, match=r"teacher: vision_error: is .*; give metres"):
        TeacherSettings(**settings)


def test_a_task_without_a_mouth_is_refused():
    scene, _ = scene_of("corner", {}, depth=1)
    with pytest.raises(InputError, match="world corner: has no hole entrance for the teacher to see"):
        record(robot_of("free_tool"), scene, TeacherSettings(vision_error=1e-3), count=1, seed=1)

import numpy as np
import pytest
from skillframe_worlds.hooks import skillframe_worlds as world_types

from skillframe.errors import InputError, SkillframeError, UnknownName
from skillframe.execution.recorder import ratio
from skillframe.extend.drives import check_quantities
from skillframe.frames import Pose, rotation_matrix, rotation_vector
from skillframe.robot.model import load_model
from skillframe.robot.spec import load_robot
from skillframe.world.placement import fixture_poses, nominal_fixture, start_poses

WORLDS = [record.name for record in world_types()]


def tips(robot, scene, draws, count):
    """Pose of the tip at the start, in the nominal fixture's frame."""
    held = start_poses(robot, scene, draws, count).at(np.array(scene.tool.frames["tip"]))
    return nominal_fixture(robot).inverse().compose(held)


@pytest.mark.parametrize("world", WORLDS)
def test_the_nominal_start_is_where_the_scene_says(robot, scene, world):
    task = scene(world)
    tip = tips(robot("panda"), task, {}, 2)
    np.testing.assert_allclose(tip.position, [task.start_tip] * 2, atol=1e-12)


@pytest.mark.parametrize("world", WORLDS)
def test_a_start_is_offset_and_turned_about_the_tip_and_lifted_clear(robot, scene, world):
    task = scene(world)
    tilt, offset = np.array([0.1, -0.05, 0.02]), np.array([0.01, 0.005, 0.002])
    draws = {f"start.tilt_{a}": np.array([0.0, v]) for a, v in zip("xyz", tilt, strict=True)}
    draws |= {f"start.offset_{a}": np.array([0.0, v]) for a, v in zip("xyz", offset, strict=True)}
    tip = tips(robot("free_tool"), task, draws, 2)
    lift = task.start_lift(offset[None], tilt[None])[0]
    assert lift >= 0.0
    np.testing.assert_allclose(tip.position[1] - tip.position[0], offset + np.array([0.0, 0.0, lift]), atol=1e-12)
    turned = rotation_vector(tip.rotation[1] @ tip.rotation[0].T)
    np.testing.assert_allclose(turned, tilt, atol=1e-12)


def test_a_moved_fixture_does_not_move_the_start(robot, scene):
    draws = {"fixture.offset_x": np.array([0.0, 0.01])}
    start = start_poses(robot("panda"), scene("peg_in_hole"), draws, 2)
    np.testing.assert_array_equal(start.position[0], start.position[1])
    fixture = fixture_poses(robot("panda"), draws, 2)
    np.testing.assert_allclose(fixture.position[1] - fixture.position[0], [0.01, 0, 0], atol=1e-15)


def test_fixture_tilts_turn_about_the_fixture_s_own_origin(robot):
    draws = {"fixture.tilt_y": np.array([0.2])}
    fixture = fixture_poses(robot("panda"), draws, 1)
    expected = Pose(nominal_fixture(robot("panda")).position, rotation_matrix(np.array([0.0, 0.2, 0.0])))
    np.testing.assert_allclose(fixture.position[0], expected.position)
    np.testing.assert_allclose(fixture.rotation[0], expected.rotation)


def test_a_quantity_that_nothing_reads_is_refused_with_the_nearest_one():
    check_quantities({"start.tilt_y": np.zeros(1)})
    with pytest.raises(UnknownName, match=r"start\.tilt_y"):
        check_quantities({"start.tilty": np.zeros(1)})


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("world.friction", -0.1, "-0.1 is beyond 0 to 5"),
        ("sensor.force_noise", -1.0, "-1 N is beyond 0N to 100N"),
        ("robot.mass_scale", 0.0, "0 is beyond 1e-06 to 100"),
        ("start.tilt_y", 1e300, r"1e\+300 rad is beyond -90deg to 90deg"),
        ("fixture.offset_x", np.nan, "nan m is beyond -3m to 3m"),
        ("actuator.delay", 0.1, "free_tool has no drive with such a quantity"),
    ],
)
def test_a_quantity_that_cannot_be_is_refused_whichever_trial_has_it(key, value, message):
    with pytest.raises(InputError, match=f"{key}: {message}"):
        check_quantities({key: np.array([1.0, value])}, load_model(load_robot("free_tool")))


def test_rates_that_divide_give_their_ratio_and_others_are_refused_in_words():
    assert ratio(1000.0, 100.0, "control", "the trace") == 10
    assert ratio(1000.0, 1000.0, "control", "the skill") == 1
    for slow in (300.0, 2000.0):
        with pytest.raises(SkillframeError, match="not a whole multiple"):
            ratio(1000.0, slow, "control", "the trace")

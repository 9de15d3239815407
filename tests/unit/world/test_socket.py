"""The socket: pins that fit its holes, a key that keeps the plug from going in the wrong way round."""

import numpy as np
import pytest
from skillframe_worlds.hooks import skillframe_worlds as world_types

from skillframe.errors import InputError
from skillframe.extend import make_scene
from skillframe.frames import Pose, matrix_from_quaternion, rotation_matrix
from skillframe.world.scene import State

RECORD = {record.name: record for record in world_types()}["socket"]


def box_holds(box, point, margin=0.0):
    local = matrix_from_quaternion(box.quaternion).T @ (np.asarray(point) - box.position)
    return bool((np.abs(local) < np.array(box.size) - margin).all())


def covered(scene, x, y, z=-0.005):
    return any(box_holds(box, (x, y, z)) for box in scene.fixture)


@pytest.fixture(scope="module")
def scene():
    return make_scene(RECORD, {})


def test_pins_and_key_stand_in_free_space_when_plugged_in(scene):
    for side in (-1.0, 1.0):
        for angle in np.linspace(0.0, 2.0 * np.pi, 33):
            x, y = side * 0.0095 + 0.0024 * np.cos(angle), 0.0024 * np.sin(angle)
            assert not covered(scene, x, y)
    for x in (-0.003, 0.0, 0.003):
        for y in (0.0058, 0.007, 0.0082):
            assert not covered(scene, x, y)


@pytest.mark.slow
def test_everything_else_of_the_face_is_solid(scene):
    """No gap between rings and plates: a grid of 0.4 mm over the face, leaving out the holes and the key's slot."""
    for x in np.arange(-0.03, 0.03, 0.0004) + 1e-5:
        for y in np.arange(-0.012, 0.014, 0.0004) + 1e-5:
            near_hole = min(np.hypot(x - 0.0095, y), np.hypot(x + 0.0095, y)) < 0.00297  # corners of the ring
            in_slot = abs(x) < 0.00401 and 0.00479 < y < 0.00921
            if not (near_hole or in_slot):
                assert covered(scene, x, y), (x, y)


def test_turned_half_way_round_the_key_meets_the_face(scene):
    assert covered(scene, 0.0, -0.007)


def test_the_goal_is_depth_at_the_right_place(scene):
    def state(x, z):
        position = np.array([[x, 0.0, z]])
        return State(Pose(position, rotation_matrix(np.array([[np.pi, 0.0, 0.0]]))), np.zeros((1, 6)))

    assert scene.goal(state(0.0, -0.017))[0]
    assert not scene.goal(state(0.0, -0.010))[0]
    assert not scene.goal(state(0.06, -0.017))[0]  # beside the plate


@pytest.mark.parametrize(
    ("params", "said"),
    [
        ({"clearance": 0.0}, "clearance"), ({"fillet": 0.003}, "fillet"), ({"spacing": 0.01}, "spacing"),
        ({"depth": 0.02}, "depth <= length"), ({"done_depth": 0.019}, "done_depth"), ({"boxes": 4}, "boxes"),
        ({"radius": 0.004}, "radius"),
    ],
)  # fmt: skip
def test_parameters_that_make_no_sense_are_refused_by_name(params, said):
    with pytest.raises(InputError, match=said):
        make_scene(RECORD, params)

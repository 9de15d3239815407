"""The task board: the same five places wherever it stands, and when they were done."""

from __future__ import annotations

import numpy as np
import pytest
from skillframe_teaching.sessions import longest_s
from skillframe_worlds.task_board import LAYOUTS, PLACES, done_in_order

from skillframe.errors import InputError
from skillframe.execution.prepare import load_world
from skillframe.frames import Pose, matrix_from_quaternion, rotation_matrix

MOVE = {"x": 0.03, "y": -0.02, "yaw": 0.7, "tilt": 0.1}
BOARD = Pose(np.array([0.03, -0.02, 0.0]), rotation_matrix([0.0, 0.0, 0.7]) @ rotation_matrix([0.1, 0.0, 0.0]))


def board(layout=1, **params):
    return load_world("task_board", {"layout": layout, **params})


def pose_of(scene, name):
    position, quaternion = scene.places[name]
    return Pose(np.array(position), matrix_from_quaternion(quaternion))


@pytest.mark.parametrize("layout", LAYOUTS)
def test_a_moved_board_carries_its_places_and_its_geoms_along(layout):
    still, moved = board(layout), board(layout, **MOVE)
    for name in PLACES:
        carried = BOARD.compose(pose_of(still, name))
        np.testing.assert_allclose(pose_of(moved, name).position, carried.position, atol=1e-12)
        np.testing.assert_allclose(pose_of(moved, name).rotation, carried.rotation, atol=1e-12)
    for a, b in zip(still.fixture, moved.fixture, strict=True):
        np.testing.assert_allclose(b.position, BOARD.at(np.array(a.position)).position, atol=1e-12)
    assert still.start_tip == moved.start_tip  # where the arm starts is not the board's business


def visited(scene, names, wrench=20.0):
    """Tips that rest at the ends of places, pressed out of them, one sample each."""
    ends = [pose_of(scene, name).at(np.array(PLACES[name].end) - [0.0, 0.0, 2e-4]) for name in names]
    up = np.array([pose_of(scene, name).rotation[:, 2] for name in names])
    tip = Pose(np.array([e.position for e in ends]), np.array([e.rotation for e in ends]))
    return done_in_order(scene, tip, np.hstack([wrench * up, np.zeros((len(names), 3))]))


@pytest.mark.parametrize("layout", LAYOUTS)
def test_places_count_only_in_their_order(layout):
    scene = board(layout, **MOVE)
    names = list(scene.places)
    assert visited(scene, names) == 5
    assert visited(scene, names[:3]) == 3
    assert visited(scene, [names[0], names[2], names[1], names[3], names[4]]) == 2  # the third came too early
    assert visited(scene, names[1:]) == 0


def test_what_must_be_pressed_is_not_done_by_touching():
    scene = board(1)
    assert visited(scene, ["hole"]) == 1
    assert visited(scene, ["hole"], wrench=1.0) == 0


def test_a_place_is_done_at_that_place_only():
    scene = board(1)
    away = pose_of(scene, "slot").at(np.add(PLACES["slot"].end, (0.2, 0.0, 0.0)))
    tip = Pose(away.position[None], away.rotation[None])
    first = board(1, count=1)
    assert done_in_order(first, tip, np.array([[0.0, 0.0, 20.0, 0.0, 0.0, 0.0]])) == 0


def test_a_task_of_many_stages_may_take_longer_to_show():
    assert longest_s(board(1)) > 32.0  # what a person took for the slowest board
    assert longest_s(load_world("hose_coupler", {"interlock": 0.7})) == 12.0  # as it always was


def test_a_board_may_have_its_first_places_only():
    assert list(board(2, count=2).places) == ["corner", "button"]
    with pytest.raises(InputError, match="layout"):
        board(4)

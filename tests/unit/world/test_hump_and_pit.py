"""Worlds that can be turned as a whole: a hump to pass, a pit of several faces, a lid and a bayonet."""

from __future__ import annotations

from math import acos, atan, atan2, cos, degrees, pi, radians, sin

import numpy as np
import pytest
from skillframe_worlds.hooks import skillframe_worlds as world_types

from skillframe.errors import InputError
from skillframe.extend import make_scene
from skillframe.frames import Pose, rotation_matrix
from skillframe.world.scene import State

RECORDS = {record.name: record for record in world_types()}
TURN = (0.7, -1.9, 1.1)
STEPS, SKEW = {"steps": radians(18.0), "friction": 0.2, "slope": radians(48.0)}, {"skew": radians(16.0)}
CASES = [("hump", {}), ("hump", STEPS), ("hump", SKEW), ("pit", {}), ("lid", {}), ("bayonet", {})]


def scene(world, **params):
    return make_scene(RECORDS[world], params)


def at(*tips, attitude=None):
    count, attitude = len(tips), np.eye(3) if attitude is None else attitude
    return State(Pose(np.array(tips), np.broadcast_to(attitude, (count, 3, 3))), np.zeros((count, 6)))


@pytest.mark.parametrize(("world", "params"), CASES)
def test_a_turned_scene_is_the_same_scene_seen_from_elsewhere(world, params):
    plain, turned, turn = scene(world, **params), scene(world, **params, turn=TURN), rotation_matrix(np.array(TURN))
    np.testing.assert_allclose(turned.task.direction, turn @ plain.task.direction, atol=1e-12)
    np.testing.assert_allclose(turned.start_tip, turn @ plain.start_tip, atol=1e-12)
    for a, b in zip(plain.fixture, turned.fixture, strict=True):
        np.testing.assert_allclose(b.position, turn @ a.position, atol=1e-12)
    tips = np.random.default_rng(0).uniform(-0.03, 0.05, (50, 3))
    np.testing.assert_array_equal(turned.goal(at(*(tips @ turn.T), attitude=turn)), plain.goal(at(*tips)))
    far = turned.goal_error(at(*(tips @ turn.T), attitude=turn))[0]
    np.testing.assert_allclose(far, plain.goal_error(at(*tips))[0], atol=1e-12)


@pytest.mark.parametrize(("world", "params"), CASES)
def test_no_start_in_a_turned_fixture_touches_anything_and_none_is_a_goal(plant, world, params):
    for start in scene(world, **params, turn=TURN).task.starts:
        now = plant("free_tool", world, start, **params, turn=TURN)
        np.testing.assert_array_equal(now.contact_force(), 0.0)
        assert not now.scene.goal(now.tip_state())[0]


def test_the_hump_s_push_is_in_the_middle_of_the_pushes_that_pass():
    """They lie between atan(mu) and 90 degrees - atan(mu) - r below the floor; the middle knows nothing of friction."""
    for friction in (0.05, 0.1, 0.2):
        found = scene("hump", friction=friction, slope=radians(50.0))
        below = atan(-found.task.direction[2] / found.task.direction[0])
        assert below == pytest.approx(0.5 * (atan(friction) + 0.5 * pi - atan(friction) - radians(50.0)))
        assert found.analytic["push_half_width_rad"] == pytest.approx(below - atan(friction))


def test_a_hump_that_no_push_passes_is_refused():
    with pytest.raises(InputError, match="slope < 90 degrees - 2 atan"):
        scene("hump", slope=radians(70.0), friction=0.3)


def test_the_pit_s_goal_is_the_ball_on_every_face():
    """With three faces it is one point: n_i . c = radius for all three normals, solved here by Cramer's rule."""
    slopes, azimuths = (0.4, 0.7, 1.0), (0.0, 2.0, 4.2)
    found = scene("pit", slopes=slopes, azimuths=azimuths)
    n = np.array([[-sin(s) * cos(a), -sin(s) * sin(a), cos(s)] for s, a in zip(slopes, azimuths, strict=True)])
    swapped = [np.where(np.arange(3) == i, 0.005, n) for i in range(3)]
    centre = np.array([np.linalg.det(m) for m in swapped]) / np.linalg.det(n)
    assert found.goal(at(centre))[0] and found.goal_error(at(centre))[0][0] < 1e-12
    assert not found.goal(at(centre + 0.002 * n[0], centre + 0.002 * n[1], centre + 0.002 * n[2])).any()
    np.testing.assert_allclose(found.goal_error(at(centre + 0.002 * n[2]))[0], 0.002, rtol=1e-6)


def test_a_turned_bayonet_s_turn_and_starts_are_turned_with_it():
    plain, there, turn = scene("bayonet"), scene("bayonet", turn=TURN), rotation_matrix(np.array(TURN))
    np.testing.assert_allclose(there.task.turn, turn @ plain.task.turn, atol=1e-12)
    for a, b in zip(plain.task.starts, there.task.starts, strict=True):
        tilts = [[start.get(f"start.tilt_{axis}", 0.0) for axis in "xyz"] for start in (a, b)]
        np.testing.assert_allclose(tilts[1], turn @ tilts[0], atol=1e-12)


def test_a_bayonet_is_locked_when_both_pins_are_at_their_stops_on_the_bottom():
    """A pin of 3 mm at 30 mm, 2 mm of play, 8 mm deep and 6 mm of lock."""
    found, lead = scene("bayonet", lead=radians(80.0)), radians(80.0)
    along = 0.006 + 0.002 + 0.008 * cos(lead) / sin(lead) + 0.006 - 0.003  # slot, the wall's foot, lock, less the pin
    angle, height = np.arcsin(along / 0.03), -0.008 + 0.003

    def state(turned, z, aside=0.0):
        c, s = cos(turned), sin(turned)
        rotation = np.array([[[c, s, 0.0], [s, -c, 0.0], [0.0, 0.0, -1.0]]])
        return State(Pose(np.array([[0.0, aside, z]]), rotation), np.zeros((1, 6)))

    assert found.goal(state(angle, height))[0] and found.goal_error(state(angle, height))[0][0] < 1e-12
    assert found.goal_error(state(angle, height + 0.001))[0][0] == pytest.approx(0.001)
    assert not found.goal(state(angle - 0.003 / 0.03, height))[0]  # both 3 mm short, 2 allowed
    assert not found.goal(state(angle, height, aside=0.0025))[0]  # one pin is beyond, the other short
    assert not found.goal(state(angle, height + 0.0025))[0]


def test_a_bayonet_names_the_pushes_that_pass_and_refuses_a_lock_that_holds_nothing():
    given = scene("bayonet", lead=radians(85.0), friction=0.2).analytic
    assert given["least_push_angle_rad"] == pytest.approx(radians(85.0) + atan(0.2) - 0.5 * pi)
    assert given["most_push_angle_rad"] == pytest.approx(0.5 * pi - atan(0.2))
    with pytest.raises(InputError, match="lock > pin"):
        scene("bayonet", lock=0.004)


def test_a_turned_lid_turns_about_a_turned_hinge_and_is_shut_by_its_angle():
    plain, there, turn = scene("lid"), scene("lid", turn=TURN), rotation_matrix(np.array(TURN))
    (part,), (seen) = plain.sprung, there.sprung[0]
    np.testing.assert_allclose(seen.axis, turn @ part.axis, atol=1e-12)
    np.testing.assert_allclose(seen.inertia, turn @ part.inertia @ turn.T, atol=1e-15)
    opening = plain.params["opening"]
    for at_angle, shut in ((0.0, False), (opening - radians(3.1), False), (opening - radians(2.9), True)):
        state = at((0.0, 0.0, 0.0))._replace(second={"lid.angle": np.array([at_angle])})
        assert plain.goal(state)[0] == there.goal(state)[0] == shut
        assert there.goal_error(state)[1][0] == pytest.approx(opening - at_angle)


def test_the_lid_s_push_is_in_the_middle_of_those_that_keep_the_ball_and_have_a_lever():
    """From A - phi to acos(M / (F l)), with F = 15 N and l from hinge to ball: 65 - 5.7 and 84.0 degrees."""
    found = scene("lid")
    push = degrees(atan2(found.task.direction[0], -found.task.direction[2]))
    low, high = 65.0 - degrees(atan(0.1)), degrees(acos(0.15 / (15.0 * 0.095)))
    assert push == pytest.approx(0.5 * (low + high), abs=1e-6)
    assert degrees(found.analytic["push_half_width_rad"]) == pytest.approx(0.5 * (high - low), abs=1e-6)


def test_a_lid_that_no_push_shuts_is_refused():
    with pytest.raises(InputError, match="a push that keeps the ball on the lid and shuts it"):
        scene("lid", stuck=1.2)

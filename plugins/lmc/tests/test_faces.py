"""Compliant axes of faces that were touched, and pushes where only the contact agrees."""

from __future__ import annotations

from math import cos, radians, sin

import numpy as np
import pytest
import synthetic as syn
from test_modes import legs, part

from skillframe.demonstration.record import Demonstration
from skillframe.frames import Float, unit

MU = 0.2
FLOOR, WALL = np.array([0.0, 0.0, 1.0]), np.array([0.0, -1.0, 0.0])


def along_faces(*parts: tuple[Float, float, list[tuple[Float, float]]], friction: float = MU) -> Demonstration:
    """Slides one after another: way, length [m], and the faces touched with the force [N] that each bears."""
    points, forces, here = [], [], np.array([0.4, 0.1, 0.3])
    for way, length, faces in parts:
        n = round(length / 0.03 * 500.0)
        points.append(here + np.linspace(0.0, length, n)[:, None] * way)
        force = np.sum([np.zeros(3), *(size * (normal - friction * way) for normal, size in faces)], axis=0)
        forces.append(np.tile(force, (n, 1)))
        here = points[-1][-1]
    force = np.concatenate(forces)
    turn = np.tile(syn.DOWN, (len(force), 1, 1))
    return syn.recording(np.concatenate(points), turn, np.concatenate([force, 0.0 * force], axis=1), syn.Recipe())


def into_the_edge(aside: float, bears: float) -> Demonstration:
    """Over a floor towards a wall, at an angle [rad], then along the edge between them with a force on the wall [N]."""
    towards, along = np.array([cos(aside), sin(aside), 0.0]), np.array([1.0, 0.0, 0.0])
    return along_faces((towards, 0.02, [(FLOOR, 8.0)]), (along, 0.03, [(FLOOR, 8.0), (WALL, bears)]))


def test_a_wall_that_held_the_tool_on_its_way_asks_for_an_axis_that_the_motion_does_not_show() -> None:
    shown = [into_the_edge(radians(12.0), 4.0)] * 2
    found, by_motion = part(shown), part(shown, faces=False)
    assert len(by_motion["compliant_axes"]) == 1 and not by_motion["evidence"]["axes_by_faces"]
    assert len(found["compliant_axes"]) == 2 and found["evidence"]["axes_by_faces"]
    assert found["desired_direction"] == by_motion["desired_direction"]
    stiffness = np.array(found["stiffness"])
    assert np.linalg.matrix_rank(stiffness, tol=1e-6) == 1  # stiff along the push alone
    assert abs(np.array(found["desired_direction"]) @ np.array(found["compliant_axes"]).T).max() < 1e-9


def test_a_wall_that_takes_less_than_a_quarter_of_the_push_asks_for_no_second_axis() -> None:
    """The part of a unit push that a wall of 1 N takes beside a floor of 8 N is 1 / sqrt(65) / sqrt(1 + mu^2)."""
    assert len(part([into_the_edge(radians(12.0), 1.0)] * 2)["compliant_axes"]) == 1


@pytest.mark.parametrize(("sigma", "most"), [(8.0, 4.0), (15.0, 15.0)])
def test_the_axis_of_a_valley_is_its_own_however_a_person_wanders_along_it(sigma: float, most: float) -> None:
    """Friction acts along the motion, so that the normals stay in the plane of x and z. By the motion: up to 24."""
    off, by_motion = [], []
    for seed in range(30):
        shown = syn.wavering(30.0, MU, sigma, seed)
        found, moved = part(shown)["compliant_axes"], part(shown, faces=False)["compliant_axes"]
        assert len(found) == 1
        off.append(abs(found[0][0]))
        by_motion.append(abs(moved[0][0]))
    assert np.degrees(np.arccos(min(off))) < most
    assert np.degrees(np.arccos(np.median(off))) < 0.4 * np.degrees(np.arccos(np.median(by_motion)))


def test_one_slide_down_a_rough_face_gives_way_across_it_although_its_motion_is_nearly_the_push() -> None:
    """With mu = 1 the sector is 45 degrees wide: the push lies 22 off the way, which passes for wandering."""
    way, normal = unit(np.array([0.2, 0.0, -1.0])), unit(np.array([1.0, 0.0, 0.2]))
    shown = [along_faces((way, 0.015, [(normal, 8.0)]), friction=1.0)]
    assert part(shown, faces=False)["compliant_axes"] == []
    (axis,) = part(shown)["compliant_axes"]
    assert abs(axis[1]) < 0.05  # in the plane of the normal and the way


def test_a_tool_that_springs_back_when_the_hand_lets_go_leaves_the_push_to_the_contact() -> None:
    """Three times down a slope, three times back through the air: together no push, in contact the slope's."""
    back = [(-40.0, 0.012), (70.0, 0.008)] * 3
    shown = [springing(back)] * 2
    found, touched = part(shown), part([legs((-40.0, 0.036))] * 2)
    assert found["desired_direction"] is not None
    assert np.array(found["desired_direction"]) @ np.array(touched["desired_direction"]) > cos(
        radians(5.0)
    )  # the intervals in which the hand lets go are of both


def test_two_ways_in_contact_that_contradict_have_no_push_all_the_same() -> None:
    shown = [legs((-40.0, 0.03), (110.0, 0.02))] * 2
    assert part(shown, contact_modes=False)["desired_direction"] is None


def springing(parts: list[tuple[float, float]]) -> Demonstration:
    """Slides as `legs`, every second of them through the air."""
    ways = [(np.array([cos(radians(a)), 0.0, sin(radians(a))]), length) for a, length in parts]
    return along_faces(
        *((way, length, [] if i % 2 else [(np.array([-way[2], 0.0, way[0]]), 8.0)])
          for i, (way, length) in enumerate(ways))
    )  # fmt: skip

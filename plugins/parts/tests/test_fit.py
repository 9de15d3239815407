"""How two parts go together: mouth, depth, play, tip and way out, in a frame that the parts decide."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from skillframe_parts.declared import FixtureFile, FixturePart, HeldPart, MeshPlace, TaskKeys
from skillframe_parts.fit import corners, fit, lowest, nothing_stops
from skillframe_parts.solid import MeshPart

from skillframe.errors import InputError
from tests.part_meshes import SIDES, box, in_metres, keyed, rod, round_pair

FILE = FixtureFile(fixture=FixturePart(mesh="socket.stl"), tool=HeldPart(mesh="plug.stl"))


def part(name, solid):
    return MeshPart(name, in_metres(solid), (), "")


def fitted(plug, socket, file=FILE):
    return fit(part("plug.stl", plug), part("socket.stl", socket), file)


def test_depth_and_play_are_those_that_were_drawn():
    found = fitted(*round_pair(play=0.2))
    assert found.depth == pytest.approx(0.012) and found.radius == pytest.approx(0.005)
    # the pin's corners are on its circle and the hole's sides tangent to it: flat against flat
    assert found.clearance == pytest.approx(1e-3 * (5.2 - 5.0 * np.cos(np.pi / SIDES)), rel=1e-6)
    np.testing.assert_allclose(found.gaps, found.clearance, rtol=1e-6)


def test_the_way_out_of_parts_that_were_exported_aslant_is_found_among_the_plug_s_sides():
    angles = [20.0, -35.0, 10.0]
    plug, socket = (solid.rotate(angles) for solid in round_pair(play=0.2))
    found = fitted(plug, socket, replace(FILE, task=TaskKeys(axis="auto")))
    down = Rotation.from_euler("xyz", angles, degrees=True).apply([0.0, 0.0, -1.0])
    np.testing.assert_allclose(found.axis, down, atol=1e-6)
    assert found.depth == pytest.approx(0.012, rel=1e-5)


@pytest.mark.parametrize("turn", [(0.0, 0.0, 0.0), (0.7, 0.0, 0.0), (0.3, -2.0, 1.1), (np.pi, 0.0, 0.0)])
def test_what_is_found_does_not_depend_on_how_the_parts_lie(turn):
    place = MeshPlace(xyz=(0.4, -0.2, 0.1), rpy=turn)
    roll, pitch, yaw = turn
    axis = -np.array([np.cos(roll) * np.sin(pitch) * np.cos(yaw) + np.sin(roll) * np.sin(yaw),
                      np.cos(roll) * np.sin(pitch) * np.sin(yaw) - np.sin(roll) * np.cos(yaw),
                      np.cos(roll) * np.cos(pitch)])  # fmt: skip
    file = replace(FILE, fixture=replace(FILE.fixture, pose=place), tool=replace(FILE.tool, assembled=place),
                   task=TaskKeys(axis=tuple(axis)))  # fmt: skip
    found, straight = fitted(*round_pair(), file), fitted(*round_pair())
    assert found.depth == pytest.approx(straight.depth, rel=1e-6)
    assert found.clearance == pytest.approx(straight.clearance, rel=1e-6)
    low, high = np.reshape(found.plug.bounding_box(), (2, 3))
    np.testing.assert_allclose([low[2], high[2]], [-0.012, 0.008], atol=1e-9)


def test_the_first_free_axis_is_found():
    plug, socket = round_pair()
    file = replace(FILE, task=TaskKeys(axis="auto"))
    found = fitted(plug.rotate([90, 0, 0]), socket.rotate([90, 0, 0]), file)
    assert found.depth == pytest.approx(0.012) and found.axis == pytest.approx((0.0, 1.0, 0.0))


def test_the_mouth_is_the_middle_of_what_goes_in():
    """A key on one side moves the middle by half of its reach."""
    plug = keyed(5.0, 3.0, 2.0, -10.0, 8.0)
    socket = box((-15, -15, -15), (15, 15, 0)) - keyed(5.2, 3.4, 2.2, -10.0, 1.0, outside=True)
    low, high = np.reshape(fitted(plug, socket).plug.bounding_box(), (2, 3))
    np.testing.assert_allclose([low[0], high[0]], [-0.006, 0.006], atol=1e-9)


def test_the_mouth_of_a_tube_over_a_loose_post_is_the_top_of_the_post():
    """Nothing of the post is within 5 mm of the tube, and still a tube that starts below its top begins around it."""
    tube = rod(12.0, 0.0, 20.0) - rod(10.0, -1.0, 21.0, outside=True)
    socket = box((-20, -20, -5), (20, 20, 0)) + rod(13.0, -1.0, 3.0) - rod(12.2, 0.0, 4.0, outside=True)
    assert fitted(tube, socket).depth == pytest.approx(0.003)
    assert fitted(tube, socket + rod(4.0, -1.0, 15.0)).depth == pytest.approx(0.015)


def test_what_rises_beside_a_part_is_no_mouth():
    pin, socket = round_pair()
    assert fitted(pin, socket + box((9, -15, -1), (15, 15, 15))).depth == pytest.approx(0.012)


def test_a_part_on_top_of_another_is_refused():
    with pytest.raises(InputError, match="nothing of it lies below a hole entrance"):
        fitted(box((-3, -3, 0), (3, 3, 5)), box((-15, -15, -5), (15, 15, 0)))


def test_the_lowest_point_of_a_tilted_part_is_its_edge():
    """r sin(tilt) below the tip, for a pin whose corner lies that way."""
    points = corners(fitted(*round_pair()))
    tilt = np.array([[0.0, 0.1, 0.0], [0.1, 0.0, 0.0], [0.0, 0.0, 0.4]])
    np.testing.assert_allclose(lowest(points, tilt), [-0.005 * np.sin(0.1)] * 2 + [0.0], atol=1e-9)


def test_nothing_stops_a_part_in_a_hole_that_goes_through_but_a_table_and_a_bottom_do():
    pin, blind = round_pair()
    through = blind - rod(5.2, -20.0, 0.0, outside=True)  # 17 mm deep in all, and the pin 12
    assert not nothing_stops(fitted(pin, blind), table=False, fall=0.001)
    found = fitted(pin, through)
    assert nothing_stops(found, table=True, fall=0.0049)
    assert not nothing_stops(found, table=True, fall=0.0051) and nothing_stops(found, table=False, fall=0.0051)

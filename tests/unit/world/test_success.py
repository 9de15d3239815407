"""What counts as done, by figures and not by names: published ones, and ours that the docs state."""

import numpy as np
import pytest

from skillframe.frames import Pose, norm, rotation_matrix
from skillframe.world.scene import State

UPRIGHT = rotation_matrix(np.array([np.pi, 0.0, 0.0]))


def done(scene, position=(0.0, 0.0, 0.0), tilt=0.0, turn=0.0):
    """Whether the tool has reached its goal at a place [m], tilted about y and turned about z [degrees]."""
    lean, spin = rotation_matrix(np.radians([0.0, tilt, 0.0])), rotation_matrix(np.radians([0.0, 0.0, turn]))
    pose = Pose(np.array([position]), (spin @ lean @ UPRIGHT)[None])
    return bool(scene.goal(State(pose, np.zeros((1, 6))))[0])


def test_a_peg_is_in_once_its_tip_is_58_of_60_millimetres_deep(scene):
    peg = scene("peg_in_hole")
    assert not done(peg, (0.0, 0.0, -0.0579)) and done(peg, (0.0, 0.0, -0.0581))
    assert not done(peg, (0.0, 0.0, 0.0581))
    bottom = max(geom.position[2] + geom.size[2] for geom in peg.fixture[-1:])
    assert bottom == pytest.approx(-0.060)


def test_a_peg_beside_the_block_of_the_hole_or_under_it_is_not_in_however_deep(scene):
    """The block reaches 42 mm from the hole's axis. Policies that were trained on depth went round it, and below it."""
    peg = scene("peg_in_hole")
    assert done(peg, (0.0164, 0.0, -0.059)) and not done(peg, (0.0166, 0.0, -0.059))
    assert not done(peg, (0.0, 0.06, -0.059)) and not done(peg, (-0.06, 0.0, -0.2))
    assert done(peg, (0.0, 0.0, -0.0619)) and not done(peg, (0.0, 0.0, -0.0621))


def test_between_peg_and_hole_there_is_a_quarter_of_a_millimetre_all_round(scene):
    """Published: radius 16.5 mm and 0.25 mm of play. The hole's boxes touch a circle of its radius from outside."""
    peg = scene("peg_in_hole")
    walls = [np.array(geom.position[:2]) for geom in peg.fixture[:-1]]
    free = min(float(norm(middle)) - geom.size[0] for middle, geom in zip(walls, peg.fixture, strict=False))
    vertices = np.array(peg.tool.geoms[0].vertices)
    assert norm(vertices[:, :2]).max() == pytest.approx(0.0165, abs=1e-9)
    assert free - 0.0165 == pytest.approx(0.00025, abs=1e-9)


def test_a_coupler_is_flush_below_0_3_degrees_and_within_a_millimetre(scene):
    coupler = scene("hose_coupler")
    assert done(coupler, tilt=0.29) and not done(coupler, tilt=0.31)
    assert done(coupler, (0.0, 0.0, 0.0009)) and not done(coupler, (0.0, 0.0, 0.0011))


def test_a_coupler_beside_its_seat_is_not_flush_at_whatever_height(scene):
    """The seat is a plate of 140 mm. A face whose middle is past its side would tip over it."""
    coupler = scene("hose_coupler")
    for x, y in ((0.069, 0.0), (0.0, -0.069), (0.069, 0.069)):
        assert done(coupler, (x, y, 0.0)), (x, y)
    for x, y in ((0.071, 0.0), (0.0, -0.071), (0.2, 0.0), (-0.05, 0.3)):
        assert not done(coupler, (x, y, 0.0)), (x, y)


def test_couplers_outside_their_collar_are_not_locked(scene):
    """It leaves 9 mm of play and is 3 mm thick."""
    coupler, turn = scene("hose_coupler", interlock=0.7), np.degrees(0.7)
    assert done(coupler, (0.0119, 0.0, 0.0), turn=turn) and not done(coupler, (0.0121, 0.0, 0.0), turn=turn)
    assert not done(coupler, (0.0, 0.05, 0.0), turn=turn) and not done(coupler, (-0.2, 0.0, 0.0), turn=turn)


def test_couplers_are_locked_within_2_degrees_of_turn_1_5_of_tilt_and_1_5_millimetres(scene):
    coupler, turn = scene("hose_coupler", interlock=0.7), np.degrees(0.7)
    assert done(coupler, turn=turn - 2.0) and not done(coupler, turn=turn - 2.1)
    assert done(coupler, turn=turn, tilt=1.48) and not done(coupler, turn=turn, tilt=1.5)
    assert done(coupler, (0.0, 0.0, 0.0014), turn=turn) and not done(coupler, (0.0, 0.0, 0.0016), turn=turn)


def test_a_ball_is_at_the_bottom_within_a_millimetre_across_and_two_up(scene):
    """At rest on both slopes of 45 degrees its middle is 5 mm / cos 45 degrees high."""
    valley, high = scene("valley"), 0.005 * np.sqrt(2.0)
    assert done(valley, (0.0009, 0.0, high)) and not done(valley, (0.0011, 0.0, high))
    assert done(valley, (0.0, 0.0, high + 0.0019)) and not done(valley, (0.0, 0.0, high + 0.0021))


def test_a_ball_beyond_the_ends_of_the_valley_is_not_at_its_bottom(scene):
    """The slopes are 160 mm wide along the valley's line, with and without a wall."""
    valley, high = scene("valley"), 0.005 * np.sqrt(2.0)
    assert done(valley, (0.0, 0.0799, high)) and done(valley, (0.0, -0.0799, high))
    assert not done(valley, (0.0, 0.0801, high)) and not done(valley, (0.0, -0.2, high))
    walled = scene("valley", wall_distance=0.05)
    assert done(walled, (0.0, 0.0495, high)) and not done(walled, (0.0, 0.0801, high))


def rod(angle, gap, share=0.5, aside=0.0):
    """Tip and tilt [degrees] of the tool at `edge`: its axis crosses the edge at a share of its length from the tip."""
    along = np.array([-np.cos(np.radians(angle)), 0.0, np.sin(np.radians(angle))])  # from wrist to tip
    up = np.array([np.sin(np.radians(angle)), 0.0, np.cos(np.radians(angle))])
    return tuple(gap * up + 0.2 * share * along + [0.0, aside, 0.0]), 90.0 + angle


def test_a_rod_is_levered_where_it_lies_on_the_edge_within_10_degrees_of_level(scene):
    """Its radius is 8 mm: so far is its axis from the edge."""
    edge = scene("edge")
    for angle in (9.9, 0.0, -9.9):
        assert done(edge, *rod(angle, 0.008)), angle
    for angle in (10.1, -10.1, 45.0):
        assert not done(edge, *rod(angle, 0.008)), angle
    assert done(edge, *rod(5.0, 0.0099)) and not done(edge, *rod(5.0, 0.0101))
    assert not done(edge, *rod(5.0, 0.0059))


def test_a_level_rod_in_the_air_or_beside_the_table_or_below_it_is_not_levered(scene):
    edge = scene("edge")
    assert not done(edge, *rod(0.0, 0.06)) and not done(edge, *rod(0.0, -0.05)) and not done(edge, *rod(0.0, -0.008))
    assert done(edge, *rod(0.0, 0.008, aside=0.099)) and not done(edge, *rod(0.0, 0.008, aside=-0.101))
    for share in (-0.1, 1.1):  # all of it is before the edge, or over the table
        assert not done(edge, *rod(0.0, 0.008, share)), share
    assert not done(edge, (0.05, 0.0, 0.008), -90.0)  # the tip points away from the table


def test_a_plug_is_in_once_it_is_16_of_18_millimetres_deep(scene):
    socket = scene("socket")
    assert not done(socket, (0.0, 0.0, -0.0159)) and done(socket, (0.0, 0.0, -0.0161))
    assert done(socket, (0.0, 0.0, -0.0199)) and not done(socket, (0.0, 0.0, -0.0201))  # under the plate


def test_a_box_is_in_the_corner_of_the_pallets_within_a_centimetre(scene):
    """Wood: of the corner itself. Styrofoam: no further than that from both surfaces, and any depth in both."""
    wood, foam = scene("pallets"), scene("pallets", surface="styrofoam")
    x, y, z = np.add(wood.start_tip, (0.45, 0.0, -0.35))  # `away` of the stop, `above` the stack
    assert done(wood, (x - 0.0099, y, z)) and not done(wood, (x - 0.0101, y, z))
    assert not done(wood, (x - 0.008, y, z + 0.008))  # 11.3 mm
    x, y, z = np.add(foam.start_tip, (0.45, 0.0, -0.35))
    assert done(foam, (x + 0.1, y, z - 0.1)) and not done(foam, (x + 0.1, y, z + 0.0101))

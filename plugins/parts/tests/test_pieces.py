"""A part as convex pieces: together they are the part, and where they are not, the error says by how much."""

import numpy as np
import pytest
from manifold3d import Manifold
from skillframe_parts.pieces import distances, error_of, pieces_of
from skillframe_parts.sections import levels_of, section
from skillframe_parts.solid import arrays_of

from skillframe.robot.meshes import hull_of, is_convex
from tests.part_meshes import SIDES, box, hole, in_metres, keyed, rod

ROUNDING = 1e-12  # m; double precision of lengths of 0.1 m, a few operations deep
ALLOWED = 2e-5


def chamfered():
    low, high = (radius / np.cos(np.pi / SIDES) for radius in (5.2, 6.7))
    return hole(5.2, 12.0) - Manifold.cylinder(1.5, low, high, circular_segments=SIDES).translate([0, 0, -1.5])


EXACT = {
    "a blind hole": (hole(5.2, 12.0), SIDES + 1),  # a piece for each side, and the bottom
    "a chamfered hole": (chamfered(), 2 * SIDES + 1),
    "a hole lying on its side": (hole(5.2, 12.0).rotate([0, 90, 0]), SIDES + 1),
    "a keyed shaft": (keyed(5.0, 3.0, 1.5, -10.0, 8.0), 3),
    "a shaft with a shoulder": (rod(5.0, -10.0, 0.0) + rod(8.0, 0.0, 5.0), 2),
    "two bodies that are convex": (rod(5.0, -10.0, 0.0) + box((20, 20, 0), (25, 25, 5)), 2),
    "a cone": (Manifold.cylinder(10.0, 5.0, 3.0, circular_segments=SIDES), 1),
    "a plate with two holes": (box((-15, -10, 0), (15, 10, 3)) - rod(4.0, -1, 4).translate([-7, 0, 0])
                               - rod(4.0, -1, 4).translate([7, 0, 0]), None),
}  # fmt: skip


QUICK = ("a blind hole", "a chamfered hole", "a keyed shaft", "a cone")


@pytest.mark.parametrize(
    "name", [name if name in QUICK else pytest.param(name, marks=pytest.mark.slow) for name in EXACT]
)
def test_what_plane_faces_bound_is_held_exactly(name):
    solid, most = EXACT[name]
    solid = in_metres(solid)
    found = pieces_of(solid, ALLOWED)
    assert found.error < ROUNDING and not found.thinned
    assert most is None or len(found.hulls) <= most
    for hull in found.hulls:
        assert is_convex(hull.vertices, hull.faces, hull)


@pytest.mark.slow
def test_pieces_of_an_extrusion_do_not_overlap():
    """So their volumes add up to the part's."""
    solid = in_metres(hole(5.2, 12.0))
    assert sum(hull.volume for hull in pieces_of(solid, ALLOWED).hulls) == pytest.approx(solid.volume(), rel=1e-9)


def test_an_error_is_what_sticks_out_and_what_is_missing():
    solid = in_metres(box((0, 0, 0), (10, 10, 10)))
    for size, error in ((10.3, 0.3 * np.sqrt(3.0)), (9.9, 0.1 * np.sqrt(3.0))):  # from corner to corner
        vertices, _ = arrays_of(in_metres(box((0, 0, 0), (size, size, size))))
        assert error_of([hull_of(vertices)], solid) == pytest.approx(1e-3 * error, rel=1e-9)


def test_an_error_beyond_use_is_told_by_the_mean_thickness_of_what_sticks_out():
    """A cube of 10.3 mm and one of 10 mm in its corner: 2 V / A of what is between them."""
    vertices, _ = arrays_of(in_metres(box((0, 0, 0), (10.3, 10.3, 10.3))))
    solid = in_metres(box((0, 0, 0), (10, 10, 10)))
    mean = 2e-3 * (10.3**3 - 10.0**3) / (6.0 * 10.3**2)
    assert error_of([hull_of(vertices)], solid, 1e-5) == pytest.approx(mean, rel=1e-9)
    assert error_of([hull_of(vertices)], solid, 1e-3) == pytest.approx(3e-4 * np.sqrt(3.0), rel=1e-9)


@pytest.mark.slow
def test_a_round_hole_of_too_many_sides_is_thinned_within_what_is_allowed_and_its_error_measured():
    """40 sides take 41 pieces. With half of the sides the middle of one is r (1 - cos(pi / 20)) inside the corners."""
    allowed = 8e-5
    found = pieces_of(in_metres(hole(3.0, 4.0, 40, half=5.0, bottom=2.0)), allowed, 25)
    assert found.thinned and len(found.hulls) <= 25
    assert 0.9 * 3e-3 * (1.0 - np.cos(np.pi / 24)) < found.error <= allowed


def test_distances_are_those_of_points_faces_edges_and_corners():
    triangle = np.array([[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]])
    points = np.array([[0.2, 0.2, 0.5], [0.5, -2.0, 0.0], [4.0, 0.0, 3.0], [0.1, 0.1, 0.0]])
    np.testing.assert_allclose(distances(points, triangle), [0.5, 2.0, np.sqrt(18.0), 0.0], atol=1e-15)


def test_a_cross_section_is_filled_by_convex_polygons_that_move_with_height():
    vertices, faces = arrays_of(in_metres(chamfered()))
    levels = levels_of(vertices[:, 2])
    np.testing.assert_allclose(levels, 1e-3 * np.array([-17.0, -12.0, -1.5, 0.0]), atol=1e-15)
    slab = section(vertices, faces, levels[2], levels[3])
    for points, radius in ((slab.lower, 5.2), (slab.upper, 6.7)):
        area = sum(polygon_area(points[polygon]) for polygon in slab.polygons)
        round_hole = (
            SIDES * np.tan(np.pi / SIDES) * (1e-3 * radius) ** 2
        )  # a polygon whose sides are tangent to a circle
        assert area == pytest.approx(900e-6 - round_hole, rel=1e-9)


def polygon_area(points):
    x, y = points.T
    return 0.5 * float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))


def test_triangles_that_are_left_out_by_their_spheres_are_never_the_nearest():
    """Against every pair, on long thin triangles, whose spheres say little."""
    rng = np.random.default_rng(5)
    triangles = rng.uniform(-1.0, 1.0, (60, 1, 3)) + rng.uniform(-0.3, 0.3, (60, 3, 3)) * [1.0, 0.05, 1.0]
    points = rng.uniform(-2.0, 2.0, (200, 3))
    every = np.min([distances(points, triangle[None]) for triangle in triangles], axis=0)
    np.testing.assert_allclose(distances(points, triangles), every, atol=1e-12)

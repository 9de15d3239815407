"""Contact of parts of any shape: distances against closed forms, and that they agree with every triangle's."""

import manifold3d
import numpy as np
import pytest
from skillframe_parts.field import error_of, points_of, surface_of, winding_number
from skillframe_parts.solid import arrays_of

from skillframe.world.surfaces import available, exact_distances, triangles_of
from tests.part_meshes import box, hole, in_metres, rod

pytestmark = pytest.mark.skipif(not available(), reason="needs a C compiler")
CUBE = in_metres(box((-4, -3, -2), (4, 3, 2)))
HALF = np.array([4e-3, 3e-3, 2e-3])


@pytest.fixture(autouse=True, scope="module")
def few():
    """Larger cells, which are faster: what is exact is exact in them too."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("skillframe_parts.field.MOST_NODES", 1e5)
        patch.setattr("skillframe_parts.field._COARSE_NODES", 2e4)
        yield


def prepared(solid, beyond=1e-3):
    low, high = np.reshape(solid.bounding_box(), (2, 3))
    return surface_of(solid, low - beyond, high + beyond)


def box_distance(points):
    """Signed distance of a box, in closed form."""
    away = np.abs(points) - HALF
    return np.linalg.norm(np.maximum(away, 0.0), axis=1) + np.minimum(away.max(axis=1), 0.0)


@pytest.fixture(scope="module")
def cube():
    return prepared(CUBE)


def test_distance_is_that_of_a_box_at_its_edges_and_corners_too(cube):
    rng = np.random.default_rng(1)
    points = rng.uniform(-1.0, 1.0, (4000, 3)) * (HALF + 1e-4)
    points[:2000] = np.sign(points[:2000]) * HALF + rng.uniform(-1e-4, 1e-4, (2000, 3))  # corners
    points[2000:3000, :2] = np.sign(points[2000:3000, :2]) * HALF[:2] + rng.uniform(-1e-4, 1e-4, (1000, 2))  # edges
    true = box_distance(points)
    near = (true < 0.0) & (true > -1e-4)  # farther outside nothing but the sign counts
    assert near.sum() > 500 and (np.sign(cube.look_up(points)) == np.sign(true))[np.abs(true) > 1e-6].all()
    # linear cells within 1 um at their corners, floats of 1e-8 m; a grid alone is off by a quarter of its cell
    np.testing.assert_allclose(cube.look_up(points)[near], true[near], atol=2e-6)


def test_exact_distance_is_that_of_a_box():
    vertices, faces = arrays_of(CUBE)
    points = np.random.default_rng(2).uniform(-6e-3, 6e-3, (3000, 3))
    np.testing.assert_allclose(exact_distances(triangles_of(vertices, faces), points), box_distance(points), atol=1e-12)


def test_a_point_far_away_or_nowhere_is_outside(cube):
    points = np.array([[1.0, 0.0, 0.0], [np.nan, 0.0, 0.0], [np.inf, -np.inf, 0.0], [0.0, 0.0, 3e-3]])
    assert (cube.look_up(points) > 0.0).all()


@pytest.mark.slow
def test_inside_is_inside_a_concave_part():
    """A ring: its hole is outside, its wall inside, by closed form of the two circles."""
    surface = prepared(in_metres(rod(8.0, 0.0, 6.0, 64) - rod(5.0, -1.0, 7.0, 64)))
    angle = np.linspace(0.0, 6.28, 200)
    for radius, sign in ((4.8e-3, 1), (5.2e-3, -1), (7.8e-3, -1), (8.2e-3, 1)):
        circle = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), np.full(200, 3e-3)])
        assert (np.sign(surface.look_up(circle)) == sign).all()


@pytest.mark.slow
def test_the_stated_error_is_not_exceeded_where_it_was_not_measured():
    solid = in_metres(hole(5.2, 12.0, 48))
    low, high = np.reshape(solid.bounding_box(), (2, 3))
    surface = surface_of(solid, low, high)
    rng = np.random.default_rng(3)
    points = surface.points[rng.integers(len(surface.points), size=5000)] + rng.uniform(-1e-4, 1e-4, (5000, 3))
    exact = exact_distances(surface.triangles, points)
    off = np.abs(surface.look_up(points) - exact)[(exact < 0.0) & (exact > -1e-4)]
    # other points of the same kind; a grid alone is off by a quarter of its cell at edges
    assert off.max() < 2.0 * error_of(surface, low, high) < 0.08 * surface.grids[0].cell


@pytest.mark.slow
def test_where_the_other_part_cannot_come_a_coarse_grid_still_tells_inside():
    solid = in_metres(hole(5.2, 12.0, 24))
    surface = surface_of(solid, np.array([-6e-3, -6e-3, -13e-3]), np.array([6e-3, 6e-3, 1e-3]))
    fine, coarse = surface.grids
    assert fine.cell < coarse.cell
    assert surface.look_up(np.array([[14e-3, 0.0, -5e-3]]))[0] < 0.0 < surface.look_up(np.array([[14e-3, 0, 1e-3]]))[0]


def test_points_lie_on_the_surface_and_leave_no_gap(cube):
    vertices, faces = arrays_of(CUBE)
    found = points_of(vertices, faces, -HALF - 1e-3, HALF + 1e-3)
    np.testing.assert_allclose(box_distance(found.points), 0.0, atol=1e-9)
    rng = np.random.default_rng(4)
    some = rng.uniform(-1.0, 1.0, (500, 3)) * HALF
    axis = rng.integers(3, size=500)
    some[np.arange(500), axis] = np.sign(some[np.arange(500), axis]) * HALF[axis]
    gap = np.linalg.norm(some[:, None] - found.points, axis=-1).min(axis=1)
    assert gap.max() < np.sqrt(3.0) * found.spacing  # a point in every cube that the surface passes, up to its corners
    for corner in vertices:
        assert np.linalg.norm(found.points - corner, axis=1).min() < 1e-9  # corners are kept


def test_blocks_hold_their_points(cube):
    for k, (x, y, z, radius) in enumerate(cube.balls):
        block = cube.points[cube.first[k] : cube.first[k + 1]]
        assert len(block) and np.linalg.norm(block - [x, y, z], axis=1).max() < radius + 1e-12
    assert cube.first[-1] == len(cube.points)


def test_groups_hold_their_blocks_one_after_the_other(cube):
    assert cube.group[0] == 0 and cube.group[-1] == len(cube.balls) and (np.diff(cube.group) > 0).all()
    for k, (x, y, z, radius) in enumerate(cube.around):
        inside = cube.points[cube.first[cube.group[k]] : cube.first[cube.group[k + 1]]]
        assert np.linalg.norm(inside - [x, y, z], axis=1).max() < radius + 1e-12
    assert len(cube.around) < len(cube.balls) / 3


def test_no_point_that_is_passed_over_is_inside(cube):
    """A gap of 1 + n says that all within n quarters of a cell are outside, which the closed form has to confirm."""
    (grid,) = cube.grids
    points = np.random.default_rng(6).uniform(-1.0, 1.0, (100_000, 3)) * (HALF + 4.0 * grid.cell)
    place = np.floor((points - grid.origin) / grid.cell).astype(int)
    kept = ((place >= 0) & (place < np.array(grid.gap.shape) - 1)).all(axis=1)
    gap = grid.gap[tuple(place[kept].T)].astype(float)
    true = box_distance(points[kept])
    outside = gap > 0
    assert (true[outside] >= 0.25 * grid.cell * (gap[outside] - 1.0) - 1e-7).all()  # values are floats
    assert (cube.look_up(points[kept][outside]) >= 0.0).all()
    # and it is of use: of what is farther out than (1.8 + 0.25) x 1.15 + a cell's diagonal, everything is told
    assert (gap[true > 4.1 * grid.cell] > 1).all()
    assert (gap[true < 0.0] == 0).all()


@pytest.mark.slow
def test_a_ball_has_the_distance_of_a_ball():
    radius, sides = 6e-3, 96
    surface = prepared(manifold3d.Manifold.sphere(radius, sides))
    way = np.random.default_rng(5).normal(size=(2000, 3))
    way /= np.linalg.norm(way, axis=1)[:, None]
    sag = radius * (1.0 - np.cos(np.pi / sides)) * 2.0  # facets of a triangulated sphere lie inside it
    found = surface.look_up(way * (radius - 5e-5))
    assert (found > -5e-5 - 3e-6).all() and (found < -5e-5 + 2.0 * sag).all()


def test_a_closed_mesh_goes_once_round_what_is_inside_and_not_round_what_is_not():
    triangles = triangles_of(*arrays_of(CUBE))
    points = np.random.default_rng(3).uniform(-6e-3, 6e-3, (200, 3))
    turns = [winding_number(triangles, point) for point in points]
    np.testing.assert_allclose(turns, box_distance(points) < 0.0, atol=1e-9)


@pytest.mark.parametrize("rounds", [1.0, -1.0])
def test_a_sign_that_normals_get_wrong_is_no_contact_error(cube, monkeypatch, rounds):
    """Where more than two triangles meet at an edge, normals cancel: the yardstick is then wrong, not contact.

    Where a surface crosses itself, it goes round what is inside the other way.
    """

    def turned_round(triangles, points):
        return -exact_distances(triangles, points)

    low, high = np.full(3, -5e-3), np.full(3, 5e-3)
    right = error_of(cube, low, high)
    monkeypatch.setattr("skillframe_parts.field.exact_distances", turned_round)
    monkeypatch.setattr("skillframe_parts.field.winding_number", lambda *given: rounds * winding_number(*given))
    assert error_of(cube, low, high) == pytest.approx(right, abs=1e-9)

"""Seams of no width, and polygons that are not convex: a part is where its faces are, however they are cut."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from skillframe_parts.load import load
from skillframe_parts.mesh_repair import edges_of, mended
from skillframe_parts.solid import read_part

from tests.bad_meshes import obj
from tests.part_meshes import FILE
from tests.seams import gear, prism, ring, stl, volume_of

SQUARE = ring(12.5 * np.sqrt(2.0), 4, np.pi / 4), ring(2.25 * np.sqrt(2.0), 4, np.pi / 4), 0.0, 10.0, 4.0
KINDS = {
    "socket": SQUARE,
    "nut": (ring(9.0, 6), ring(4.2, 24), 0.0, 6.0, None),
    "gear": (gear(20.0, 24.0, 9), ring(5.0, 24), 0.0, 8.0, None),
    "cup": (ring(15.0, 24), ring(6.0, 16), 0.0, 20.0, 3.0),
}


def part(kind, seed, most=4):
    """Triangles of a part with seams, turned and moved, in an order of their own, and its volume [mm3]."""
    draw = np.random.default_rng(seed)
    triangles = prism(*KINDS[kind], draw, most)
    turned = triangles @ Rotation.random(random_state=seed).as_matrix().T + draw.uniform(-200.0, 200.0, 3)
    return turned[draw.permutation(len(turned))], volume_of(triangles)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_part_whose_faces_divide_their_rims_differently_is_closed_without_a_cap(kind, seed, tmp_path):
    triangles, volume = part(kind, seed)
    (tmp_path / "part.stl").write_bytes(stl(triangles))
    found = read_part(tmp_path / "part.stl", "mm")
    assert len(found.notes) == 1 and "edges split at corners that lie on them" in found.notes[0] and not found.places
    assert 1e9 * found.solid.volume() == pytest.approx(volume, rel=1e-5)  # single precision at 200 mm


def corners_of(triangles):
    vertices, number = np.unique(triangles.reshape(-1, 3), axis=0, return_inverse=True)
    return 1e-3 * vertices, number.reshape(-1, 3)


@pytest.mark.parametrize("orders", [15, pytest.param(60, marks=pytest.mark.slow)])
@pytest.mark.parametrize("gap", [0.0, 0.01])  # mm; the wider seam is closed by caps, and counts as mended
def test_a_socket_with_seams_is_one_part_in_any_order_of_its_triangles(gap, orders):
    """Rims of the top are not divided, those of the walls are. Once, 18 of 60 stayed open, and others got a lid."""
    draw = np.random.default_rng(0)
    walls, top = prism(*SQUARE, draw, 4), prism(*SQUARE, draw, 0)
    above = (walls[:, :, 2] == 10.0).all(axis=1), (top[:, :, 2] == 10.0).all(axis=1)
    walls = walls[~above[0]]
    at_corner = np.isin(np.round(np.abs(walls[:, :, :2]), 6), [12.5, 2.25]).all(axis=2)
    walls[(walls[:, :, 2] == 10.0) & ~at_corner, 2] -= gap
    vertices, faces = corners_of(np.concatenate([walls, top[above[1]]]))
    for seed in range(orders):
        draw = np.random.default_rng(seed)
        order = np.array([np.roll(face, draw.integers(3)) for face in draw.permutation(faces)])
        found = mended(vertices, order)
        corners = vertices[found.faces]
        assert edges_of(found.faces).odd == 0
        assert 1e9 * volume_of(corners) == pytest.approx(10.0 * 25.0**2 - 6.0 * 4.5**2, rel=1e-3)
        assert all(place.error <= 1.5e-3 * gap for place in found.places) and bool(found.places) == bool(gap)


def test_points_a_rounding_apart_are_one_wherever_they_lie(tmp_path):
    """Of a grid, some pairs would fall on either side of a line. Each corner of each triangle is off by up to 5 nm."""
    draw = np.random.default_rng(0)
    triangles = prism(*SQUARE, draw, 0) + 1.0  # mm, 25 mm large
    triangles = triangles + draw.uniform(-5e-6, 5e-6, triangles.shape)
    (tmp_path / "part.stl").write_bytes(stl(triangles))
    assert read_part(tmp_path / "part.stl", "mm").notes == ()


S, H = 12.5, 4.25
L = [(-H, -H), (H, -H), (H, 0.25), (0.25, 0.25), (0.25, H), (-H, H)]
BLOCK = [(x, y, z) for z in (0, 10) for x, y in ((-S, -S), (S, -S), (S, S), (-S, S))]
SIDES = [(0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7), (3, 2, 1, 0)]


def socket(rim, first=0, plain=False):
    """A block with a hole of a rim; its top is one face, its rim joined to that of the hole, from any corner on."""
    n = len(rim)
    vertices = BLOCK + [(x, y, z) for z in (4, 10) for x, y in rim]
    low, high = range(8, 8 + n), range(8 + n, 8 + 2 * n)
    walls = [(low[(i + 1) % n], low[i], high[i], high[(i + 1) % n]) for i in range(n)]
    joined = [4, 5, 6, 7, 4, high[0], *reversed(high)]
    tops = [tuple(joined[first:] + joined[:first])]
    if plain:
        tops = [(4 + i, 4 + (i + 1) % 4, high[(i + 1) % 4], high[i]) for i in range(4)]
    return vertices, [*SIDES, *walls, tuple(low), *tops]


def prism_of(rim):
    n = len(rim)
    sides = [(i, (i + 1) % n, n + (i + 1) % n, n + i) for i in range(n)]
    return [(x, y, z) for z in (4, 44) for x, y in rim], [tuple(range(n, 2 * n)), tuple(range(n - 1, -1, -1)), *sides]


def smaller(rim, play):
    """The rim without a play on each side; its sides are along x and y."""
    return [(x - play * np.sign(x - 0.1), y - play * np.sign(y - 0.1)) for x, y in rim]


@pytest.fixture
def pair(tmp_path):
    def make(rim, first=0, plain=False):
        plug = smaller(rim, 0.25)
        (tmp_path / "plug.obj").write_text(obj(*prism_of(plug[first:] + plug[:first])))
        (tmp_path / "socket.obj").write_text(obj(*socket(rim, first, plain)))
        (tmp_path / "fixture.toml").write_text(FILE.replace(".stl", ".obj"))
        return load(tmp_path / "fixture.toml").fit

    return make


@pytest.mark.parametrize("first", range(6))
def test_a_face_drawn_with_its_hole_leaves_the_hole_open(first, pair):
    """An L-shaped part and its hole, faces with any corner first: a fan over such a face would cover the hole."""
    fit = pair(L, first)
    assert fit.depth == pytest.approx(6e-3, rel=1e-9) and fit.clearance == pytest.approx(0.25e-3, rel=1e-6)


def test_a_face_drawn_with_its_hole_is_as_the_same_face_in_quads(pair):
    square = [(-H, -H), (H, -H), (H, H), (-H, H)]
    one, other = pair(square), pair(square, plain=True)
    assert one.depth == other.depth and one.gaps == pytest.approx(other.gaps, rel=1e-9)
    assert one.socket.volume() == pytest.approx(other.socket.volume(), rel=1e-9)


def test_parts_of_many_triangles_say_what_is_being_done(tmp_path, monkeypatch):
    from skillframe_parts import load as loading

    from tests.part_meshes import round_pair, write

    told = []
    load(write(tmp_path / "few", *round_pair()), told.append)
    assert told == []
    monkeypatch.setattr(loading, "MANY", 100)
    monkeypatch.setattr(loading, "_LOADED", {})
    load(write(tmp_path / "many", *round_pair(play=0.3)), told.append)
    assert (
        len(told) == 4 and "plug.stl and socket.stl have 1" in told[0] and told[1].startswith("1 of 3: finding the way")
    )

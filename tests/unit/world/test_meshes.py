"""Meshes of a scene that collide: convex and closed, or refused."""

import dataclasses

import mujoco
import numpy as np
import pytest

from skillframe.errors import InputError, UnknownName
from skillframe.execution.recorder import geom_json
from skillframe.frames import rotation_matrix
from skillframe.world.scene import Geom
from skillframe.world.shapes import surface_of_revolution


def tube(outer=0.03, inner=0.01, height=0.05, segments=24, through=True):
    """A ring about z as vertices and triangles, closed. Or a pot that is `height` deep under a floor as thick again."""
    angle = 2.0 * np.pi * np.arange(segments) / segments
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    low = -height if through else -2.0 * height
    profile = [(outer, low), (outer, 0.0), (inner, 0.0), (inner, -height)]
    vertices = np.concatenate([np.column_stack([r * circle, np.full(segments, z)]) for r, z in profile])
    faces = []
    for ring in range(4 if through else 3):
        a, b = ring * segments, (ring + 1) % 4 * segments
        for i in range(segments):
            j = (i + 1) % segments
            faces += [(a + i, a + j, b + j), (a + i, b + j, b + i)]
    if not through:
        faces += [(0, i + 1, i) for i in range(1, segments - 1)]
        faces += [(3 * segments, 3 * segments + i, 3 * segments + i + 1) for i in range(1, segments - 1)]
    return vertices, np.array(faces)


def box(x, y, z):
    """Vertices and triangles of a box with these edges [m]."""
    vertices = np.array([[i, j, k] for i in (0.0, x) for j in (0.0, y) for k in (0.0, z)])
    sides = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return vertices, np.array([t for a, b, c, d in sides for t in ((a, b, c), (a, c, d))])


def with_fixture(scene, vertices, faces, **more):
    return dataclasses.replace(scene("free"), fixture=(Geom(kind="mesh", vertices=vertices, faces=faces, **more),))


def test_a_mesh_with_a_hole_is_refused_in_one_sentence_with_what_its_hull_fills(scene):
    """A ring of radii r < R: the hull is the disc, which holds r^2 / (R^2 - r^2) more. 1/8 for 10 and 30 mm."""
    with pytest.raises(InputError, match=r"mesh 0 of the fixture: is not convex: its hull holds 12 % more") as caught:
        with_fixture(scene, *tube())
    assert "split it into convex pieces" in str(caught.value)


def test_a_small_hole_in_a_large_plate_is_seen_where_a_ratio_of_volumes_sees_nothing(scene):
    from skillframe.robot.meshes import hull_of, volume_of

    vertices, faces = tube(outer=0.5, inner=0.003, height=0.02)
    assert hull_of(vertices).volume / volume_of(vertices, faces) < 1.0 + 1e-4  # 0.003^2 / 0.5^2 = 3.6e-5
    with pytest.raises(InputError, match="is not convex"):
        with_fixture(scene, vertices, faces)


def test_a_blind_hole_is_refused_and_so_is_a_tool_with_one(scene):
    with pytest.raises(InputError, match="mesh 0 of the fixture: is not convex"):
        with_fixture(scene, *tube(through=False))
    free = scene("free")
    vertices, faces = tube()
    cup = dataclasses.replace(free.tool, geoms=(Geom(kind="mesh", vertices=vertices, faces=faces),))
    with pytest.raises(InputError, match="mesh 0 of the tool: is not convex"):
        dataclasses.replace(free, tool=cup)


def test_a_hole_that_is_only_drawn_stays_as_it_is(scene):
    assert with_fixture(scene, *tube(), collide=False).fixture[0].faces is not None


@pytest.mark.parametrize("turn", [(0.0, 0.0, 0.0), (0.3, -1.1, 0.7)])
@pytest.mark.parametrize("single", [False, True], ids=["double", "as an STL rounds"])
def test_a_convex_mesh_passes_in_any_attitude_and_as_an_stl_rounds_it(scene, turn, single):
    profile = np.array([[0.01, -0.1], [0.02, -0.05], [0.02, 0.0], [0.012, 0.02]])
    vertices, faces = surface_of_revolution(profile, 64)
    vertices = vertices @ rotation_matrix(np.array(turn)).T + 0.7
    vertices = vertices.astype(np.float32).astype(float) if single else vertices
    assert with_fixture(scene, vertices, faces)
    assert with_fixture(scene, vertices[faces].reshape(-1, 3), np.arange(3 * len(faces)).reshape(-1, 3))


def test_the_dent_of_a_notched_block_is_its_depth():
    """A wedge cut into the top of a block to a depth of 7 mm: its lowest edge lies 7 mm under the hull."""
    from skillframe.robot.meshes import dent, hull_of, volume_of

    x, top = [0.0, 0.04, 0.05, 0.06, 0.1], [0.02, 0.02, 0.013, 0.02, 0.02]
    vertices = np.array([[a, y, z] for y in (0.0, 0.05) for a, b in zip(x, top, strict=True) for z in (0.0, b)])
    faces = []
    for i in range(4):
        lower, upper = 2 * i, 2 * i + 1
        faces += [(upper, upper + 2, upper + 10), (upper + 2, upper + 12, upper + 10)]
        faces += [(lower, lower + 10, lower + 2), (lower + 2, lower + 10, lower + 12)]
        faces += [(lower, lower + 2, upper), (upper, lower + 2, upper + 2)]
        faces += [(lower + 10, upper + 10, lower + 12), (upper + 10, upper + 12, lower + 12)]
    faces += [(0, 1, 10), (1, 11, 10), (8, 18, 9), (9, 18, 19)]
    faces = np.array(faces)
    hull = hull_of(vertices)
    assert dent(vertices, faces, hull) == pytest.approx(0.007, abs=1e-12)
    assert hull.volume - volume_of(vertices, faces) == pytest.approx(0.02 * 0.007 / 2.0 * 0.05, rel=1e-9)


@pytest.mark.parametrize(
    ("points", "message"),
    [
        (np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]), "is flat"),
        (box(80.0, 30.0, 10.0)[0], "is 80 m long .are its vertices in millimetres"),
        (box(8e-5, 3e-5, 1e-5)[0], "is 8e-05 m long .was it scaled to metres twice"),
        (np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, np.nan]]), "not finite"),
    ],
    ids=["flat", "millimetres", "scaled twice", "not a number"],
)
def test_a_mesh_that_cannot_be_a_part_is_refused_with_what_is_wrong(scene, points, message):
    with pytest.raises(InputError, match=message):
        with_fixture(scene, points, None)


def test_a_mesh_that_is_not_closed_is_refused_since_its_inside_cannot_be_told(scene):
    vertices, faces = box(0.1, 0.1, 0.1)
    with pytest.raises(InputError, match=r"is not closed \(3 open edges\)"):
        with_fixture(scene, vertices, faces[1:])


def test_a_kind_of_geom_that_there_is_not_is_refused_by_name(scene):
    with pytest.raises(UnknownName, match="unknown kind 'torus'"):
        dataclasses.replace(scene("free"), fixture=(Geom(kind="torus"),))


def test_what_is_drawn_of_a_mesh_without_triangles_is_what_collides(scene):
    """The drawn triangles enclose the volume that MuJoCo gives the compiled mesh."""
    from skillframe.robot.meshes import volume_of

    vertices = np.random.default_rng(5).normal(0.0, 0.03, (60, 3))
    drawn = geom_json(Geom(kind="mesh", vertices=vertices))
    spec = mujoco.MjSpec()
    spec.add_mesh(name="m", uservert=vertices.ravel(), inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX)
    geom = spec.worldbody.add_body(name="b").add_geom(type=mujoco.mjtGeom.mjGEOM_MESH)
    geom.meshname, geom.density = "m", 1.0
    volume = float(spec.compile().body("b").mass[0])
    # MuJoCo keeps vertices in single precision, the drawing to a micrometre: 1e-6 of 0.1 m, thrice
    assert volume_of(np.array(drawn["vertices"]), np.array(drawn["faces"])) == pytest.approx(volume, rel=1e-4)

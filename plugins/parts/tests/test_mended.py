"""Meshes whose faults have one cure are mended, say so, and state an error that geometry confirms."""

import manifold3d
import numpy as np
import pytest
import trimesh
from skillframe_parts.load import load
from skillframe_parts.mesh_repair import edges_of, mended
from skillframe_parts.solid import arrays_of, read_part, united
from skillframe_parts.world import PartsParams, build_world

from skillframe.errors import InputError
from tests.bad_meshes import binary_stl, cube, joined, pin, plug, quads
from tests.part_meshes import FILE, box, round_pair, write

MM = 1e-3
V, F = plug()
P, T = pin(), [t for q in quads() for t in ([q[0], q[1], q[2]], [q[0], q[2], q[3]])]


def volume(mesh):
    return trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).volume


def closed(mesh):
    return bool((edges_of(mesh.faces).shared == 2).all())


def test_a_sound_mesh_stays_as_it_is():
    found = mended(V, F)
    assert found.vertices is V and found.faces is F and found.notes == () and found.places == ()


@pytest.mark.parametrize("share", [0.1, 0.2])
def test_a_hole_in_a_ball_is_off_by_the_height_of_the_cap_that_is_missing(share):
    radius = 10.0 * MM
    vertices, faces = arrays_of(manifold3d.Manifold.sphere(radius, 128))
    gone = vertices[faces].mean(axis=1)[:, 2] > radius * np.cos(share * np.pi / 4.0)
    found = mended(vertices, faces[~gone])
    rim = np.concatenate([place.points for place in found.places])
    least, most = radius - rim[:, 2].max(), radius - rim[:, 2].min()  # the rim runs along triangles, up and down
    assert closed(found) and len(found.places) == 1 and found.notes[0].startswith("closed 1 hole, largest")
    assert least < found.places[0].error < most
    lost = [np.pi * height**2 * (3.0 * radius - height) / 3.0 for height in (least, most)]
    ball = trimesh.Trimesh(vertices, faces, process=False).volume
    assert lost[0] < ball - volume(found) < lost[1]


def test_a_hole_in_a_plane_face_is_closed_exactly():
    vertices, faces = (a.copy() for a in arrays_of(manifold3d.Manifold.cube([0.01] * 3).refine(20)))
    middle = vertices[faces].mean(axis=1)
    gone = (middle[:, 2] > 0.00999) & (np.abs(middle[:, :2] - 0.005) < 0.0006).all(axis=1)
    found = mended(vertices, faces[~gone])
    assert gone.sum() == 8 and closed(found) and volume(found) == pytest.approx(1e-6, rel=1e-12)
    assert found.places[0].error < 1e-12 and found.notes[0].endswith("the surface may be off by 0 mm there")


def test_a_lid_that_is_missing_is_off_by_half_its_width():
    """Of a slender rod, 2 by 2 by 20 mm: nobody knows whether its end was flat, or half a ball."""
    vertices, faces = arrays_of(box((-1, -1, -10), (1, 1, 10)).scale([MM] * 3))
    lid = (vertices[faces][:, :, 2] > 9.9 * MM).all(axis=1)
    found = mended(vertices, faces[~lid])
    assert lid.sum() == 2 and closed(found) and found.places[0].error == pytest.approx(1.0 * MM, rel=1e-9)


def test_a_corner_on_the_edge_of_a_neighbour_is_no_hole():
    faces = [*[t for t in T if t != [4, 5, 6]], [4, 8, 6], [8, 5, 6]]
    found = mended(np.r_[P, [[0, -3.5, 8]]] * MM, np.array(faces))
    assert closed(found) and volume(found) == pytest.approx(980e-9, rel=1e-12) and found.places == ()
    assert found.notes == ("edges split at corners that lie on them: 1",)


def test_a_wide_hole_stays_open():
    vertices, faces = cube()
    assert edges_of(mended(vertices * MM, faces[2:]).faces).odd > 0


@pytest.mark.parametrize(
    "faces",
    [np.r_[F, F], np.r_[F, F[:, ::-1]], np.r_[F, F[:1]], np.r_[F, F, F], np.r_[F, F[5:9, [1, 2, 0]]]],
    ids=["twice", "both ways", "one twice", "three times", "some, from other corners"],
)
def test_doubled_triangles_are_one(faces):
    found = mended(V * MM, faces)
    assert closed(found) and len(found.faces) == len(F) and abs(volume(found)) == pytest.approx(1500e-9, rel=1e-9)
    assert f"doubled triangles left out: {len(faces) - len(F)}" in found.notes


def test_bodies_that_share_a_face_keep_it():
    """Its two triangles lie there both ways round. One of each would be a wall that parts one body in two."""
    vertices, faces = joined(box((0, 0, 0), (5, 5, 5)), box((5, 0, 0), (9, 5, 5)))
    vertices, same = np.unique(vertices, axis=0, return_inverse=True)
    found = mended(vertices * MM, same.reshape(-1)[faces])
    assert len(found.faces) == len(faces) and found.notes == () and volume(found) == pytest.approx(225e-9, rel=1e-12)


@pytest.mark.parametrize("which", [slice(0, 1), slice(None, None, 3), slice(5, 17)])
def test_turned_triangles_are_turned_as_most(which):
    faces = F.copy()
    faces[which] = faces[which, ::-1]
    found = mended(V * MM, faces)
    assert np.array_equal(np.sort(found.faces), np.sort(F)) and volume(found) == pytest.approx(1500e-9, rel=1e-9)
    assert found.notes == (f"triangles turned as their neighbours: {len(F[which])}",)


def test_a_cavity_stays_turned_inwards():
    hollow = box((0, 0, 0), (10, 10, 10)) - box((2, 2, 2), (8, 8, 8))
    vertices, faces = arrays_of(hollow.scale([MM] * 3))
    faces[0] = faces[0, ::-1]
    assert volume(mended(vertices, faces)) == pytest.approx(784e-9, rel=1e-9)


def test_a_strip_of_one_side_is_refused(tmp_path):
    turn = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
    rows = []
    for side in (-3.0, 3.0):
        out, up = 10.0 + side * np.cos(turn / 2), side * np.sin(turn / 2)
        rows.append(np.stack([out * np.cos(turn), out * np.sin(turn), up], axis=1))
    one, two = np.arange(24), 24 + np.arange(24)
    after, beyond = np.r_[one[1:], two[0]], np.r_[two[1:], one[0]]
    faces = np.concatenate([np.stack([one, after, two], 1), np.stack([two, after, beyond], 1)])
    (tmp_path / "strip.stl").write_bytes(binary_stl(np.concatenate(rows), faces))
    with pytest.raises(InputError, match="open edges"):
        read_part(tmp_path / "strip.stl", "mm")


def finned(height, at=8.0):
    """The pin with a fin of no thickness that hangs on an edge of it and reaches out by a height."""
    side, top = np.nonzero((V[:, 2] == at) & (V[:, 0] > 0.0))[0][:2]
    out = V[[side, top]].mean(axis=0) * [1.0, 1.0, 0.0]
    apex = V[[side, top]].mean(axis=0) + out / np.linalg.norm(out) * height
    return np.r_[V, [apex]], np.r_[F, [[side, top, len(V)]]]


def test_a_sheet_is_left_out_and_is_off_by_its_height(tmp_path):
    vertices, faces = finned(0.5)
    found = mended(vertices * MM, faces)
    assert np.array_equal(found.faces, F) and found.places[0].error == pytest.approx(0.5 * MM, rel=1e-6)
    said = "1 sheet that bound nothing left out, largest 2.6 mm; the surface may be off by 0.5 mm there"
    assert found.notes == (said,)


@pytest.fixture
def pair(tmp_path):
    def make(mesh, name="one", text=FILE):
        path = write(tmp_path / name, *round_pair(), text)
        (path.parent / "plug.stl").write_bytes(binary_stl(*mesh))
        return path

    return make


def test_what_was_mended_counts_where_the_parts_can_meet(pair):
    """0.09 mm are let pass, a quarter of the play. The upper end of the pin stands 8 mm out of its hole."""
    far, near = load(pair(finned(0.5), "far")), load(pair(finned(0.05, -12.0), "near"))
    assert far.contact_error < 1e-6 and near.contact_error == pytest.approx(0.05 * MM, abs=1e-6)
    with pytest.raises(InputError, match=r"plug.stl: is open, or bounds nothing, near .* 0.5 mm, more than 0.093 mm"):
        load(pair(finned(0.5, -12.0), "refused"))
    scene = build_world(pair(finned(0.05, -12.0), "near"), PartsParams())
    assert "plug.stl: 1 sheet that bound nothing left out" in scene.params["notes"]
    assert scene.params["contact_error"] == near.contact_error


@pytest.mark.slow
def test_where_a_part_lies_is_where_its_mended_places_are(pair):
    """The same pin, drawn upside down and put right by its pose: what is near stays near."""
    vertices, faces = finned(0.5, -12.0)
    turned = FILE.replace('"plug.stl"', '"plug.stl"\nassembled = { rpy = ["180deg", 0, 0] }')
    with pytest.raises(InputError, match="bounds nothing"):
        load(pair((vertices * [1.0, -1.0, -1.0], faces), "turned", turned))
    vertices, faces = finned(0.5)
    assert load(pair((vertices * [1.0, -1.0, -1.0], faces), "far", turned)).contact_error < 1e-6
    everything = (
        FILE.replace('"plug.stl"', '"plug.stl"\nassembled = { xyz = [1, 0, -2], rpy = [0, "90deg", 0] }')
        .replace('"socket.stl"', '"socket.stl"\npose = { xyz = [1, 0, -2], rpy = [0, "90deg", 0] }')
        .replace("[contact]", "[task]\naxis = [-1, 0, 0]\n[contact]")
    )
    assert load(pair(finned(0.05, -12.0), "moved", everything)).contact_error == pytest.approx(0.05 * MM, abs=1e-6)
    assert load(pair(finned(0.5), "moved far", everything)).contact_error < 1e-6


def test_no_volume_is_lost_unsaid_where_bodies_touch_along_an_edge(tmp_path):
    """A cup of five boxes whose floor is turned by 90 degrees of eight digits: slivers, an edge of four triangles."""
    walls = [box((-8, 0, -8), (-4.2, 15, 8)), box((4.2, 0, -8), (8, 15, 8)),
             box((-4.2, 0, -8), (4.2, 15, -4.2)), box((-4.2, 0, 4.2), (4.2, 15, 8))]  # fmt: skip
    floor = box((-2, -8, -8), (2, 8, 8)).rotate([0.0, 0.0, np.degrees(1.5707963)]).translate([0.0, -2.0, 0.0])
    cup = united([*walls, floor])
    vertices, faces = arrays_of(cup)
    lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in vertices] + [f"f {a} {b} {c}" for a, b, c in faces + 1]
    (tmp_path / "cup.obj").write_text("\n".join(lines))
    try:
        found, said = read_part(tmp_path / "cup.obj", "mm").solid.volume(), ""
    except InputError as error:
        found, said = None, str(error)
    volume = 1e-9 * (15 * (16**2 - 8.4**2) + 4 * 16**2)
    assert "is off by 6.1 % where it touches itself along an edge" in said or found == pytest.approx(volume, rel=1e-4)

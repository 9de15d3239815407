import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from skillframe_parts.solid import arrays_of
from skillframe_reports.shapes import SEGMENTS, creased, face_normals, merge, mesh_of, section

from skillframe.frames import norm, unit
from tests.part_meshes import box
from tests.report_fakes import LENGTH, RADIUS, peg_mesh

# a regular polygon of n sides in a circle has the share (n / 2 pi) sin(2 pi / n) of its area
POLYGON = SEGMENTS / (2 * np.pi) * np.sin(2 * np.pi / SEGMENTS)


def volume(mesh):
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    return float((a * np.cross(b, c)).sum() / 6.0)


def geom(kind, size, **more):
    return {"kind": kind, "size": size, "rgba": [0.5, 0.5, 0.5, 1.0], **more}


@pytest.mark.parametrize(
    ("kind", "size", "expected", "tolerance"),
    [
        ("box", [0.1, 0.2, 0.3], 8 * 0.1 * 0.2 * 0.3, 1e-12),
        ("cylinder", [0.1, 0.3], POLYGON * np.pi * 0.01 * 0.6, 1e-12),
        ("sphere", [0.1], 4 / 3 * np.pi * 1e-3, 0.03),  # facets of 11 and 15 degrees take away up to 3 %
        ("capsule", [0.1, 0.3], np.pi * 0.01 * 0.6 + 4 / 3 * np.pi * 1e-3, 0.02),
    ],
)
def test_primitives_enclose_their_volume_with_normals_pointing_out(kind, size, expected, tolerance):
    mesh = mesh_of(geom(kind, size))
    assert volume(mesh) == pytest.approx(expected, rel=max(tolerance, 1e-9))
    flat = unit(face_normals(mesh.vertices, mesh.faces))
    solid = norm(face_normals(mesh.vertices, mesh.faces)) > 1e-12  # a pole's ring has faces without area
    for corner in range(3):
        assert ((flat * mesh.normals[mesh.faces[:, corner]]).sum(-1)[solid] > 0.7).all()


def test_position_and_attitude_place_a_geometry():
    half = np.sqrt(0.5)
    turned = mesh_of(geom("box", [0.1, 0.2, 0.3], position=[1.0, 2.0, 3.0], quaternion=[0.0, 0.0, half, half]))
    assert turned.vertices.min(axis=0) == pytest.approx([0.8, 1.9, 2.7])
    assert turned.vertices.max(axis=0) == pytest.approx([1.2, 2.1, 3.3])


def test_an_unknown_kind_draws_nothing():
    assert len(mesh_of(geom("torus", [1.0])).faces) == 0


@given(st.floats(-0.12, 0.12), st.floats(0.0, 2 * np.pi), st.floats(-1.0, 1.0))
@pytest.mark.slow
def test_two_halves_of_a_cut_box_make_up_the_whole(offset, azimuth, rise):
    box = mesh_of(geom("box", [0.1, 0.1, 0.1]))
    normal = unit(np.array([np.cos(azimuth), np.sin(azimuth), rise]))
    point = offset * normal
    halves = volume(section(box, point, normal)) + volume(section(box, point, -normal))
    assert halves == pytest.approx(volume(box), abs=1e-9)


@pytest.mark.parametrize("at", [0.0, 0.3, 0.5, 4.2])
@pytest.mark.parametrize("normal", [(0.0, -1.0, 0.0), (0.0, 0.6, -0.8), (1.0, 0.0, 0.0)])
def test_two_halves_of_a_cut_block_with_a_hole_and_a_second_body_make_up_the_whole(normal, at):
    """Signed volumes add up only where both halves are closed, so a cap may cover neither the hole nor the gap."""
    block = box((-2.0, -1.0, -1.0), (2.0, 1.0, 1.0)) - box((-3.0, -0.5, -0.4), (3.0, 0.5, 0.5))
    vertices, faces = arrays_of(block + box((4.0, -0.5, -0.5), (5.0, 0.5, 0.5)))
    whole = mesh_of({**geom("mesh", [1.0]), "vertices": vertices.tolist(), "faces": faces.tolist()})
    normal = np.array(normal)
    halves = [section(whole, at * normal, side * normal) for side in (1.0, -1.0)]
    assert volume(whole) == pytest.approx(4.0 * (4.0 - 0.9) + 1.0)
    # to 1e-6 of it: the ends of edges are taken to a nanometre, and this is metres large
    assert sum(map(volume, halves)) == pytest.approx(volume(whole), rel=1e-6)


def test_a_cut_cylinder_is_closed():
    half = section(mesh_of(geom("cylinder", [0.1, 0.3])), np.zeros(3), np.array([0.0, -1.0, 0.0]))
    assert volume(half) == pytest.approx(0.5 * POLYGON * np.pi * 0.01 * 0.6, rel=1e-9)
    assert half.vertices[:, 1].min() >= -1e-12


def test_creased_normals_are_smooth_around_and_sharp_over_the_rim():
    peg = mesh_of(peg_mesh())
    mantle = (np.abs(norm(peg.vertices[:, :2]) - RADIUS) < 1e-6) & (peg.vertices[:, 2] < LENGTH - 1e-6)
    top = peg.vertices[:, 2] > LENGTH - 1e-6
    radial = (unit(peg.vertices[mantle, :2] + 0.0) * peg.normals[mantle, :2]).sum(-1)
    assert radial.min() > 0.9
    assert set(np.round(peg.normals[top, 2], 3)) == {0.0, 1.0}


def test_merged_meshes_keep_their_faces():
    a, b = (mesh_of(geom("box", [s, s, s])) for s in (0.1, 0.2))
    both = merge([a, b])
    assert volume(both) == pytest.approx(volume(a) + volume(b))
    assert len(creased(both.vertices, both.faces).faces) == len(both.faces)

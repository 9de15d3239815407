"""Meshes are found where ROS users keep them, measured where they can be, and never needed."""

import struct

import numpy as np
import pytest

from skillframe.robot.bodies import rigid_bodies
from skillframe.robot.meshes import mesh_vertices, resolve_mesh
from skillframe.robot.urdf import read_urdf


@pytest.fixture
def package(tmp_path):
    """A package `my_arm` with one mesh: a tetrahedron that reaches 2 m."""
    folder = tmp_path / "ws" / "src" / "my_arm"
    (folder / "meshes").mkdir(parents=True)
    (folder / "urdf").mkdir()
    corners = [(0, 0, 0), (2, 0, 0), (0, 1, 0)]
    record = struct.pack("<12fH", 0, 0, 1, *[float(x) for corner in corners for x in corner], 0)
    (folder / "meshes" / "link.stl").write_bytes(b"x" * 80 + struct.pack("<I", 1) + record)
    return folder


def test_a_package_is_found_above_the_urdf_in_the_path_variables_and_by_relative_name(package, tmp_path, monkeypatch):
    inside, mesh = package / "urdf" / "arm.urdf", package / "meshes" / "link.stl"
    elsewhere = tmp_path / "elsewhere" / "arm.urdf"
    assert resolve_mesh("package://my_arm/meshes/link.stl", inside) == mesh
    assert resolve_mesh("../meshes/link.stl", inside).resolve() == mesh
    assert resolve_mesh(f"file://{mesh}", elsewhere) == mesh
    assert resolve_mesh("package://my_arm/meshes/link.stl", elsewhere) is None
    for variable, value in {"ROS_PACKAGE_PATH": package.parent, "SKILLFRAME_PATH": package}.items():
        with monkeypatch.context() as context:
            context.setenv(variable, str(value))
            assert resolve_mesh("package://my_arm/meshes/link.stl", elsewhere) == mesh
    assert resolve_mesh("package://my_arm/meshes/none.stl", inside) is None
    assert resolve_mesh("http://example.org/link.stl", inside) is None
    assert resolve_mesh("", inside) is None


def test_the_same_corners_are_read_from_binary_stl_text_stl_and_obj(package, tmp_path):
    wanted = np.array([[0, 0, 0], [2, 0, 0], [0, 1, 0]], dtype=float)
    text = (
        "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 2 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid"
    )
    (tmp_path / "a.STL").write_text(text)
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 2 0 0\nv 0 1 0\nvn 0 0 1\nf 1 2 3\n")
    for file in (package / "meshes" / "link.stl", tmp_path / "a.STL", tmp_path / "a.obj"):
        np.testing.assert_array_equal(mesh_vertices(file), wanted)


def test_what_is_no_mesh_cannot_be_measured_and_raises_nothing(tmp_path):
    for name, content in {
        "a.dae": b"<COLLADA/>",
        "b.stl": b"",
        "c.stl": b"vertex a b c",
        "d.obj": b"v 1 nan 2",
        "e.obj": b"v 1 x 2",
    }.items():
        (tmp_path / name).write_bytes(content)
        assert mesh_vertices(tmp_path / name) is None


def test_a_body_is_as_large_as_its_scaled_mesh_and_of_unknown_size_where_the_mesh_is_missing(package, urdf):
    def text(uri):
        shape = f'<visual><origin xyz="0 0 1"/><geometry><mesh filename="{uri}" scale="10 1 1"/></geometry></visual>'
        return urdf.robot(urdf.link("a"), urdf.link("b", shape), urdf.joint("j", "a", "b"))

    file = package / "urdf" / "arm.urdf"
    file.write_text(text("package://my_arm/meshes/link.stl"))
    assert rigid_bodies(read_urdf(file))[1].reach == pytest.approx(np.hypot(20.0, 1.0))
    file.write_text(text("package://my_arm/meshes/gone.stl"))
    body = rigid_bodies(read_urdf(file))[1]
    assert body.bound
    assert body.reach == 0.0


@pytest.mark.parametrize(
    ("shape", "reach"),
    [
        ('<sphere radius="0.5"/>', 0.5),
        ('<box size="2 4 4"/>', 3.0),
        ('<cylinder radius="3" length="8"/>', 5.0),
        ('<capsule radius="1" length="2"/>', 2.0),
    ],
)
def test_a_body_reaches_to_the_farthest_point_of_its_shapes(save, urdf, shape, reach):
    text = urdf.robot(urdf.link("a", f"<collision><geometry>{shape}</geometry></collision>"))
    assert rigid_bodies(read_urdf(save(text)))[0].reach == pytest.approx(reach)

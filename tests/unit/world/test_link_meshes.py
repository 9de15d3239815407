"""Meshes of links that are open, flat, unreadable or of millions of triangles: a sentence each, in bounded time."""

import struct
import time

import numpy as np
import pytest

from skillframe.campaign.folder import _copy_robot_file
from skillframe.errors import InputError
from skillframe.robot.meshes import MOST, thinned
from skillframe.robot.model import load_model
from skillframe.robot.spec import load_robot
from skillframe.world.collisions import collision_problems
from skillframe.world.link_shapes import link_shapes

INERTIAL = '<inertial><mass value="2"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>'
TETRA = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)], dtype=float)[
    [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]
]


def stl(path, triangles):
    record = np.zeros(len(triangles), dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    record["corners"] = triangles
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(b" " * 80 + struct.pack("<I", len(triangles)) + record.tobytes())


def sphere(rings, radius=0.2):
    """Triangles of a sphere, 2 rings x 2 rings squares."""
    turn, tilt = np.meshgrid(np.linspace(0, 2 * np.pi, 2 * rings + 1), np.linspace(0, np.pi, rings + 1), indexing="ij")
    points = radius * np.stack([np.cos(turn) * np.sin(tilt), np.sin(turn) * np.sin(tilt), np.cos(tilt)], axis=-1)
    a, b, c, d = points[:-1, :-1], points[1:, :-1], points[1:, 1:], points[:-1, 1:]
    return np.concatenate([np.stack(corner, axis=2).reshape(-1, 3, 3) for corner in ((a, b, c), (a, c, d))])


def robot(folder, mesh='<mesh filename="m.stl"/>'):
    folder.mkdir(parents=True, exist_ok=True)
    text = f"""<robot name="r"><link name="base"/><link name="arm">{INERTIAL}<collision><geometry>{mesh}</geometry>
    </collision></link><link name="hand"/><joint name="a" type="revolute"><parent link="base"/><child link="arm"/>
    <axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="9" velocity="1"/></joint><joint name="h" type="fixed">
    <parent link="arm"/><child link="hand"/></joint></robot>"""
    (folder / "r.urdf").write_text(text)
    (folder / "robot.toml").write_text('urdf = "r.urdf"\n[[arm]]\nname = "arm"\ntool_frame = "hand"\n')
    return load_model(load_robot(folder / "robot.toml"))


def found(model):
    return [(problem.code, problem.message) for problem in collision_problems(model)]


def test_a_sound_mesh_gets_no_sentence(tmp_path):
    stl(tmp_path / "m.stl", TETRA)
    assert found(robot(tmp_path)) == []


def test_an_open_a_flat_and_an_unreadable_mesh_get_a_sentence_each(tmp_path):
    stl(tmp_path / "m.stl", TETRA[:3])  # three edges have one triangle only
    ((code, text),) = found(robot(tmp_path))
    assert (code, text) == (
        "open_mesh", "mesh 'm.stl' is not closed (3 open edges): collisions know its surface, not its inside",
    )  # fmt: skip
    stl(tmp_path / "m.stl", TETRA[:1])
    assert found(robot(tmp_path))[0] == ("flat_mesh", "mesh 'm.stl' has no volume: collisions do not know it")
    stl(tmp_path / "m.stl", TETRA)
    assert found(robot(tmp_path, '<mesh filename="m.stl" scale="1e-7 1e-7 1e-7"/>'))[0][0] == "flat_mesh"
    (tmp_path / "m.dae").write_text("<COLLADA/>")
    ((code, text),) = found(robot(tmp_path, '<mesh filename="m.dae"/>'))
    assert code == "unread_mesh"
    assert "cannot be read as STL, OBJ or COLLADA" in text


DAE = """<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit name="centimeter" meter="0.01"/><up_axis>Y_UP</up_axis></asset>
<library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="pa" count="12">0 0 0 100 0 0 0 100 0 0 0 100</float_array><technique_common>
<accessor source="#pa" count="4" stride="3"><param name="X" type="float"/><param name="Y" type="float"/>
<param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles count="4"><input semantic="VERTEX" source="#v" offset="0"/><p>0 2 1 0 1 3 0 3 2 1 2 3</p></triangles>
</mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node id="n"><translate>50 0 0</translate>
<instance_geometry url="#g"/></node></visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene></COLLADA>"""


def test_a_mesh_in_collada_counts_with_its_unit_and_where_its_node_puts_it(tmp_path):
    pytest.importorskip("collada")
    (tmp_path / "m.dae").write_text(DAE)
    model = robot(tmp_path, '<mesh filename="m.dae"/>')
    assert found(model) == []
    (shape,) = link_shapes(model)
    assert not shape.guessed and sorted(shape.geom.vertices.tolist()) == sorted(
        (TETRA.reshape(-1, 3)[[0, 1, 2, 5]] + [0.5, 0, 0]).tolist()
    )


def test_meshes_that_cannot_be_read_get_one_sentence_together(tmp_path, monkeypatch):
    monkeypatch.setattr("skillframe.world.link_shapes.missing_collada", lambda: True)
    names = [f"m{i}.dae" for i in range(5)]
    for name in names:
        (tmp_path / name).write_text("<COLLADA/>")
    joined = "</geometry></collision><collision><geometry>".join(f'<mesh filename="{name}"/>' for name in names)
    (problem,) = collision_problems(robot(tmp_path, joined))
    assert problem.message.startswith("meshes 'm0.dae', 'm1.dae', 'm2.dae' and 2 more cannot be read as STL, OBJ or")
    assert problem.fix.startswith("pip install 'skillframe[collada]', or ")


def test_a_body_of_which_nothing_is_drawn_is_as_thick_as_a_link_of_its_length(tmp_path):
    text = f"""<robot name="r"><link name="base"/><link name="boom">{INERTIAL}</link><link name="hand">{INERTIAL}</link>
    <joint name="a" type="revolute"><parent link="base"/><child link="boom"/><axis xyz="0 0 1"/>
    <limit lower="-1" upper="1" effort="9" velocity="1"/></joint><joint name="b" type="revolute">
    <parent link="boom"/><child link="hand"/><origin xyz="3 0 0"/><axis xyz="0 0 1"/>
    <limit lower="-1" upper="1" effort="9" velocity="1"/></joint></robot>"""
    (tmp_path / "r.urdf").write_text(text)
    (tmp_path / "robot.toml").write_text('urdf = "r.urdf"\n[[arm]]\nname = "arm"\ntool_frame = "hand"\n')
    (shape,) = link_shapes(load_model(load_robot(tmp_path / "robot.toml")))
    assert shape.guessed and shape.geom.size == pytest.approx((0.3, 1.5))


def test_a_mesh_that_is_not_there_is_named_by_the_audit_and_by_nothing_else(tmp_path):
    from skillframe.robot.audit import audit

    model = robot(tmp_path, '<mesh filename="none.stl"/>')
    assert found(model) == []
    assert "collisions do not know it" in next(p.message for p in audit(model).problems if p.code == "missing_mesh")


def test_a_file_too_large_to_be_read_is_named_and_not_read(tmp_path, monkeypatch):
    monkeypatch.setattr("skillframe.robot.meshes.LARGEST_FILE", 1000)
    stl(tmp_path / "m.stl", sphere(10))
    assert found(robot(tmp_path))[0][0] == "unread_mesh"


@pytest.mark.slow
def test_a_mesh_of_a_million_triangles_takes_seconds_and_keeps_its_shape(tmp_path):
    """A sphere of 0.2 m: the farthest corner in any direction lies within a cell of the grid, 0.4 m / 400, of it."""
    triangles = sphere(500)
    assert len(triangles) == 1_000_000
    stl(tmp_path / "m.stl", triangles)
    model = robot(tmp_path)
    began = time.process_time()
    (shape,) = link_shapes(model)
    assert time.process_time() - began < 20.0  # it took 5 s; without thinning it took minutes
    assert len(shape.geom.vertices) < 2 * MOST
    ways = np.random.default_rng(1).normal(size=(200, 3))
    ways /= np.linalg.norm(ways, axis=1)[:, None]
    farthest = (shape.geom.vertices @ ways.T).max(axis=0)
    assert np.all(np.abs(farthest - 0.2) < 1.7e-3)  # a cell's diagonal
    assert found(model)[0][1].startswith("mesh 'm.stl' has 1000000 triangles")


def test_thinned_points_are_few_are_some_of_the_points_and_keep_the_corners_of_a_box():
    rng = np.random.default_rng(0)
    corners = np.array([[x, y, z] for x in (0.0, 0.5) for y in (0.0, 0.3) for z in (0.0, 0.1)])
    points = np.concatenate([rng.uniform(0.0, 1.0, (100_000, 3)) * [0.5, 0.3, 0.1], corners])
    few = thinned(points)
    assert len(few) <= MOST + 500
    assert set(map(tuple, few)) <= set(map(tuple, points))
    distance = np.linalg.norm(few[None] - corners[:, None], axis=-1).min(axis=1)
    assert np.all(distance < 0.5 / 400 * 3**0.5)


@pytest.mark.parametrize("uri", ["meshes/m.stl", "package://my_arm/meshes/m.stl"])
def test_a_campaigns_copy_of_a_robot_knows_the_same_shapes_where_the_original_is_gone(tmp_path, uri):
    home, away = tmp_path / "here" / "my_arm", tmp_path / "there"
    stl(home / "meshes" / "m.stl", TETRA)
    (given,) = link_shapes(robot(home, f'<mesh filename="{uri}" scale="0.1 0.1 0.1"/>'))
    copy = away / _copy_robot_file(home / "robot.toml", away)
    (tmp_path / "here").rename(tmp_path / "gone")
    (copied,) = link_shapes(load_model(load_robot(copy)))
    assert copied.geom.kind == "mesh"
    assert np.array_equal(copied.geom.vertices, given.geom.vertices)


def test_a_mesh_outside_the_robots_folder_is_refused_for_a_campaign(tmp_path):
    stl(tmp_path / "m.stl", TETRA)
    robot(tmp_path / "one" / "two" / "three", '<mesh filename="../../../m.stl"/>')
    with pytest.raises(InputError, match=r"put robot\.toml, URDF and meshes into one folder"):
        _copy_robot_file(tmp_path / "one" / "two" / "three" / "robot.toml", tmp_path / "away")

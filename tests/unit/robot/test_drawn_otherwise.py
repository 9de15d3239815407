"""Robots as exporters write them: placeholder masses, meshes in millimetres, degrees, flanges with x outward."""

import struct

import numpy as np
import pytest

from skillframe.errors import UnknownName
from skillframe.robot.audit import audit
from skillframe.robot.describe import as_json, describe
from skillframe.robot.kinematics import tool_pose
from skillframe.robot.model import load_model
from skillframe.robot.spec import load_robot, robot_names

ARM = '[[arm]]\nname = "arm"\ntool_frame = "flange"\n'


@pytest.fixture
def made(urdf, save):
    def make(toml=ARM, *, masses=(4.0, 2.0), length=0.4, shape="", limit=urdf.LIMIT, more="", second="revolute"):
        links = [urdf.link(n, urdf.inertial(m, length) + shape) for n, m in zip("ab", masses, strict=True)]
        far = f"0.1 0 {length}"
        mount = (
            f'<joint name="mount" type="fixed"><parent link="b"/><child link="flange"/><origin xyz="{far}"/></joint>'
        )
        joints = [
            urdf.joint("j0", "base", "a", inside=limit),
            urdf.joint("j1", "a", "b", second, axis="0 1 0", xyz=far, inside=urdf.LIMIT + more),
        ]
        return load_robot(save(urdf.robot(urdf.link("base"), *links, *joints, mount, urdf.link("flange")), toml))

    return make


def codes(robot, severity):
    return [p.code for p in audit(robot).problems if p.severity == severity]


@pytest.mark.parametrize(("masses", "length"), [((0.03, 0.03), 3.5), ((5.0, 5.0), 4.5), ((1.0, 1.0), 4.0)])
def test_a_machine_of_some_metres_that_weighs_as_much_as_a_template_is_not_usable(made, masses, length):
    (found,) = [p for p in audit(made(masses=masses, length=length)).problems if p.code == "placeholder_mass"]
    assert found.severity == "fatal"
    assert f"all that moves weighs {sum(masses):.2g} kg together, and robots of that reach some" in found.message
    lines = found.fix.splitlines()[2:]
    assert len(lines) == 2 and all("guessed = true" in line for line in lines)


def test_the_lines_that_check_prints_for_placeholders_make_a_robot_that_is_usable(made):
    light = made(masses=(0.03, 0.03), length=3.5)
    (found,) = [p for p in audit(light).problems if p.code == "placeholder_mass"]
    mended = made(ARM + "\n".join(found.fix.splitlines()[1:]), masses=(0.03, 0.03), length=3.5)
    result = audit(mended)
    assert result.usable and result.mass_kg > 100.0
    heavy = audit(load_model(light), total_kg=12000.0)
    assert next(p for p in heavy.problems if p.code == "placeholder_mass").fix.count("guessed = true") == 2


@pytest.mark.parametrize("name", sorted(robot_names()))
def test_no_shipped_robot_is_taken_for_a_placeholder_or_a_giant(name):
    assert not {"placeholder_mass", "giant_mesh", "limit_in_another_unit"} & {
        p.code for p in audit(load_robot(name)).problems
    }


@pytest.mark.parametrize(("masses", "length"), [((0.3, 0.2), 0.15), ((0.8, 0.5), 0.4), ((120.0, 60.0), 2.0)])
def test_small_light_and_large_arms_are_let_alone(made, masses, length):
    assert "placeholder_mass" not in codes(made(masses=masses, length=length), "fatal")


def bar(path, size):
    """A box of three edges as binary STL."""
    x, y, z = size
    corners = np.array([[i, j, k] for i in (0, x) for j in (0, y) for k in (0, z)], dtype="<f4")
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangles = [corners[list(t)] for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]
    content = b"".join(bytes(12) + t.tobytes() + b"\0\0" for t in triangles)
    path.write_bytes(bytes(80) + struct.pack("<I", len(triangles)) + content)


@pytest.mark.parametrize(("scale", "fatal"), [("1 1 1", ["giant_mesh"]), ("0.001 0.001 0.001", [])])
def test_a_mesh_in_millimetres_without_a_scale_is_not_usable(made, tmp_path, scale, fatal):
    bar(tmp_path / "bar.stl", (40.0, 40.0, 300.0))
    mesh = f'<mesh filename="{tmp_path / "bar.stl"}" scale="{scale}"/>'
    robot = made(shape=f"<collision><geometry>{mesh}</geometry></collision>", length=0.3)
    found = [p for p in audit(robot).problems if p.severity == "fatal"]
    assert [p.code for p in found] == fatal * 2
    if fatal:
        assert "is 300 m long, and the robot reaches 0.632 m from joint to joint" in found[0].message
        assert 'scale="0.001 0.001 0.001"' in found[0].fix


@pytest.mark.parametrize(
    ("limit", "words"),
    [
        ('lower="-170" upper="170" effort="50" velocity="2"', "deg"),
        ('lower="-1" upper="1" effort="50" velocity="1500"', "deg/s or rpm"),
        ('lower="-1e9" upper="1e9" effort="50" velocity="1000"', None),
        ('lower="-6.28" upper="6.28" effort="50" velocity="30"', None),
    ],
)
def test_limits_in_degrees_and_speeds_in_rpm_are_named(made, limit, words):
    found = [p for p in audit(made(limit=f"<limit {limit}/>")).problems if p.code == "limit_in_another_unit"]
    assert bool(found) == (words is not None)
    assert all(f"if {words} are meant" in p.fix for p in found)


@pytest.mark.parametrize("axis", ["x", "-x", "y", "-y", "z", "-z"])
def test_the_axis_of_the_flange_that_points_out_may_be_said(made, axis):
    plain = load_model(made())
    robot = load_model(made(ARM + f'tool_axis = "{axis}"\n'))
    link, tool = (tool_pose(r.model, r.home + 0.3, r.tool_frames[0]) for r in (plain, robot))
    out = (-1.0 if "-" in axis else 1.0) * link.rotation[:, "xyz".index(axis[-1])]
    np.testing.assert_allclose(tool.rotation[:, 2], out, atol=1e-12)
    np.testing.assert_allclose(tool.position, link.position, atol=1e-15)
    assert np.linalg.det(tool.rotation) == pytest.approx(1.0)
    assert (f"its {axis} axis out along the tool" in describe(robot)) == (axis != "z")
    assert as_json(robot)["arms"][0]["tool_axis"] == axis


@pytest.mark.parametrize("name", ["mount", "j1"])
def test_a_tool_frame_that_is_a_joint_s_name_is_refused_as_that(made, name):
    with pytest.raises(UnknownName, match=f"a joint is called '{name}'; a tool_frame is a link of the URDF"):
        load_model(made(ARM.replace("flange", name)))


def test_a_follower_without_limits_is_named_with_the_cure(made):
    robot = made(more='<mimic joint="j0"/>', second="continuous")
    (found,) = [p for p in audit(robot).problems if p.code == "mimic_independent"]
    assert "joint 'j1' is continuous, and a joint without limits neither follows nor leads" in found.message
    assert "make it revolute" in found.fix and "/" not in found.message


def test_a_mesh_is_looked_at_once_however_many_links_are_drawn_with_it_and_wherever(made, tmp_path, monkeypatch):
    from skillframe.world import link_shapes

    bar(tmp_path / "bar.stl", (0.04, 0.05, 0.3123))
    seen = []
    look = link_shapes._looked_at
    monkeypatch.setattr(link_shapes, "_looked_at", lambda *args: seen.append(1) or look(*args))
    mesh = f'<geometry><mesh filename="{tmp_path / "bar.stl"}"/></geometry>'
    shapes = "".join(f'<collision><origin xyz="0 0 {k}" rpy="{k} 0 0"/>{mesh}</collision>' for k in (0.0, 0.1, 0.2))
    robot = load_model(made(shape=shapes))
    known = link_shapes.link_shapes(robot)
    assert len(known) == 6 and len(seen) == 1
    placed = np.array(known[1].geom.vertices)
    turn = np.array([[1, 0, 0], [0, np.cos(0.1), -np.sin(0.1)], [0, np.sin(0.1), np.cos(0.1)]])
    corners = np.array([[x, y, z] for x in (0, 0.04) for y in (0, 0.05) for z in (0, 0.3123)]) @ turn.T + [0, 0, 0.1]
    np.testing.assert_allclose(placed[np.lexsort(placed.T)], corners[np.lexsort(corners.T)], atol=1e-7)


def test_check_without_meshes_reads_none_and_says_so(made, tmp_path, monkeypatch, capsys):
    from skillframe.cli.main import run
    from skillframe.robot import bodies

    bar(tmp_path / "bar.stl", (40.0, 40.0, 300.0))
    mesh = f'<collision><geometry><mesh filename="{tmp_path / "bar.stl"}"/></geometry></collision>'
    folder = str(made(shape=mesh).folder)
    assert run(["robots", "--check", folder]) == 1
    monkeypatch.setattr(bodies, "mesh_vertices", lambda path: 1 / 0)
    capsys.readouterr()
    assert run(["robots", "--check", folder, "--no-meshes"]) == 0
    said = capsys.readouterr()
    assert "meshes are not read" in said.err and "giant_mesh" not in said.out and "missing_mesh" not in said.out

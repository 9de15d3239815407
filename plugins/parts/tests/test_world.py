"""A fixture file as a world: parameters from the file, parts where they belong, seated when assembled."""

import dataclasses

import numpy as np
import pytest
from skillframe_parts import load
from skillframe_parts.fit import corners, lowest
from skillframe_parts.world import GRIPPER
from skillframe_testkit.checks import check_world

from skillframe.errors import InputError
from skillframe.extend import make_scene
from skillframe.extend.registry import registry
from skillframe.frames import Pose, matrix_from_quaternion, norm, rotation_matrix
from skillframe.world.scene import State
from tests.part_meshes import FILE, round_pair, write

DEPTH, PLAY = 0.012, 0.2


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    return write(tmp_path_factory.mktemp("pair"), *round_pair(PLAY))


def scene_of(path, **params):
    return make_scene(registry().world(str(path)), params)


def state(position, tilt=0.0, about="y"):
    turn = rotation_matrix(tilt * np.eye(3)["xyz".index(about)]) @ np.diag([1.0, -1.0, -1.0])
    return State(Pose(np.array([position], dtype=float), turn[None]), np.zeros((1, 6)))


def test_the_files_values_are_the_defaults_of_its_parameters(tmp_path):
    text = FILE.replace("0.2", "0.35") + '[task]\nseated = { height = "0.5mm" }\nstart = { above_mouth = "3mm" }\n'
    path = write(tmp_path, *round_pair(), text)
    scene = scene_of(path)
    assert (scene.friction, scene.params["height"], scene.start_tip[2]) == (0.35, 0.0005, 0.003)
    assert scene_of(path, friction=0.1).friction == 0.1
    with pytest.raises(InputError, match="friction"):
        scene_of(path, fricton=0.1)
    with pytest.raises(InputError, match="beyond 0 to 5"):
        scene_of(path, friction=9.0)


def test_seated_is_the_assembled_pose_within_height_sideways_and_tilt(path):
    scene = scene_of(path)
    inside, outside = 0.99, 1.01
    limits = {"height": (0, 0, 1), "sideways": (1, 0, 0)}
    assert scene.goal(state((0, 0, -DEPTH)))[0]
    for key, axis in limits.items():
        for share, there in ((inside, True), (outside, False)):
            moved = np.array([0, 0, -DEPTH]) + share * scene.params[key] * np.array(axis)
            assert scene.goal(state(moved))[0] == there
    for share, there in ((inside, True), (outside, False)):
        assert scene.goal(state((0, 0, -DEPTH), share * scene.params["tilt"]))[0] == there
    assert scene.goal(state((0, 0, -DEPTH), 2.0, about="z"))[0]  # a turn about the axis is no tilt
    assert scene.way.of_m == pytest.approx(DEPTH)


def test_parts_lie_where_they_were_drawn_when_the_tool_is_at_the_goal(path):
    """The corners of the held part's pieces, taken to the fixture frame, are those of the pin."""
    scene = scene_of(path)
    place = state((0, 0, -DEPTH)).tip.at(-np.array(scene.tool.frames["tip"]))
    corners = np.concatenate([geom.vertices for geom in scene.tool.geoms if geom.collide])
    corners = corners @ place.rotation[0].T + place.position[0]
    np.testing.assert_allclose([corners[:, 2].min(), corners[:, 2].max()], [-DEPTH, 0.008], atol=1e-9)
    np.testing.assert_allclose(norm(corners[:, :2]), 0.005, atol=1e-9)
    tops = [geom.vertices[:, 2].max() for geom in scene.fixture if geom.kind == "mesh"]
    assert max(tops) == pytest.approx(0.0, abs=1e-9)


def test_the_tool_weighs_what_part_and_gripper_weigh_and_turns_like_them(path):
    """The pin is a cylinder for whom inertia is known; its polygon has sin(2a) / 2a of the area, a = pi / sides."""
    scene = scene_of(path)
    a, radius, length, grip = np.pi / 12, 0.005, 0.020, 0.2
    mass = 2700.0 * np.pi * radius**2 * length * np.sin(2 * a) / (2 * a)
    assert scene.tool.mass == pytest.approx(GRIPPER + mass, rel=1e-6)
    middle = grip - 0.5 * length
    center = (mass * middle + GRIPPER * 0.5 * grip) / scene.tool.mass
    np.testing.assert_allclose(scene.tool.center_of_mass, [0.0, 0.0, center], atol=1e-8)
    own = mass * length**2 / 12 + GRIPPER * grip**2 / 12
    about = own + mass * (middle - center) ** 2 + GRIPPER * (0.5 * grip - center) ** 2
    assert scene.tool.inertia[0] == pytest.approx(about, rel=1e-4)  # the pin's r^2 / 4 is left out: 1e-7 of 1e-3


def test_no_start_stands_in_the_fixture(path):
    """The lift leaves the lowest edge of the pin where the tip of an upright one is."""
    scene = scene_of(path)
    tilt = np.array([[0.0, 0.2, 0.0], [0.1, 0.1, 0.0]])
    angle = np.linalg.norm(tilt, axis=1)
    lift = scene.start_lift(np.zeros((2, 3)), tilt)
    assert (lift <= 0.005 * np.sin(angle) + 1e-9).all()  # corners of a polygon on the circle
    assert (lift >= 0.005 * np.sin(angle) * np.cos(np.pi / 12) - 1e-9).all()


def test_demonstrations_start_tilted_in_the_mouth_from_two_sides(path):
    starts = scene_of(path).task.starts
    assert [sorted(start) for start in starts] == [
        ["start.offset_z", "start.tilt_y"],
        ["start.offset_z", "start.tilt_x"],
    ]
    for start in starts:
        assert -0.0017 - 1e-9 <= start["start.offset_z"] < 0.0  # 1 mm above the mouth, and 0.7 mm into it


@pytest.mark.parametrize("free_above", [0.004, np.inf])
def test_a_demonstration_begins_above_what_rises_over_the_mouth(path, monkeypatch, free_above):
    """Where the tilted part does not fit into the mouth it climbs; where nothing is free it is over all of it."""
    loaded = load.load(path)
    rising = loaded.fit._replace(socket=loaded.fit.socket.translate([0.0, 0.0, 0.01]))
    monkeypatch.setattr(load, "_is_free", lambda found, tilt, height: height > free_above)
    for height, tilt in load._starts(rising, loaded.file):
        lowest_corner = height + float(lowest(corners(rising), tilt[None])[0])
        if free_above < np.inf:
            assert free_above < height <= free_above + 0.001
        else:
            assert lowest_corner >= 0.01 + loaded.file.task.start.above_mouth - 1e-12


def test_results_say_depth_clearance_error_and_the_hashes_of_every_file(path):
    said = scene_of(path).params
    assert said["depth"] == pytest.approx(DEPTH) and said["contact_error"] < 1e-12 and said["backend"] == "pieces"
    assert {key for key in said if key.startswith("sha256")} == {
        "sha256 of fixture.toml", "sha256 of plug.stl", "sha256 of socket.stl"
    }  # fmt: skip
    assert dataclasses.asdict(registry().world(str(path)).params()).keys() <= said.keys()


@pytest.mark.slow
def test_a_part_that_changed_is_read_again(tmp_path):
    path = write(tmp_path, *round_pair())
    first = scene_of(path).params["clearance"]
    write(tmp_path, *round_pair(0.3))
    assert scene_of(path).params["clearance"] == pytest.approx(first + 1e-4, rel=1e-6)


@pytest.mark.slow
def test_it_conforms_as_any_world(path):
    assert check_world(registry().world(str(path))) == []


def test_the_start_attitude_points_the_tool_down(path):
    np.testing.assert_allclose(matrix_from_quaternion(scene_of(path).start_quaternion), np.diag([1.0, -1.0, -1.0]))

import re
from pathlib import Path

import mujoco
import numpy as np
import pytest
from skillframe_worlds.hooks import skillframe_worlds as world_types

from skillframe.errors import InputError
from skillframe.execution.recorder import drawn_bodies
from skillframe.extend import make_scene
from skillframe.frames import norm
from skillframe.world.placement import fixture_poses
from skillframe.world.plant import Plant
from skillframe.world.shapes import filleted_peg, hole, quaternion_about, slope

RECORDS = {record.name: record for record in world_types()}
WITH_GOAL = ["valley", "funnel", "peg_in_hole", "hose_coupler", "edge"]


@pytest.mark.parametrize("world", RECORDS)
def test_every_world_builds_keeps_its_parameters_and_can_be_described(world):
    scene = make_scene(RECORDS[world], {})
    assert scene.name == world
    assert set(scene.params) == set(RECORDS[world].params.__dataclass_fields__)
    assert "tip" in scene.tool.frames
    assert scene.tool.hand in scene.tool.frames


def test_the_docs_have_a_row_with_a_small_picture_of_every_world_and_of_no_other():
    docs = Path(__file__).parents[3] / "docs"
    page = (docs / "reference" / "worlds.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `(\w+)` \|.*!\[\1\]\(\.\./images/worlds/\1\.png\) \|$", page, re.MULTILINE)
    assert rows == list(RECORDS)
    sizes = {path.stem: path.stat().st_size for path in (docs / "images" / "worlds").glob("*.png")}
    assert sizes.keys() == RECORDS.keys() and max(sizes.values()) < 60_000


@pytest.mark.parametrize("world", RECORDS)
@pytest.mark.parametrize("sign", [0.0, 1.0, -1.0])
def test_no_start_of_a_demonstration_touches_anything_and_none_is_a_goal(plant, world, sign):
    if world == "pit" and sign < 0.0:
        pytest.skip("its faces differ, so the mirror image of a start lies inside the opposite one")
    for start in make_scene(RECORDS[world], {}).task.starts:
        now = plant("free_tool", world, {key: sign * value for key, value in start.items()})
        np.testing.assert_array_equal(now.contact_force(), 0.0)
        if world in WITH_GOAL:
            assert not now.scene.goal(now.tip_state())[0]


@pytest.mark.parametrize(
    ("world", "draws"),
    [
        ("peg_in_hole", {"start.tilt_y": 0.28}),
        ("peg_in_hole", {"start.tilt_x": -0.28, "start.offset_y": 0.003}),
        ("hose_coupler", {"start.tilt_x": 0.2}),
        ("valley", {"start.offset_x": 0.03, "start.tilt_y": 0.1}),
        ("funnel", {"start.offset_x": 0.02, "start.offset_y": -0.02}),
    ],
)
def test_a_tilted_or_shifted_start_is_lifted_clear_of_the_fixture(plant, world, draws):
    now = plant("free_tool", world, draws)
    now.step(now.kinematics(np.zeros(3)).bias.copy(), np.arange(1))
    np.testing.assert_array_equal(now.contact_force(), 0.0)


@pytest.mark.parametrize(
    ("world", "params", "said"),
    [
        ("peg_in_hole", {"clearance": 0.0}, "clearance: 0 m is beyond 1um to 50mm"),
        ("peg_in_hole", {"fillet": 0.02}, "needs fillet < radius"),
        ("peg_in_hole", {"done_depth": 0.07}, "done_depth"),
        ("valley", {"slope": 1.5}, "slope"),
        ("valley", {"friction": -0.1}, "friction"),
        ("funnel", {"faces": 2}, "faces"),
        ("hose_coupler", {"segments": 4}, "segments"),
        ("edge", {"tilt": 0.1}, "tilt"),
    ],
)
def test_parameters_that_make_no_sense_are_refused_by_name(world, params, said):
    with pytest.raises(InputError, match=said):
        make_scene(RECORDS[world], params)


def test_a_parameter_that_does_not_exist_is_refused_with_the_nearest_one():
    with pytest.raises(InputError, match="did you mean 'clearance'"):
        make_scene(RECORDS["peg_in_hole"], {"clearence": 0.001})


def test_the_peg_of_the_tests_is_the_published_one_with_our_fillet():
    params = make_scene(RECORDS["peg_in_hole"], {}).params
    assert (params["radius"], params["length"], params["clearance"]) == (0.0165, 0.080, 0.00025)
    assert (params["fillet"], params["segments"], params["depth"], params["boxes"]) == (0.005, 48, 0.060, 32)


def test_the_peg_s_vertices_lie_on_the_cylinder_the_fillet_or_the_tip_face():
    radius, fillet, tip = 0.0165, 0.005, 0.2
    vertices = filleted_peg(radius, 0.08, fillet, 48, tip).vertices
    r, z = norm(vertices[:, :2]), vertices[:, 2]
    on_arc = np.abs(np.hypot(r - (radius - fillet), z - (tip - fillet)) - fillet) < 1e-12
    on_top = np.abs(r - radius) < 1e-12
    assert np.all(on_arc | on_top)
    assert z.max() == pytest.approx(tip)
    assert z.min() == pytest.approx(tip - 0.08)


def test_a_mesh_s_triangles_enclose_its_volume_outwards():
    """Gauss: a closed, outward surface encloses sum a . (b x c) / 6. The polygon's area is n/2 r^2 sin(2 pi / n)."""
    peg = filleted_peg(0.0165, 0.08, 0.005, 48, 0.2)
    a, b, c = (peg.vertices[peg.faces[:, i]] for i in range(3))
    volume = np.linalg.det(np.stack([a, b, c], axis=1)).sum() / 6.0
    prism = 24 * 0.0165**2 * np.sin(2 * np.pi / 48) * 0.08
    assert 0.98 * prism < volume < prism  # less only by the fillet


def test_the_hole_is_never_narrower_than_stated_and_wider_only_at_its_corners():
    """The ring of boxes is circumscribed: the free radius is r at the middles and r / cos(pi / n) at the corners."""
    radius, boxes = 0.01675, 32
    walls = hole(radius, 0.06, boxes, 0.025)[:-1]
    for azimuth in np.linspace(0.0, 2 * np.pi, 97):
        direction = np.array([np.cos(azimuth), np.sin(azimuth)])
        free = np.inf
        for box in walls:
            centre = np.array(box.position[:2])
            normal = centre / norm(centre)
            if normal @ direction > 0.1:
                free = min(free, (centre @ normal - box.size[0]) / (normal @ direction))
        assert radius - 1e-12 <= free <= radius / np.cos(np.pi / boxes) + 1e-12


@pytest.mark.parametrize("azimuth", [0.0, 1.0, np.pi])
def test_a_slope_s_upper_face_passes_the_origin_at_its_angle(azimuth):
    plate = slope(0.6, azimuth, 0.1, 0.05)
    x, y, z, w = plate.quaternion
    normal = np.array([2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)])
    expected = [-np.sin(0.6) * np.cos(azimuth), -np.sin(0.6) * np.sin(azimuth), np.cos(0.6)]
    np.testing.assert_allclose(normal, expected, atol=1e-12)
    assert np.array(plate.position) @ normal + plate.size[2] == pytest.approx(0.0, abs=1e-12)


def test_quaternions_about_axes_are_x_y_z_w():
    np.testing.assert_allclose(quaternion_about("y", np.pi / 2), [0, np.sqrt(0.5), 0, np.sqrt(0.5)])


@pytest.mark.parametrize("world", ["valley", "funnel"])
def test_the_analytic_region_is_the_slope_less_the_friction_angle(world):
    scene = make_scene(RECORDS[world], {"slope": 0.6, "friction": 0.3})
    assert scene.analytic["largest_tilt_rad"] == pytest.approx(0.6 - np.arctan(0.3))


def test_what_is_drawn_are_all_bodies_in_the_order_of_their_poses(plant):
    now = plant("panda", "peg_in_hole")
    bodies = drawn_bodies(now)
    positions, quaternions = now.body_poses()
    assert positions.shape[1] == quaternions.shape[1] == len(bodies)
    names = [mujoco.mj_id2name(now.model, mujoco.mjtObj.mjOBJ_BODY, i + 1) for i in range(len(bodies))]
    assert [body["name"] for body in bodies] == names
    shapes = {body["name"]: {geom["kind"] for geom in body["geoms"]} for body in bodies}
    assert "box" in shapes["fixture"]
    assert "mesh" in shapes["tool"]
    drawn = [geom for body in bodies for geom in body["geoms"] if geom["kind"] == "mesh"]
    assert all(geom["vertices"] and geom["faces"] for geom in drawn)
    np.testing.assert_allclose(norm(quaternions[0]), 1.0)


def test_every_joint_of_the_arm_is_seen(plant):
    bodies = drawn_bodies(plant("panda", "free"))
    assert all(body["geoms"] for body in bodies if body["name"].startswith("joint"))


def test_what_does_not_move_of_a_robot_is_drawn_too_in_the_colours_that_its_urdf_names(robot, scene):
    """hiab_xs031 stands on a grey foot with a white pillar. Its boom is orange."""
    model, task = robot("hiab_xs031"), scene("pallets")
    now = Plant(model, task, 1, fixture_poses(model, {}, 1), {})
    drawn = {body["name"]: body["geoms"] for body in drawn_bodies(now)}
    assert drawn["robot_base"][0]["rgba"] == [0.35, 0.37, 0.40, 1.0]
    assert [0.85, 0.42, 0.10, 1.0] in [geom["rgba"] for geom in drawn["lift"]]
    assert len(drawn) == now.body_poses()[0].shape[1]

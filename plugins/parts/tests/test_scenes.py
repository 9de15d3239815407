"""Scenes in MJCF as fixtures: places and sizes as written, joints that turn as in closed form, and what is refused."""

import numpy as np
import pytest
from skillframe_parts.declared import mesh_files, read_fixture
from skillframe_parts.load import load
from skillframe_parts.solid import read_part

from plugins.parts.tests.test_second import after, plant_of
from skillframe.errors import InputError
from skillframe.extend import make_scene
from skillframe.extend.registry import registry
from tests.part_meshes import box, export

WALLS = [
    ((-15, -15, -12), (-6, 15, 0)),
    ((6, -15, -12), (15, 15, 0)),
    ((-6, 6, -12), (6, 15, 0)),
    ((-6, -15, -12), (6, -6, 0)),
]
FLOOR = ((-15, -15, -17), (15, 15, -12))
"""A pocket of 12 x 12 mm, 12 mm deep, of boxes [mm]."""
FILE = '[fixture]\nmesh = "{scene}"\n{pose}[tool]\nmesh = "plug.stl"\nunits = "mm"\n{assembled}'


def boxes():
    """Middles and edges of the socket's boxes [m]."""
    for low, high in (*WALLS, FLOOR):
        low, high = 1e-3 * np.array(low), 1e-3 * np.array(high)
        yield 0.5 * (low + high), high - low


def text(values):
    return " ".join(f"{x:.9g}" for x in values)


def mjcf(more="", head="", socket=True):
    geoms = "".join(f'<geom type="box" pos="{text(p)}" size="{text(0.5 * e)}"/>' for p, e in boxes()) if socket else ""
    return f"<mujoco>{head}<worldbody>{geoms}{more}</worldbody></mujoco>"


def fixture(folder, scene, name="scene.xml", more="", place=None):
    folder.mkdir(parents=True, exist_ok=True)
    export(box((-5.8, -5.8, -12), (5.8, 5.8, 8)), folder / "plug.stl")
    (folder / name).write_text(scene)
    pose, assembled = (f"{key} = {place}\n" if place else "" for key in ("pose", "assembled"))
    (folder / "fixture.toml").write_text(FILE.format(scene=name, pose=pose, assembled=assembled) + more)
    return folder / "fixture.toml"


def scene_of(path):
    return make_scene(registry().world(str(path)), {})


DOOR = """
<body name="door" pos="0.04 0 0.05" euler="0 0 90"><joint name="j" type="hinge" axis="0 1 0" pos="0 0 0.025" {joint}/>
<geom type="box" size="0.01 0.005 0.0075" pos="0 0 0.0075" density="2700"/>
<body><geom type="box" size="0.01 0.005 0.0075" pos="0 0 -0.0075" density="2700"/></body></body>
"""
OPEN = DOOR.format(joint="")
BALL = OPEN.replace("hinge", "ball").replace('axis="0 1 0"', "")
INNER = OPEN.replace("<geom", '<body name="in"><joint/><geom size="0.1"/></body><geom', 1)
SHOWN = OPEN.replace("density", 'contype="0" conaffinity="0" density')
EQUAL, DRIVEN = (
    f"<{each}></mujoco>" for each in ('equality><joint joint1="j"/></equality', 'actuator><motor joint="j"/></actuator')
)
MASS = 2700.0 * 0.02 * 0.01 * 0.03


def test_the_boxes_of_a_scene_stand_where_they_are_written(tmp_path):
    path = fixture(tmp_path, mjcf())
    solid = read_part(tmp_path / "scene.xml", None).solid
    volume = sum(np.prod(edges) for _, edges in boxes())
    assert solid.volume() == pytest.approx(volume, rel=1e-9)
    np.testing.assert_allclose(solid.bounding_box(), [-0.015, -0.015, -0.017, 0.015, 0.015, 0.0], atol=1e-12)
    found = load(path)
    assert found.fit.depth == pytest.approx(0.012) and found.fit.clearance == pytest.approx(2e-4, abs=1e-6)  # 32 bits
    assert scene_of(path).params["depth"] == found.fit.depth


def test_cylinders_and_meshes_of_a_scene_stand_where_they_are_written(tmp_path):
    export(box((0, 0, 0), (10, 20, 30)), tmp_path / "block.stl")
    head = '<asset><mesh name="block" file="block.stl" scale="0.001 0.001 0.001"/></asset>'
    scene = mjcf(
        '<body pos="0.1 0 0" euler="90 0 0"><geom type="cylinder" size="0.01 0.02"/></body>'
        '<geom type="mesh" mesh="block" pos="-0.2 0 0" euler="0 30 20"/>', head, socket=False,
    )  # fmt: skip
    path = fixture(tmp_path, scene)
    low, high = np.reshape(read_part(tmp_path / "scene.xml", None).solid.bounding_box(), (2, 3))
    spin, tip = np.radians(20.0), np.radians(30.0)
    about_y = np.array([[np.cos(tip), 0.0, np.sin(tip)], [0.0, 1.0, 0.0], [-np.sin(tip), 0.0, np.cos(tip)]])
    about_z = np.array([[np.cos(spin), -np.sin(spin), 0.0], [np.sin(spin), np.cos(spin), 0.0], [0.0, 0.0, 1.0]])
    corners = np.array([(x, y, z) for x in (0.0, 0.01) for y in (0.0, 0.02) for z in (0.0, 0.03)])
    corners = corners @ (about_y @ about_z).T - [0.2, 0.0, 0.0]  # MJCF's order: each turn in the axes of the last
    rod = np.array([[0.09, -0.02, -0.01], [0.11, 0.02, 0.01]])
    both = np.concatenate([corners, rod])
    np.testing.assert_allclose([low, high], [both.min(axis=0), both.max(axis=0)], atol=1e-7)  # meshes have 32 bits
    assert set(mesh_files(path)) == {"scene.xml", "plug.stl", "block.stl"}


def test_a_body_on_a_hinge_swings_as_its_pendulum_does_wherever_the_scene_lies(tmp_path):
    """About its y, which is the scene's -x, 25 mm over the middle. The scene is turned and shifted as a whole."""
    place = "{ xyz = [0.2, 0.1, 0.05], rpy = [0.0, 0.0, 0.5] }"
    joint = 'ref="30" range="-60 60" damping="0" frictionloss="0"'
    scene = mjcf(
        DOOR.format(joint=joint).replace('0 0 0.0075"', '0.0005 0 0.0075"').replace('0 0 -0.0075"', '0.0005 0 -0.0075"')
    )
    made = scene_of(fixture(tmp_path, scene, place=place))
    (door,) = made.sprung
    assert door.range == pytest.approx(np.radians([-90.0, 30.0])) and door.mass == pytest.approx(MASS)
    cos, sin = np.cos(0.5), np.sin(0.5)
    np.testing.assert_allclose(
        door.anchor, [0.04 * cos, 0.04 * sin, 0.075], atol=1e-9
    )  # the mouth turns with the scene
    np.testing.assert_allclose(door.axis, [-cos, -sin, 0.0], atol=1e-9)
    lever = np.hypot(0.025, 0.0005)
    period = 2.0 * np.pi / np.sqrt(MASS * 9.81 * lever / (MASS * (0.02**2 + 0.03**2) / 12.0 + MASS * lever**2))
    angle = np.array([row["door.angle"][0] for row in after(plant_of(made), 1000)])
    hang = np.arctan(0.0005 / 0.025)
    seen = np.flatnonzero(np.diff(np.sign(np.abs(angle) - hang)))
    np.testing.assert_allclose(np.diff(seen)[:2] * 1e-3, 0.5 * period, atol=1.5e-3)  # a tick and a half


def test_a_body_on_a_slide_hangs_by_its_weight_over_its_stiffness(tmp_path):
    joint = 'type="slide" axis="0 0 1" stiffness="100" damping="5" ref="0.01" springref="0.012"'
    scene = mjcf(DOOR.replace('type="hinge" axis="0 1 0" pos="0 0 0.025"', "").format(joint=joint))
    sag = after(plant_of(scene_of(fixture(tmp_path, scene))), 600)[-1]["door.travel"][0]
    assert sag == pytest.approx(0.002 - MASS * 9.81 / 100.0, rel=1e-3)  # damped twice over: e^-12 after 0.6 s


def test_a_body_of_the_scene_has_its_goal_from_the_fixture_file(tmp_path):
    path = fixture(tmp_path, mjcf(OPEN), more='[[second]]\nname = "door"\njoint = "scene"\ngoal = [0.1, 0.2]\n')
    (door,) = read_fixture(path).second
    assert (door.joint, door.goal, door.mesh) == ("hinge", (0.1, 0.2), "scene.xml")


def test_geoms_that_collide_with_nothing_are_passed_over(tmp_path):
    shown = '<geom type="sphere" size="1" contype="0" conaffinity="0"/><camera name="eye"/><light/><site name="s"/>'
    fixture(tmp_path, mjcf(shown))
    assert read_part(tmp_path / "scene.xml", None).size == pytest.approx(0.03)


def test_a_held_part_is_the_one_body_of_its_scene(tmp_path):
    path = fixture(tmp_path, mjcf())
    body = '<body name="b" pos="0 0 -0.002"><freejoint/><geom type="box" size="0.0058 0.0058 0.01"/></body>'
    (tmp_path / "plug.xml").write_text(mjcf(body, socket=False))
    path.write_text(path.read_text().replace('"plug.stl"\nunits = "mm"', '"plug.xml"'))
    assert load(path).fit.depth == pytest.approx(0.012)
    (tmp_path / "plug.xml").write_text(mjcf(body))
    with pytest.raises(InputError, match="is not one piece"):
        load(path)


@pytest.mark.parametrize(
    ("scene", "said"),
    [
        ("", "is empty"),
        ("<mujoco", "is not valid XML"),
        ("<robot/>", "XML file of <robot>, no scene"),
        ('<!DOCTYPE a [<!ENTITY b "c">]><mujoco/>', "document type"),
        (mjcf("<blob/>"), "unrecognized element Element 'blob'"),
        (mjcf('<geom type="box"/>'), "must be positive"),
        (mjcf('<geom name="ball" type="sphere" size="0.1"/>'), "ball is a sphere"),
        (mjcf('<geom name="floor" type="plane" size="1 1 1"/>'), "floor is a plane"),
        (mjcf(head='<include file="other.xml"/>'), "<include>"),
        (mjcf(head='<asset><mesh file="gone.stl"/></asset>'), "gone.stl"),
        (mjcf('<geom type="box" size="nan 1 1"/>'), "MuJoCo"),
        (mjcf(DOOR.format(joint='armature="0.1"')), "armature"),
        (mjcf(DOOR.format(joint='range="10 20"')), "leaves out 0"),
        (mjcf(BALL), "ball joint"),
        (mjcf(OPEN.replace('name="door"', "")), "has no name"),
        (mjcf(OPEN.replace('"door"', '"a door"')), "take letters"),
        (mjcf(INNER), "'in' hangs on"),
        (mjcf(SHOWN), "nothing that collides"),
        (mjcf(OPEN, socket=False), "has nothing that stands"),
        (mjcf(OPEN).replace("</mujoco>", EQUAL), "<equality>"),
        (mjcf(OPEN).replace("</mujoco>", DRIVEN), "<actuator>"),
    ],
)  # fmt: skip
def test_a_scene_that_cannot_be_used_is_refused_in_one_sentence(tmp_path, scene, said):
    path = fixture(tmp_path, scene)
    with pytest.raises(InputError) as error:
        scene_of(path)
    assert said in str(error.value) and "\n" not in str(error.value)


SCENE = '[[second]]\nname = "{name}"\njoint = "scene"\n{more}'


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (SCENE.format(name="gate", more=""), "has no body 'gate' that moves (there are: door)"),
        (SCENE.format(name="door", more="axis = [1, 0, 0]\n"), "means nothing for a part that is scene"),
        (SCENE.format(name="door", more="mass = 1.0\n"), "means nothing for a part of the scene"),
        ('[[second]]\nname = "b"\njoint = "fixed"\nmesh = "scene.xml"\n', "is a scene"),
        ('[[second]]\nname = "door"\njoint = "fixed"\nboxes = [{ size = [0.1, 0.1, 0.1] }]\n', "is there already"),
    ],
)
def test_a_second_part_beside_a_scene_that_cannot_be_used_is_refused(tmp_path, more, said):
    path = fixture(tmp_path, mjcf(OPEN), more=more)
    with pytest.raises(InputError) as error:
        read_fixture(path)
    assert said in str(error.value)


def test_scenes_are_in_metres_and_scene_bodies_need_a_scene(tmp_path):
    path = fixture(tmp_path, mjcf())
    whole = path.read_text()
    path.write_text(whole.replace('"scene.xml"', '"scene.xml"\nunits = "mm"'))
    with pytest.raises(InputError, match="a scene is in metres"):
        read_fixture(path)
    path.write_text(whole.replace('"scene.xml"', '"plug.stl"\nunits = "mm"') + SCENE.format(name="a", more=""))
    with pytest.raises(InputError, match="means a body of the scene"):
        read_fixture(path)

"""Scenes in SDFormat as fixtures: links, poses and joints as written and as MJCF has them, and what is refused."""

import numpy as np
import pytest
from skillframe_parts.declared import mesh_files
from skillframe_parts.load import load
from skillframe_parts.scenes import read_scene
from skillframe_parts.solid import arrays_of, read_part

from plugins.parts.tests.test_scenes import MASS, boxes, fixture, scene_of, text
from plugins.parts.tests.test_second import after, plant_of
from skillframe.errors import InputError
from tests.part_meshes import box, export

BOX = """
<collision name="c{}"><pose>{} 0 0 0</pose><geometry><box><size>{}</size></box></geometry></collision>"""
SOCKET = "".join(BOX.format(i, text(p), text(e)) for i, (p, e) in enumerate(boxes()))
SOCKET = f'<link name="base">{SOCKET}</link>'
FIXED = '<joint name="stands" type="fixed"><parent>world</parent><child>base</child></joint>'
DOOR = """
<link name="door"><pose>0.04 0 0.05 0 0 1.5707963267948966</pose>
<collision name="c"><pose>0.0005 0 0 0 0 0</pose><geometry><box><size>0.02 0.01 0.03</size></box></geometry></collision>
<inertial><mass>{mass}</mass></inertial><visual name="v"/></link>
<joint name="j" type="{kind}"><parent>base</parent><child>door</child><pose>0 0 0.025 0 0 0</pose>
<axis><xyz{attribute}>{xyz}</xyz>{more}</axis></joint>
"""


def door(kind="revolute", xyz="0 1 0", attribute="", more="<limit/>", mass=MASS):
    return DOOR.format(kind=kind, xyz=xyz, attribute=attribute, more=more, mass=mass)


def sdf(inner=SOCKET + FIXED, version="1.9", place="", around="{}"):
    model = around.format(f'<model name="m">{place}{inner}</model>')
    return f'<sdf version="{version}">{model}</sdf>'


def test_the_boxes_of_a_static_model_stand_where_they_are_written(tmp_path):
    scene = sdf(
        "<static>true</static>" + SOCKET, place="<pose>0 0 0 0 0 0</pose>", around='<world name="w">{}<light/></world>'
    )
    path = fixture(tmp_path, scene, "scene.sdf")
    solid = read_part(tmp_path / "scene.sdf", None).solid
    assert solid.volume() == pytest.approx(sum(np.prod(edges) for _, edges in boxes()), rel=1e-9)
    np.testing.assert_allclose(solid.bounding_box(), [-0.015, -0.015, -0.017, 0.015, 0.015, 0.0], atol=1e-12)
    assert load(path).fit.depth == pytest.approx(0.012)


def test_poses_turn_about_fixed_axes_roll_first_and_add_up_from_model_to_shape(tmp_path):
    """A thin rod along z of its shape: its ends follow from the rotations, done one after the other by hand."""
    export(box((0, 0, 0), (10, 20, 30)), tmp_path / "block.stl")
    shape = "<geometry>{}</geometry>"
    rod = shape.format("<cylinder><radius>0.0005</radius><length>0.2</length></cylinder>")
    mesh = shape.format("<mesh><uri>block.stl</uri><scale>0.001 0.001 0.002</scale></mesh>")
    link = f"<link name='l'><pose degrees='true'>1 0 0 90 30 0</pose><collision name='c'>{rod}</collision></link>"
    link += f"<link name='n'><pose relative_to='l'>0 0 0.1 0 0 0</pose><collision name='c'>{mesh}</collision></link>"
    (tmp_path / "a.sdf").write_text(
        sdf("<static>1</static>" + link, place="<pose>0 0 0.5 0 0 1.5707963267948966</pose>")
    )
    found = read_scene(tmp_path / "a.sdf")
    along = found.fixed[0].rotation @ [0.0, 0.0, 1.0]  # rolled to -y, which pitch leaves, yawed by the model to +x
    np.testing.assert_allclose(along, [1.0, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(found.fixed[0].origin, [0.0, 1.0, 0.5], atol=1e-12)
    np.testing.assert_allclose(found.fixed[1].origin, [0.1, 1.0, 0.5], atol=1e-12)
    # x of the link: roll leaves it, pitch lowers it by 30 degrees, yaw turns what is level to y
    lowered = found.fixed[0].rotation @ [1.0, 0.0, 0.0]
    np.testing.assert_allclose(lowered, [0.0, np.cos(np.pi / 6), -0.5], atol=1e-12)
    ends = arrays_of(read_part(tmp_path / "a.sdf", None).solid)[0][:, 0]
    assert (ends.min(), ends.max()) == pytest.approx((-0.1, 0.16), abs=1e-7)  # the rod's end; 0.1 + 0.06 of the mesh
    path = fixture(tmp_path, sdf("<static>1</static>" + link), "a.sdf")
    assert set(mesh_files(path)) == {"a.sdf", "plug.stl", "block.stl"}


@pytest.mark.parametrize(
    "version_and_axis",
    [
        ("1.9", {}),
        ("1.9", {"attribute": ' expressed_in="__model__"', "xyz": "-1 0 0"}),
        ("1.6", {"xyz": "-1 0 0", "more": "<use_parent_model_frame>1</use_parent_model_frame>"}),
        ("1.7", {"attribute": ' expressed_in="base"', "xyz": "-1 0 0"}),
    ],
)
def test_a_link_on_a_revolute_joint_swings_as_its_pendulum_does(tmp_path, version_and_axis):
    """About y of the link, which is -x of the model, 25 mm over its middle. w^2 = m g l / (I + m l^2)."""
    version, axis = version_and_axis
    made = scene_of(fixture(tmp_path, sdf(SOCKET + FIXED + door(**axis), version), "scene.sdf"))
    (mover,) = made.sprung
    np.testing.assert_allclose(mover.axis, [-1.0, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(mover.anchor, [0.04, 0.0, 0.075], atol=1e-12)
    assert mover.range is None and mover.mass == pytest.approx(MASS)
    if axis:
        return  # the same mover: one swing will do
    lever = np.hypot(0.025, 0.0005)
    period = 2.0 * np.pi / np.sqrt(MASS * 9.81 * lever / (MASS * (0.02**2 + 0.03**2) / 12.0 + MASS * lever**2))
    angle = np.array([row["door.angle"][0] for row in after(plant_of(made), 700)])
    seen = np.flatnonzero(np.diff(np.sign(np.abs(angle) - np.arctan(0.0005 / 0.025))))
    np.testing.assert_allclose(np.diff(seen)[:1] * 1e-3, 0.5 * period, atol=1.5e-3)  # a tick and a half


def test_a_link_on_a_prismatic_joint_hangs_by_its_weight_over_its_stiffness(tmp_path):
    spring = "<damping>5</damping><spring_stiffness>100</spring_stiffness><spring_reference>0.002</spring_reference>"
    more = f"<limit><lower>-0.1</lower><upper>0.05</upper></limit><dynamics>{spring}</dynamics>"
    made = scene_of(fixture(tmp_path, sdf(SOCKET + FIXED + door("prismatic", "0 0 2", more=more)), "scene.sdf"))
    assert made.sprung[0].range == (-0.1, 0.05)
    sag = after(plant_of(made), 600)[-1]["door.travel"][0]
    assert sag == pytest.approx(0.002 - MASS * 9.81 / 100.0, rel=1e-3)  # damped twice over: e^-12 after 0.6 s


def test_a_link_without_a_joint_is_free_and_one_fixed_to_a_link_moves_with_it(tmp_path):
    alone = door().partition("<joint")[0]
    (free,) = read_scene(fixture(tmp_path, sdf(SOCKET + FIXED + alone), "a.sdf").parent / "a.sdf").moving
    assert (free.name, free.joint, free.mass) == ("door", "free", pytest.approx(MASS))
    knob = (
        alone.replace("door", "knob") + '<joint name="k" type="fixed"><parent>door</parent><child>knob</child></joint>'
    )
    (tmp_path / "a.sdf").write_text(sdf(SOCKET + FIXED + door() + knob))
    (both,) = read_scene(tmp_path / "a.sdf").moving
    assert (both.name, both.joint, len(both.shapes)) == ("door", "hinge", 2) and both.mass == pytest.approx(2 * MASS)


def test_a_held_part_is_the_one_free_link_of_its_file(tmp_path):
    path = fixture(tmp_path, sdf(), "scene.sdf")
    body = "<geometry><box><size>0.0116 0.0116 0.02</size></box></geometry>"
    link = f"<link name='plug'><pose>0 0 -0.002 0 0 0</pose><collision name='c'>{body}</collision></link>"
    (tmp_path / "plug.sdf").write_text(sdf(link))
    path.write_text(path.read_text().replace('"plug.stl"\nunits = "mm"', '"plug.sdf"'))
    assert load(path).fit.depth == pytest.approx(0.012)


SPHERE = SOCKET.replace("<box>", "<sphere/><box>", 1)
NEGATIVE = "<dynamics><damping>-1</damping></dynamics>"
ELSEWHERE = SOCKET.replace("<box><size>", "<mesh><uri>model://x/", 1).replace("</size></box>", "</uri></mesh>", 1)
HANGS = FIXED + door() + door().replace("door", "inner").replace('"j"', '"i"').replace("base", "door")


@pytest.mark.parametrize(
    ("scene", "said"),
    [
        (sdf(version="1.4"), "is SDFormat 1.4; 1.5 to 1.12 are read"),
        (sdf(SPHERE + FIXED), "<sphere> of <geometry>"),
        (sdf(SOCKET + FIXED + "<frame/>"), "<frame> of <model>"),
        (sdf(SOCKET + FIXED + "<model/>"), "<model> of <model>"),
        (sdf(around="<world>{}<include/></world>"), "<include> of <world>"),
        (sdf(SOCKET), "has nothing that stands"),
        (sdf(SOCKET + FIXED + door("ball")), "is of type 'ball'"),
        (sdf(SOCKET + FIXED + door().replace("<parent>base", "<parent>gone")), "'gone', which is no link"),
        (sdf(SOCKET + HANGS), "whose parent does not stand"),
        (sdf(SOCKET + FIXED + door(xyz="0 one 0")), "<xyz> of <axis> in model 'm' is '0 one 0', not 3 finite numbers"),
        (sdf(SOCKET + FIXED + door(xyz="0 nan 0")), "not 3 finite numbers"),
        (sdf(SOCKET + FIXED + door(xyz="0 0 0")), "is zero"),
        (sdf(SOCKET + FIXED + door(mass="0")), "has a mass of 0"),
        (sdf(SOCKET + FIXED + door(more=NEGATIVE)), "<damping> in model 'm' is below 0"),
        (sdf(SOCKET + FIXED + door(more="<limit><lower>1</lower><upper>2</upper></limit>")), "leaves out 0"),
        (sdf(SOCKET + FIXED + door(attribute=' expressed_in="elsewhere"')), "'elsewhere' is no link or joint"),
        (sdf(SOCKET.replace("<pose>", '<pose relative_to="x">', 1) + FIXED), "relative_to of a collision"),
        (sdf(ELSEWHERE + FIXED), "is no path relative to the scene"),
        (sdf(SOCKET.replace("<size>", "<size>-", 1).replace("--", "-0.1 -") + FIXED), "size"),
        (sdf(place="<pose rotation_format='quat_xyzw'>0 0 0 0 0 0 1</pose>"), "rotation_format"),
        (sdf(SOCKET + "<link/>" + FIXED), "links without a name of their own"),
        (sdf(SOCKET.replace("<collision", '<pose relative_to="base"/><collision', 1) + FIXED), "in a ring"),
    ],
)  # fmt: skip
def test_a_scene_that_cannot_be_used_is_refused_in_one_sentence(tmp_path, scene, said):
    path = fixture(tmp_path, scene, "scene.sdf")
    with pytest.raises(InputError) as error:
        scene_of(path)
    assert said in str(error.value) and "\n" not in str(error.value)

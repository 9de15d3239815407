"""Second parts of a fixture file: springs, pendulums and falls as in closed form, goals, and what is refused."""

import dataclasses

import numpy as np
import pytest

from skillframe.errors import InputError
from skillframe.extend import make_scene
from skillframe.extend.registry import registry
from skillframe.frames import Pose
from skillframe.robot.model import load_model
from skillframe.robot.spec import load_robot
from skillframe.world.placement import fixture_poses, start_configurations
from skillframe.world.plant import Plant
from skillframe.world.scene import State
from tests.part_meshes import FILE, rod, round_pair, write

BOX = '[[second]]\nname = "a"\nboxes = [{ size = [0.01, 0.02, 0.03], xyz = [0.04, 0.0, 0.05] }]\n'
MASS = 2700.0 * 0.01 * 0.02 * 0.03
GRAVITY = 9.81
AWAY = "{ xyz = [0.03, 0.02, 0.01] }"
CREEP = (1.0 - 0.99) / 0.99 * GRAVITY / (2.0 / (0.999 * 0.004))
"""Of what joint friction holds [m/s]: MuJoCo's R f / b, R = (1 - d) / d / m, b = 2 / (d_max tau), of the preset."""


def scene_with(folder, second, front=BOX):
    path = write(folder, *round_pair(), FILE + front + second)
    return make_scene(registry().world(str(path)), {})


def plant_of(scene, count=1, draws=None):
    robot, draws = load_model(load_robot("free_tool")), draws or {}
    made = Plant(robot, scene, count, fixture_poses(robot, draws, count), draws)
    made.reset(start_configurations(robot, scene, draws, count))
    return made


def after(plant, ticks, pull=0.0, damping=20.0):
    """What is told of the parts after each tick, the tool standing still by itself. Forces on the parts are lost."""
    rows = []
    for _ in range(ticks):
        bias = plant.kinematics(np.zeros(3)).bias
        plant.step(bias - damping * plant.state[1] + pull, np.arange(plant.count))
        rows.append({name: value.copy() for name, value in plant.tip_state().second.items()})
    return rows


def test_a_slide_hangs_by_its_weight_over_its_stiffness(tmp_path):
    scene = scene_with(tmp_path, 'joint = "slide"\nstiffness = 100.0\ndamping = 5.0\n')
    sag = after(plant_of(scene), 600)[-1]["a.travel"][0]
    assert sag == pytest.approx(-MASS * GRAVITY / 100.0, rel=1e-3)  # damped twice over: e^-12 after 0.6 s


@pytest.mark.slow
def test_a_hinge_swings_as_a_pendulum_of_its_inertia_does(tmp_path):
    """About an axis along x, 25 mm over its middle: w^2 = m g l / (I + m l^2), let go beside its rest.

    All parts are drawn 30, 20 and 10 mm away from where the mouth is the origin.
    """
    front = BOX.replace("xyz = [0.04, 0.0, 0.05]", "rpy = [0.02, 0.0, 0.0], xyz = [0.07, 0.02, 0.06]")
    joint = 'joint = "hinge"\nanchor = [0.07, 0.0205, 0.085]\naxis = [2, 0, 0]\n'
    away = FILE.replace("[tool]", f"pose = {AWAY}\n[tool]").replace("[contact]", f"assembled = {AWAY}\n[contact]")
    path = write(tmp_path, *round_pair(), away + front + joint)
    scene = make_scene(registry().world(str(path)), {})
    lever = np.hypot(0.025, 0.0005)
    about = MASS * (0.02**2 + 0.03**2) / 12.0 + MASS * lever**2
    angle = np.array([row["a.angle"][0] for row in after(plant_of(scene), 1000)])
    hang = np.arctan(0.0005 / 0.025)
    seen = np.flatnonzero(np.diff(np.sign(np.abs(angle) - hang)))
    period = 2.0 * np.pi / np.sqrt(MASS * GRAVITY * lever / about)
    np.testing.assert_allclose(np.diff(seen)[:2] * 1e-3, 0.5 * period, atol=1.5e-3)  # a tick and a half
    assert np.abs(angle).max() == pytest.approx(2.0 * hang, rel=0.02)  # semi-implicit steps, amplitude 0.02 rad


def test_a_free_part_falls_and_comes_to_rest_on_what_stands(tmp_path):
    front = BOX.replace("xyz = [0.04, 0.0, 0.05]", "xyz = [0.0, 0.012, 0.0202]").replace("0.02,", "0.004,")
    rows = after(plant_of(scene_with(tmp_path, 'joint = "free"\n', front)), 500)
    fall = 0.0202 - 0.015
    t = 0.025
    assert rows[24]["a.moved"][0] == pytest.approx(0.5 * GRAVITY * t * (t + 1e-3), rel=1e-6)  # steps: t (t + dt) / 2
    assert rows[-1]["a.moved"][0] == pytest.approx(fall, abs=1e-4)  # contacts sink by less than 0.1 mm
    assert rows[-1]["a.turned"][0] < 0.02


def test_joint_friction_holds_what_weighs_less_and_a_range_ends_what_weighs_more(tmp_path):
    held = scene_with(tmp_path / "held", f'joint = "slide"\nfriction = {1.2 * MASS * GRAVITY}\n')
    slack = f'joint = "slide"\nfriction = {0.8 * MASS * GRAVITY}\nrange = [-0.003, 0.0]\n'
    drops = scene_with(tmp_path / "drops", slack)
    assert after(plant_of(held), 300)[-1]["a.travel"][0] == pytest.approx(-CREEP * 0.3, rel=0.02)  # it starts at rest
    assert after(plant_of(drops), 300)[-1]["a.travel"][0] == pytest.approx(-0.003, abs=5e-5)


def test_the_held_part_pushes_a_slide_as_far_as_force_over_stiffness_and_walls_do_not_hold_that(tmp_path):
    """A bar across the hole, as long as the block is wide, is pushed down by the pin with 2 N."""
    bar = BOX.replace("0.01, 0.02, 0.03", "0.024, 0.004, 0.002").replace("0.04, 0.0, 0.05", "0.0, 0.0, -0.002")
    spring = 'joint = "slide"\nstiffness = 500.0\ndamping = 5.0\ngoal = [-0.01, -0.001]\n'
    beside = BOX.replace('"a"', '"b"') + 'joint = "free"\n'  # with a free part any may meet the fixture, its parent
    plant = plant_of(scene_with(tmp_path, spring, beside + bar))
    down, damping = np.array([0.0, 0.0, -2.0] + [0.0] * 10), np.array([35.0] * 3 + [0.5, 0.5] + [0.0] * 8)
    weight = 2700.0 * 0.024 * 0.004 * 0.002 * GRAVITY
    assert after(plant, 500, down, damping)[-1]["a.travel"][0] == pytest.approx(
        -(2.0 + weight) / 500.0, rel=0.01
    )  # damped critically: e^-10


@pytest.mark.parametrize("joint", ["free", "slide"])
def test_a_part_rests_with_its_weight_on_one_that_slides(tmp_path, joint):
    above = BOX.replace('"a"', '"b"').replace("0.04, 0.0, 0.05", "0.04, 0.0, 0.0801") + f'joint = "{joint}"\n'
    spring = 'joint = "slide"\nstiffness = 100.0\ndamping = 2.0\n'
    sag = after(plant_of(scene_with(tmp_path, spring, above + BOX)), 500)[-1]["a.travel"][0]
    assert sag == pytest.approx(-2.0 * MASS * GRAVITY / 100.0, rel=0.01)  # e^-6 of what swings is left, and less of it


def test_drawn_joint_friction_of_the_robot_leaves_that_of_second_parts(tmp_path):
    scene = scene_with(tmp_path, f'joint = "slide"\nfriction = {1.2 * MASS * GRAVITY}\n')
    plant = plant_of(scene, 1, {"robot.joint_friction": np.zeros(1)})
    assert after(plant, 300)[-1]["a.travel"][0] == pytest.approx(-CREEP * 0.3, rel=0.02)


def test_the_forces_of_drives_do_not_move_second_parts(tmp_path):
    scene = scene_with(tmp_path, 'joint = "slide"\nstiffness = 100.0\ndamping = 5.0\n')
    assert after(plant_of(scene), 50, 0.3)[-1] == after(plant_of(scene), 50)[-1]


def test_second_parts_have_the_same_bits_alone_and_in_a_batch_and_start_anew_after_a_reset(tmp_path):
    """Each trial's fixture stands elsewhere. The free block tumbles over the edge of the other."""
    front = BOX.replace("xyz = [0.04, 0.0, 0.05]", "xyz = [0.0, 0.017, 0.018], rpy = [0.2, 0.1, 0.0]")
    hinge = BOX.replace('"a"', '"b"') + 'joint = "hinge"\nanchor = [0.04, 0.0, 0.09]\naxis = [1, 1, 0]\n'
    scene = scene_with(tmp_path, 'joint = "free"\n', hinge + front)
    draws = {"fixture.offset_x": np.array([0.0, 0.001, 0.002])}
    whole = plant_of(scene, 3, draws)
    first = after(whole, 150)
    for row in range(3):
        alone = after(plant_of(scene, 1, {key: value[row : row + 1] for key, value in draws.items()}), 150)
        assert all(a[k][0] == b[k][row] for a, b in zip(alone, first, strict=True) for k in b)
    robot = whole.robot
    whole.reset(start_configurations(robot, scene, draws, 3))
    again = after(whole, 150)
    assert all((a[k] == b[k]).all() for a, b in zip(again, first, strict=True) for k in b)


def test_the_goal_holds_only_where_a_second_part_is_within_its_own(tmp_path):
    scene = scene_with(tmp_path, 'joint = "hinge"\ngoal = [0.1, 0.2]\n')
    depth = scene.params["depth"]
    tip = Pose(np.tile([0.0, 0.0, -depth], (4, 1)), np.tile(np.diag([1.0, -1.0, -1.0]), (4, 1, 1)))
    state = State(tip, np.zeros((4, 6)), {"a.angle": np.array([0.0, 0.1, 0.2, 0.21])})
    assert scene.goal(state).tolist() == [False, True, True, False]
    assert not scene.goal(State(tip, np.zeros((4, 6)))).any()  # parts that are not named have not moved


def test_a_fixed_part_is_one_of_the_fixtures_and_lies_where_it_was_drawn(tmp_path):
    scene = scene_with(tmp_path, 'joint = "fixed"\n')
    plain = make_scene(registry().world(str(write(tmp_path / "plain", *round_pair()))), {})
    (added,) = [g for g in scene.fixture if g.rgba == (0.45, 0.6, 0.5, 1.0)]
    assert not scene.sprung and len(scene.fixture) == len(plain.fixture) + 1
    np.testing.assert_allclose(added.vertices.mean(axis=0), [0.04, 0.0, 0.05], atol=1e-9)
    assert dataclasses.asdict(added)["collide"]


HINGE = 'joint = "hinge"\n'


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (BOX + 'joint = "weld"\n', "joint"),
        (BOX + HINGE + "axis = [0, 0, 0]\n", "is zero"),
        (BOX + HINGE + "range = [0.2, 0.1]\n", "the least travel, then the largest"),
        (BOX + HINGE + "range = [0.1, 0.2]\n", "leaves out 0"),
        (BOX + HINGE + "mass = 1.0\ndensity = 1000\n", "has mass and density"),
        (BOX + HINGE + 'mesh = "plug.stl"\nunits = "mm"\n', "has a mesh and shapes"),
        ('[[second]]\nname = "a"\n' + HINGE, "has no shape"),
        ('[[second]]\nname = "a"\nmesh = "gone.stl"\n' + HINGE, "no such file"),
        ('[[second]]\nname = "a"\nmesh = "plug.stl"\n' + HINGE, "units"),
        (BOX + HINGE + BOX + HINGE, "is there already"),
        (BOX.replace('"a"', '"a.b"') + HINGE, "take letters"),
        (BOX + 'joint = "free"\nstiffness = 1.0\n', "means nothing for a part that is free"),
        (BOX + 'joint = "fixed"\ngoal = [0, 1]\n', "means nothing for a part that is fixed"),
        (BOX + 'joint = "slide"\nanchor = [1, 0, 0]\n', "means nothing for a part that is slide"),
        (BOX + HINGE + "stiffness = 1000.0\n", "swings faster"),
        (BOX.replace("0.04, 0.0, 0.05", "0.0, 0.0, 0.01") + HINGE, "in plug.stl"),
        (BOX.replace("0.04, 0.0, 0.05", "0.014, 0.0, 0.0") + 'joint = "free"\n', "in socket.stl"),
        (BOX + HINGE + "frictions = 1.0\n", "frictions"),
    ],
)
def test_a_second_part_that_cannot_be_used_is_refused_in_one_sentence(tmp_path, text, said):
    with pytest.raises(InputError) as error:
        scene_with(tmp_path, "", text)
    assert said in str(error.value) and "\n" not in str(error.value)


@pytest.mark.slow
def test_only_where_no_second_part_may_stop_it_does_the_person_stop_a_part_by_hand(tmp_path):
    pin, blind = round_pair()
    through = blind - rod(5.2, -20.0, 0.0, outside=True)
    scenes = [
        make_scene(registry().world(str(write(tmp_path / name, pin, socket, FILE + second))), {})
        for name, socket, second in (
            ("open", through, ""),
            ("two", through, BOX + 'joint = "slide"\n'),
            ("blind", blind, ""),
        )
    ]
    assert [scene.task.stop is not None for scene in scenes] == [True, False, False]

"""Links inside the fixture: found with the right depth, alone or in a batch, and never where nothing is wrong."""

import dataclasses
import struct

import numpy as np
import pytest

from skillframe.execution.executor import simulate
from skillframe.frames import matrix_from_quaternion
from skillframe.robot.model import load_model
from skillframe.robot.spec import load_robot
from skillframe.world.placement import fixture_poses, start_configurations
from skillframe.world.plant import Plant
from skillframe.world.scene import Geom, Sprung
from tests.laws.pushing import Hold, Push, impedance
from tests.laws.runs import run, setup
from tests.unit.world.conftest import INERTIAL

STIFF = np.diag([1000.0] * 3 + [20.0] * 3)
WALL = Geom(kind="box", size=(0.01, 0.6, 0.5), position=(-0.25, 0.0, 0.3))  # between the panda's base and its tool


def walled(name="panda", world="free", *geoms, **options):
    now = setup(name, world, **options)
    return dataclasses.replace(now, scene=dataclasses.replace(now.scene, fixture=(*now.scene.fixture, *geoms)))


def causes(plant, rows=None):
    """(row, words) of what is found now."""
    from skillframe.world.collisions import Collisions

    touches = Collisions(plant).touches(plant, np.arange(plant.count) if rows is None else np.asarray(rows))
    return [(touch.row, touch.cause) for touch in touches]


def shape(inside, tag="visual", xyz="0 0 0"):
    return f'<{tag}><origin xyz="{xyz}"/><geometry>{inside}</geometry></{tag}>'


def stl(path, triangles):
    records = [struct.pack("<12fH", 0, 0, 0, *np.ravel(t), 0) for t in triangles]
    path.write_bytes(b" " * 80 + struct.pack("<I", len(records)) + b"".join(records))


BOX = Geom(kind="box", size=(0.05, 0.05, 0.05))
SPHERE = shape('<sphere radius="0.1"/>')


# --- runs ---


def test_a_wall_between_base_and_tool_is_a_failure_and_not_a_success():
    result = run(Hold(STIFF), walled("panda", "free", WALL), duration_s=0.3)
    assert not result.success[0]
    assert result.failure[0].startswith("begins inside something: link 'link5' is ")
    assert "link 'link" in result.failure[0]


def test_a_long_steep_valley_is_a_failure_of_the_arm_that_passes_its_slopes():
    """The slopes of 0.6 m at 63 degrees reach 0.53 m up, beside a flange at 0.2 m: the forearm passes through one."""
    steep = setup("panda", params={"length": 0.6, "slope": 1.1})
    result = run(Push((0, 0, -1), impedance(free_axes="x"), stall=False), steep)
    assert "79 mm inside the fixture" in result.failure[0]
    assert not result.success[0]


def test_a_link_that_comes_to_touch_ends_the_trial_within_a_hundredth_of_a_second():
    """The tool goes down at 0.1 m/s beside a post that ends 5 mm under link 7: the flange's rim hits it once 1 mm is
    passed, and at most 10 ms and 1 mm of approach later the trial is over."""
    down = Push((0.0, 0.0, -1.0), STIFF, speed=0.1, stall=False)
    free = run(down, setup("panda", "free"), duration_s=1.0)
    post = Geom(kind="box", size=(0.03, 0.03, 0.05), position=(0.06, 0.0, 0.15))
    result = run(down, walled("panda", "free", post), duration_s=1.0)
    assert "inside the fixture" not in free.failure[0]
    assert "is 1 mm inside the fixture" in result.failure[0] or "is 2 mm inside the fixture" in result.failure[0]
    assert 0.05 < result.duration_s[0] < 1.0
    assert -0.003 < result.distance_to_collision_m[0] < -0.001 < free.distance_to_collision_m[0]


def test_a_trial_among_others_ends_with_the_same_words_as_alone():
    """Three of four fixtures are turned towards the forearm. In any order and number each trial ends as alone."""
    skill, now = (
        Hold(STIFF),
        walled("panda", "free", Geom(kind="box", size=(0.1, 0.02, 0.4), position=(-0.1, 0.3, 0.3))),
    )
    tilt = np.array([0.0, 1.2, 2.2, 1.21])

    def ended(rows):
        rngs = [np.random.default_rng([1, i]) for i in rows]
        found = simulate(skill, now, {"fixture.tilt_z": tilt[rows]}, rngs, duration_s=0.05)
        return list(zip(found.failure, found.distance_to_collision_m, strict=True))

    together = ended([0, 1, 2, 3])
    assert {bool(text) for text, _ in together} == {True, False}
    assert [ended([i])[0] for i in range(4)] == together
    assert ended([3, 1, 0, 2]) == [together[i] for i in (3, 1, 0, 2)]
    assert all((distance < 0.0) == ("inside" in text) for text, distance in together)


# --- depths ---


@pytest.mark.parametrize(("q", "depth"), [(0.2, None), (0.1495, None), (0.14, 10), (0.1, 50), (-0.07, 80)])
def test_the_depth_of_a_sphere_in_a_box_is_that_of_the_shortest_way_out(slide, q, depth):
    """r + a - |q|. Half a millimetre is within the tolerance."""
    found = causes(slide(SPHERE, [q], BOX))
    assert found == ([] if depth is None else [(0, f"link 'carriage' is {depth} mm inside the fixture")])


def measured(plant, *more):
    """Smallest distances in mm, where the robot is and then at more positions (N,)."""
    from skillframe.world.collisions import Collisions

    looked, rows = Collisions(plant), np.arange(plant.count)
    looked.measure(plant, rows)
    for q in more:
        plant.reset(np.array(q, dtype=float)[:, None])
        looked.measure(plant, rows)
    return (1000.0 * looked.distance).tolist()


@pytest.mark.parametrize(("q", "distance"), [(0.2, 50), (-0.4, 250), (0.14, -10), (2.0, 1000)])
def test_the_distance_of_a_sphere_and_a_box_is_what_parts_them_up_to_a_metre(slide, q, distance):
    """|q| - r - a; at 2 m it would be 1.85 m."""
    assert measured(slide(SPHERE, [q], BOX)) == pytest.approx([distance], abs=1e-2)  # mm; MuJoCo's tolerance is 1e-6 m


def test_the_distance_of_a_trial_is_its_own_smallest_so_far_over_all_pairs(slide):
    """The ball comes nearer in the first trial and goes away in the second. A table's plane, which has no middle to go
    by, is 300 mm under it, a wall 400 mm beside it."""
    around = (
        '[[obstacle]]\nname = "table"\nkind = "plane"\nposition = [3.0, -4.0, {down}]\n'
        '[[obstacle]]\nname = "wall"\nsize = [2.0, 0.2, 2.0]\nposition = [0.0, 0.6, 0.0]\n'
    )
    near = [[0.35, 0.4], [0.2, 0.7], [0.3, 0.2]]
    place = {"down": -0.4}
    plant = slide(SPHERE, near[0], BOX, toml=around.format(**place))
    assert measured(plant, *near[1:]) == pytest.approx([50, 50], abs=1e-2)
    plant = slide(SPHERE, near[0], BOX, toml=around.format(**place))
    assert measured(plant, near[1]) == pytest.approx([50, 250], abs=1e-2)
    assert measured(slide(SPHERE, [0.9, 0.9], BOX, toml=around.format(**place))) == pytest.approx([300, 300], abs=1e-2)


def test_what_is_not_looked_at_and_a_robot_without_pairs_have_no_distance(slide, plant):
    off = slide(SPHERE, [0.2], BOX, toml="[collisions]\nenabled = false\n")
    assert np.isnan(measured(off)).all()
    assert np.isnan(measured(slide(SPHERE, [0.2]))).all()
    assert np.isnan(measured(plant("free_tool", "valley"))).all()


def test_every_kind_of_geom_of_a_fixture_is_seen(slide):
    corners = np.array([[x, y, z] for x in (-0.05, 0.05) for y in (-0.05, 0.05) for z in (-0.05, 0.05)])
    sideways = (0.0, 0.5**0.5, 0.0, 0.5**0.5)
    kinds = [
        BOX, Geom(kind="sphere", size=(0.05,)), Geom(kind="capsule", size=(0.05, 0.1)),
        Geom(kind="mesh", vertices=corners), Geom(kind="cylinder", size=(0.05, 0.1)),
        Geom(kind="plane", size=(1, 1, 0.1), quaternion=sideways),
    ]  # fmt: skip
    for geom in kinds:
        surface = 0.0 if geom.kind == "plane" else 0.05
        found = causes(slide(SPHERE, [surface + 0.08, surface + 0.11], geom))
        assert found == [(0, "link 'carriage' is 20 mm inside the fixture")], geom.kind


def test_a_shape_of_a_fixture_counts_as_it_is_turned(slide):
    """A bar of 0.6 m along x, turned about z, lies along y, where the sphere is."""
    bar = Geom(kind="box", size=(0.3, 0.05, 0.05), quaternion=(0.0, 0.0, 0.5**0.5, 0.5**0.5))
    beside = shape('<sphere radius="0.1"/>', xyz="0 0.28 0")
    assert causes(slide(beside, [0.1, 0.2], bar)) == [(0, "link 'carriage' is 50 mm inside the fixture")]


def test_what_of_a_fixture_is_only_drawn_does_not_count(slide):
    assert causes(slide(SPHERE, [0.0], dataclasses.replace(BOX, collide=False))) == []


def test_a_part_of_the_fixture_that_yields_counts_where_it_stands(slide):
    """A box on a spring: found at rest, and 30 mm further out once it is pushed that far."""
    spring = Sprung(name="pad", geoms=(BOX,), axis=(1.0, 0.0, 0.0), stiffness=1e4)
    plant = slide(SPHERE, [0.12, 0.12], sprung=(spring,))
    assert [words for _, words in causes(plant)] == ["link 'carriage' is 30 mm inside the fixture"] * 2
    position, _ = plant.state
    position[1, int(plant.model.joint("sprung_pad").qposadr[0])] = -0.03
    plant.set_state(position.copy(), 0.0 * plant.state[1], np.arange(2))
    assert causes(plant)[0] == (0, "link 'carriage' is 30 mm inside the fixture")
    assert [row for row, _ in causes(plant)] == [0]  # 0.12 m is just out of reach of 0.1 + 0.05 - 0.03


def test_only_the_trials_that_are_asked_for_are_answered(slide):
    plant = slide(SPHERE, [0.0, 0.5, 0.1], BOX)
    assert [row for row, _ in causes(plant)] == [0, 2]
    assert [row for row, _ in causes(plant, [1, 2])] == [2]


# --- which shapes ---


def test_collision_shapes_count_before_drawn_ones(slide):
    drawn = shape('<sphere radius="0.3"/>')
    collides = shape('<box size="0.02 0.02 0.02"/>', "collision")
    assert causes(slide(drawn + collides, [0.2], BOX)) == []
    assert causes(slide(drawn, [0.2], BOX)) == [(0, "link 'carriage' is 150 mm inside the fixture")]


def test_links_at_and_beyond_the_tool_frame_are_the_tool(slide):
    hand = (
        f'<link name="hand">{SPHERE}</link><joint name="h" type="fixed"><parent link="flange"/><child link="hand"/>'
        '<origin xyz="0 0 -1"/></joint>'
    )
    assert causes(slide("", [0.0], BOX, more=hand)) == []


def ring_of_the_carriage(folder):
    """A square ring of edges 0.2 and 0.3 m: its hull is full, the ring itself is not."""
    inner, outer = (np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * half for half in (0.1, 0.15))
    triangles = []
    for i in range(4):
        j = (i + 1) % 4
        for one, two in (((inner, -1), (inner, 1)), ((inner, 1), (outer, 1)), ((outer, 1), (outer, -1)),
                         ((outer, -1), (inner, -1))):  # fmt: skip
            (p, a), (q, b) = one, two
            corner = [(*p[i], 0.05 * a), (*p[j], 0.05 * a), (*q[j], 0.05 * b), (*q[i], 0.05 * b)]
            triangles += [[corner[0], corner[1], corner[2]], [corner[0], corner[2], corner[3]]]
    stl(folder / "ring.stl", triangles)
    return shape('<mesh filename="ring.stl"/>', "collision")


def test_a_ring_around_a_post_is_free_and_its_rim_is_not(slide, tmp_path):
    ring, post = ring_of_the_carriage(tmp_path), Geom(kind="box", size=(0.04, 0.04, 0.2))
    assert causes(slide(ring, [0.0, 0.055], post)) == []  # 60 mm of play on every side
    assert causes(slide(ring, [0.08], post)) == [(0, "link 'carriage' is 20 mm inside the fixture")]


def test_a_mesh_of_a_link_counts_as_it_stands_scaled_and_placed(slide, tmp_path):
    corners = [(0, 0, 0), (100, 0, 0), (0, 100, 0), (0, 0, 100)]
    stl(tmp_path / "tetra.stl", [[corners[i] for i in face] for face in ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3))])
    mesh = shape('<mesh filename="tetra.stl" scale="0.001 0.001 0.001"/>', xyz="0.2 0 0")
    found = causes(slide(mesh, [-0.16, -0.14], BOX))  # its flat side stands at x = q + 0.2
    assert found == [(0, "link 'carriage' is 10 mm inside the fixture")]


def test_a_link_of_meshes_that_are_not_there_counts_as_the_capsule_that_is_drawn(tmp_path, scene):
    """A bar of 0.6 m along x whose mesh is missing: a capsule of 60 mm radius meets a post beside its middle."""
    missing = shape('<mesh filename="no.stl"/>')
    text = f"""<robot name="bar"><link name="base"/><link name="bar">{INERTIAL}{missing}</link>
    <link name="end">{INERTIAL}</link><link name="flange"/>
    <joint name="a" type="revolute"><parent link="base"/><child link="bar"/><axis xyz="0 0 1"/>
    <limit lower="-1" upper="1" effort="9" velocity="1"/></joint>
    <joint name="b" type="revolute"><parent link="bar"/><child link="end"/><origin xyz="0.6 0 0"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="1" effort="9" velocity="1"/></joint>
    <joint name="f" type="fixed"><parent link="end"/><child link="flange"/></joint></robot>"""
    (tmp_path / "bar.urdf").write_text(text)
    (tmp_path / "robot.toml").write_text('urdf = "bar.urdf"\n[[arm]]\nname = "arm"\ntool_frame = "flange"\n')
    model = load_model(load_robot(tmp_path / "robot.toml"))
    post = Geom(kind="box", size=(0.02, 0.02, 0.2), position=(0.3, 0.05, 0.0))
    plant = Plant(model, dataclasses.replace(scene("free"), fixture=(post,)), 1, fixture_poses(model, {}, 1), {})
    plant.reset(np.zeros((1, 2)))
    assert causes(plant) == [(0, "link 'bar' is 30 mm inside the fixture")]  # 60 mm of radius, 30 mm to the face


# --- shipped robots ---


@pytest.mark.parametrize(
    "world", ["free", "valley", "funnel", "peg_in_hole", "hose_coupler", "corner", "socket"]
)  # fmt: skip
def test_a_panda_starts_free_of_every_shipped_world_from_each_of_its_starts(plant, scene, world):
    starts = scene(world).task.starts
    for start in starts:
        assert causes(plant("panda", world, start)) == []


def test_a_panda_cannot_reach_under_the_table_of_the_edge_but_through_it(plant):
    """The wrist stands beyond and below the edge, the arm comes from the other side: its forearm is in the table."""
    assert causes(plant("panda", "edge")) == [(0, "link 'link4' is 65 mm inside the fixture")]


def test_a_free_tool_has_no_links_that_could_be_inside(plant):
    assert causes(plant("free_tool", "valley", length=0.6, slope=1.1)) == []


def at_start(model, task, more, configuration):
    """What is found with geoms added to a scene's fixture."""
    now = dataclasses.replace(task, fixture=(*task.fixture, *more))
    plant = Plant(model, now, 1, fixture_poses(model, {}, 1), {})
    plant.reset(configuration(now))
    return causes(plant)


def ball_at(robot, joint):
    """The scene of two arms, with a ball of 20 mm of the held fixture at a joint of one arm, clear of both tools."""
    from skillframe.execution.prepare import load_world

    model, task = robot("dual_panda"), load_world("dual_peg", {})
    plant = Plant(model, task, 1, fixture_poses(model, {}, 1), {})
    plant.reset(start_configurations(model, task, {}, 1))
    position, quaternion = plant.body_poses()  # without the world
    fixture, body = (plant.model.body(name).id - 1 for name in ("fixture", joint))
    there = matrix_from_quaternion(quaternion[0, fixture]).T @ (position[0, body] - position[0, fixture])
    ball = Geom(kind="sphere", size=(0.02,), position=tuple(there.tolist()))
    return dataclasses.replace(task, fixture=(*task.fixture, ball))


@pytest.mark.needs_plugins
def test_the_arm_that_holds_the_fixture_may_touch_it_and_the_other_may_not(robot):
    for joint, link in (("right_joint7", None), ("left_joint7", "link 'left_link")):
        model, task = robot("dual_panda"), ball_at(robot, joint)
        found = at_start(model, task, [], lambda now: start_configurations(robot("dual_panda"), now, {}, 1))
        assert [words[: len(link or "")] for _, words in found] == ([] if link is None else [link])


@pytest.mark.needs_plugins
def test_a_run_of_two_arms_ends_where_the_one_is_in_what_the_other_holds(robot):
    now = dataclasses.replace(setup("dual_panda", "free"), center_of_compliance=np.zeros(3))
    failures = {
        joint: run(Hold(STIFF), dataclasses.replace(now, scene=ball_at(robot, joint)), duration_s=0.05).failure[0]
        for joint in ("left_joint7", "right_joint7")
    }
    assert failures["left_joint7"].startswith("begins inside something: link 'left_link")
    assert failures["left_joint7"].endswith("inside the fixture")
    assert "inside the fixture" not in failures["right_joint7"]


def test_a_boom_in_the_fixture_is_found_and_the_load_on_it_is_not(robot, scene):
    """At home the crane stands free of the pallets. A bar through the middle of its boom is found, and one through the
    load, 1.2 m further out and in the stack by design, is not."""
    model, task = robot("hiab_xs031"), scene("pallets")

    def bar_at(x, z):
        bar = Geom(kind="box", size=(0.05, 0.5, 0.05), position=(x - 3.0, 0.0, z))  # the fixture stands at x = 3 m
        return at_start(model, task, [bar], lambda now: model.home[None])

    assert at_start(model, task, [], lambda now: model.home[None]) == []
    ((_, words),) = bar_at(0.34, 1.45)  # half way from the lift joint (-0.19, 0.85) to the tilt joint (0.87, 2.05)
    assert "link 'lift_boom'" in words
    assert bar_at(2.65, 0.5) == []

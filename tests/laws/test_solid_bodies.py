"""Walls, forearms and tables on seven robots, two arms against each other: what passed through ends with both names."""

import re
from dataclasses import replace

import numpy as np
import pytest
from skillframe_testkit.suites import HoldSkill

from skillframe.execution.executor import Setup, simulate
from skillframe.execution.prepare import load_robot_model, load_world
from skillframe.frames import norm, quaternion_from_matrix
from skillframe.robot.tables import Obstacle
from skillframe.skill import Ended
from skillframe.world.collisions import Collisions
from skillframe.world.placement import fixture_poses, nominal_fixture
from skillframe.world.plant import Plant
from skillframe.world.scene import Geom
from tests.fmu_cache import compiler, own_cache  # noqa: F401
from tests.laws.pushing import Push
from tests.laws.runs import SILENT, generators

pytestmark = [pytest.mark.usefixtures("own_cache", "compiler"), pytest.mark.needs_plugins]
STIFF = np.diag([1000.0] * 3 + [50.0] * 3)
ROBOTS = {  # world, first body of the arm, elbow, wrist
    "panda": ("free", "joint2", "joint4", "joint6"),
    "dual_panda": ("dual_peg", "left_joint2", "left_joint4", "left_joint6"),
    "panda_servo": ("free", "joint2", "joint4", "joint6"),
    "hiab_xs031": ("pallets", "lift", "tilt", "extension"),
    "fr3": ("free", "joint2", "joint4", "joint6"),
    "kuka_iiwa14": ("free", "joint2", "joint4", "joint6"),
    "ur5e_torque": ("free", "shoulder_lift_joint", "elbow_joint", "wrist_1_joint"),
}


def start(name):
    """A set-up, and where its bodies stand at the start, by name."""
    world = ROBOTS[name][0]
    now = Setup(
        robot=load_robot_model(name), scene=load_world(world, {}), center_of_compliance=np.zeros(3), sensors=SILENT
    )
    trace = held(now).traces[0]
    names = [body["name"] for body in trace.meta["bodies"]]
    return now, dict(zip(names, trace.body_position[0], strict=True)), trace


def held(now, seconds=0.02):
    return simulate(HoldSkill(), now, {}, generators(1), duration_s=seconds, trace_hz=100.0)


def bar(one, two, half):
    """Position, attitude and half sizes of a bar between two points of the base, `half` thick."""
    along = (two - one) / norm(two - one)
    side = np.linalg.svd(along[None])[2][1]
    turn = np.stack([side, np.cross(along, side), along], axis=-1)
    return 0.5 * (one + two), turn, (half, half, 0.5 * float(norm(two - one)))


def with_fixture(now, position, turn, half):
    """The scene with a box more, given in base, in its fixture."""
    fixture = nominal_fixture(now.robot)
    back = fixture.rotation.T
    geom = Geom(
        kind="box", size=tuple(half), position=tuple(back @ (position - fixture.position)),
        quaternion=tuple(quaternion_from_matrix(back @ turn)),
    )  # fmt: skip
    return replace(now, scene=replace(now.scene, fixture=(*now.scene.fixture, geom)))


def no_start(now, other):
    result = held(now)
    assert result.ended_by[0] == Ended.START, result.failure
    assert not result.success[0]
    assert re.fullmatch(f"begins inside something: link '.+' is [0-9.]+ mm inside {other}", result.failure[0])


@pytest.mark.slow
@pytest.mark.parametrize("name", ROBOTS)
def test_a_wall_a_fixture_as_long_as_the_forearm_and_a_table_under_the_elbow_are_no_start(name):
    """The robot as it is runs. A wall of 20 mm stands across the way from the elbow to the wrist, a bar of 40 mm lies
    along it, and a table's face stands at the height of the elbow's axis."""
    now, at, trace = start(name)
    assert trace.meta["ended_by"] == "time", trace.meta["failure"]
    elbow, wrist = (at[ROBOTS[name][i]] for i in (2, 3))
    middle, turn, half = bar(elbow, wrist, 0.02)
    no_start(with_fixture(now, middle, turn, (0.3, 0.3, 0.01)), "the fixture")
    no_start(with_fixture(now, middle, turn, half), "the fixture")
    table = Obstacle(name="table", size=(0.3, 0.3, 0.04), position=tuple(elbow - [0.0, 0.0, 0.02]))
    spec = replace(now.robot.spec, obstacle=(table,))
    no_start(replace(now, robot=replace(now.robot, spec=spec)), "the obstacle 'table'")


def test_two_arms_that_are_driven_into_each_other_end_where_they_meet():
    """Both stretch out towards each other until they cross: found with a link of each arm. At home, and folded back,
    nothing is found."""
    model = load_robot_model("dual_panda")
    plant = Plant(model, load_world("dual_peg", {}), 3, fixture_poses(model, {}, 3), {})
    q = np.tile(model.home, (3, 1))
    index = {name: model.model.joints[i].idx_q for i, name in enumerate(model.model.names)}
    for side in ("left", "right"):
        q[0, index[f"{side}_joint2"]], q[0, index[f"{side}_joint4"]] = 0.6, -1.2
        q[2, index[f"{side}_joint2"]], q[2, index[f"{side}_joint4"]] = -0.8, -2.6
    plant.reset(q)
    touches = {touch.row: touch for touch in Collisions(plant).touches(plant, np.arange(3))}
    assert list(touches) == [0]
    assert {touches[0].first[:10], touches[0].second[:11]} == {"link 'left", "link 'right"}


@pytest.mark.slow
def test_an_arm_that_is_pushed_into_a_post_stops_with_the_names_of_both_and_no_force():
    """The tool goes sideways at 0.2 m/s, free in the air; a post beside the wrist is met on the way. Until the end no
    contact force is felt: what is not the tool pushes on nothing."""
    now, at, _ = start("panda")
    wrist = at["joint6"] + np.array([0.0, 0.14, 0.05])
    post = with_fixture(now, wrist, np.eye(3), (0.05, 0.02, 0.05))
    push = Push((0.0, 1.0, 0.0), STIFF, speed=0.2, stall=False)
    alone = simulate(push, now, {}, generators(1), duration_s=1.0, trace_hz=100.0)
    result = simulate(push, post, {}, generators(1), duration_s=1.0, trace_hz=100.0)
    assert alone.ended_by[0] == Ended.TIME
    assert result.ended_by[0] == Ended.COLLISION, result.failure
    assert 0.05 < result.duration_s[0] < 1.0
    assert result.peak_force_n[0] == 0.0
    depth = float(result.failure[0].split(" mm")[0].split()[-1])
    assert depth <= 4.0  # 1 mm of tolerance and 10 ms at 0.2 m/s, and rounding


@pytest.mark.slow
def test_trials_are_the_same_to_the_bit_beside_others_that_touch():
    """Four trials, two of them with a fixture turned into the forearm: each ends as it ends alone."""
    now, _, _ = start("panda")
    wall = with_fixture(now, np.array([0.25, 0.35, 0.5]), np.eye(3), (0.02, 0.02, 0.3))
    tilt = np.array([0.0, 0.9, 1.5, 1.7])
    push = lambda: Push((0.0, 0.0, -1.0), STIFF, speed=0.05, stall=False)  # noqa: E731

    def outcome(rows):
        draws = {"fixture.tilt_z": tilt[rows]}
        rngs = [np.random.default_rng([3, i]) for i in rows]
        result = simulate(push(), wall, draws, rngs, duration_s=0.3, trace_hz=100.0)
        return [(result.failure[k], result.traces[k].position.tobytes()) for k in range(len(rows))]

    together = outcome([0, 1, 2, 3])
    assert {"inside the fixture" in words for words, _ in together} == {True, False}
    assert [outcome([i])[0] for i in range(4)] == together
    assert outcome([2, 0]) == [together[2], together[0]]

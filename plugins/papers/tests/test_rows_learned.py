"""Rows 36 to 39: what theory says of starts, what counts as published, and verdicts on counts made up here."""

import numpy as np
import pytest
from skillframe_papers.rows import concatenated, coordinates, region, sensorless, skills
from skillframe_papers.rows.blocks import Trials, successes
from skillframe_papers.rows.harness import Ran, stiff
from skillframe_papers.rows.skills import by_hand

from skillframe.execution.prepare import load_robot_model, load_world
from skillframe.extend import RowRun
from skillframe.frames import rotate, rotation_matrix

LIMIT = np.radians(45.0) - np.arctan(0.2)
JOB = RowRun(settings={})


def ran(hits, count=24):
    return Ran(np.arange(count).reshape(4, -1) < hits)


@pytest.mark.slow
def test_skills_side_by_side_end_as_each_does_alone():
    robot, scene = load_robot_model("free_tool"), load_world("valley", {})
    draws = {"start.offset_x": np.array([0.006, 0.03])}
    given = [by_hand(), stiff(by_hand(), "translation", 1000.0), by_hand(at=[0.0, 0.0, 0.1])]
    trials = [Trials(each, draws, [np.random.default_rng(k) for k in range(2)]) for each in given]
    both = successes(robot, scene, trials, duration_s=1.0)
    alone = [successes(robot, scene, [each], duration_s=1.0)[0] for each in trials]
    assert [each.tolist() for each in both] == [each.tolist() for each in alone]
    assert both[0].tolist() == [True, False], "too far for a second"


def test_a_push_straight_down_converges_in_valleys_tilted_by_less_than_the_limit_of_either_side():
    scene = load_world("valley", {})
    given = region.starts(scene, LIMIT, 400, 1)
    borne = given.side * given.draws["fixture.tilt_y"] < LIMIT
    np.testing.assert_array_equal(region.converges(region.DOWN, given, LIMIT), borne)
    assert 0.3 < borne.mean() < 0.7
    for off in np.radians([6.0, -6.0]):  # a push that is off bears less towards its side, and more from the other
        push = rotate(rotation_matrix(np.array([0.0, off, 0.0])), region.DOWN)
        moved = given.side * (given.draws["fixture.tilt_y"] - off) < LIMIT
        np.testing.assert_array_equal(region.converges(push, given, LIMIT), moved)


def test_starts_of_the_region_lie_over_the_slope_of_their_side_of_the_tilted_valley():
    scene = load_world("valley", {})
    given = region.starts(scene, LIMIT, 50, 1)
    offset = np.stack([given.draws[f"start.offset_{a}"] for a in "xyz"], axis=-1)
    tip = np.array(scene.start_tip) + offset
    tip[:, 2] += scene.start_lift(offset, 0.0 * offset)
    seen = rotate(np.swapaxes(given.turn, -1, -2), tip)
    np.testing.assert_array_equal(np.sign(seen[:, 0]), given.side)
    np.testing.assert_allclose(seen[:, 2] - np.abs(seen[:, 0]), scene.start_tip[2], atol=1e-12)
    away = np.abs(seen[:, 0])
    assert region.NEAR_M <= away.min() < away.max() <= region.FAR_M


@pytest.mark.parametrize(
    ("ours", "straight", "every", "expected"),
    [(190, 150, 100, "pass"), (190, 185, 100, "fail"), (190, 150, 189, "fail"), (150, 100, 100, "fail")],
)
def test_the_region_s_row_fails_where_what_knows_nothing_of_the_learned_push_tells_as_well(
    ours, straight, every, expected
):
    tried = [region.Tried(0.05, {}, np.arange(200) < 100)]
    right = {region.OURS: ours, region.STRAIGHT: straight, region.ALL: every, region.NONE: 200 - every}
    row = region.result(JOB, right, tried)
    assert row.verdict == expected and "100 converge" in row.difference and "2.9 to 2.9" in row.difference


@pytest.mark.parametrize(
    ("valley", "coupler", "null", "expected"),
    [(24, 24, 2, "pass"), (24, 24, 24, "fail"), (24, 10, 2, "fail"), (24, 21, 2, "reported")],
)
def test_one_demonstration_must_do_in_both_worlds_and_beside_a_stiff_push(valley, coupler, null, expected):
    found = {
        world: {skills.ONE: ran(hits), skills.RIGID: ran(null)}
        for world, hits in (("valley", valley), ("hose coupler", coupler))
    }
    assert skills.of_one(JOB, found, "").verdict == expected


def part(direction, *axes):
    return {"desired_direction": direction, "compliant_axes": list(axes), "fully_compliant": False}


def test_what_is_published_of_each_world_is_asked_of_what_was_learned():
    down, x, y, none = [0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], None
    tasks = concatenated.TASKS
    assert tasks["valley"].right(part(down, x), part(none), 0.2)
    assert not tasks["valley"].right(part([-0.6, 0.0, -0.8], x), part(none), 0.2), "36.9 degrees are over the limit"
    assert not tasks["valley"].right(part(down, x, y), part(none), 0.2), "an axis too many"
    for name in ("peg", "hose coupler"):
        assert tasks[name].right(part(down, x), part(none, y), 0.2)
        assert not tasks[name].right(part(down, x), part(y, y), 0.2), "a direction of turning"
        assert not tasks[name].right(part(none, x), part(none, y), 0.2), "no push"
    assert not tasks["peg"].right(part([0.2, 0.0, -0.98], x), part(none, y), 0.2), "11.5 degrees off"


@pytest.mark.parametrize(
    ("literal", "null", "ours", "expected", "said"),
    [
        (20, 5, 20, "pass", "neither is ahead"),
        (20, 20, 20, "fail", "neither is ahead"),
        (8, 0, 20, "fail", "ours is ahead"),
        (20, 5, 8, "pass", "it is ahead"),
    ],
)
def test_concatenation_is_judged_beside_one_demonstration_and_beside_ours(literal, null, ours, expected, said):
    hits = {concatenated.LITERAL: literal, concatenated.NULL: null, concatenated.OURS: ours}
    row = concatenated.result(JOB, dict.fromkeys(concatenated.TASKS, hits), 20)
    assert row.verdict == expected and said in row.difference


@pytest.mark.parametrize(
    ("ours", "base", "still", "expected"),
    [(24, 5, 24, "pass"), (24, 22, 24, "fail"), (15, 0, 24, "fail"), (24, 5, 10, "fail")],
)
def test_the_tool_s_axes_must_do_where_base_axes_do_not_and_both_in_place(ours, base, still, expected):
    found = {
        coordinates.Case(world, axes, turned): ran(hits)
        for world in coordinates.WORLDS
        for axes, turned, hits in (
            (coordinates.TOOL, True, ours), (coordinates.BASE, True, base),
            (coordinates.TOOL, False, still), (coordinates.BASE, False, still),
        )
    }  # fmt: skip
    assert coordinates.result(JOB, found).verdict == expected


def test_all_is_turned_by_40_to_80_degrees():
    for seed in range(10):
        x, y, z, w = coordinates.turned(seed).spec.workspace.orientation
        angle = 2.0 * np.degrees(np.arctan2(np.linalg.norm([x, y, z]), abs(w)))
        assert coordinates.LEAST_DEG <= angle <= coordinates.MOST_DEG


@pytest.mark.parametrize(
    ("ours", "none", "motion", "expected"),
    [(24, 0, 0, "pass"), (24, 24, 0, "fail"), (24, 0, 24, "fail"), (12, 0, 0, "fail"), (21, 0, 0, "reported")],
)
def test_a_commanded_wrench_must_do_where_none_and_on_the_hump_the_mean_motion_do_not(ours, none, motion, expected):
    ways = {sensorless.OURS: ran(ours), sensorless.NONE: ran(none), sensorless.SENSED: ran(24)}
    valley, hump = ({**ways, sensorless.MOTION: ran(n)} for n in (24, motion))
    assert sensorless.result(JOB, dict(zip(sensorless.TASKS, (valley, hump), strict=True))).verdict == expected


def test_a_push_put_in_another_s_place_is_stiff_along_itself_and_free_square_to_it():
    push = np.array([0.6, 0.0, -0.8])
    part = sensorless.along(by_hand(), push)["phases"][0]["translation"]
    stiffness, (axis,) = np.array(part["stiffness"]), np.array(part["compliant_axes"])
    np.testing.assert_allclose(stiffness @ push, 1000.0 * push)
    np.testing.assert_allclose(stiffness @ axis, 0.0, atol=1e-9)
    assert axis @ push == pytest.approx(0.0) and part["desired_direction"] == push.tolist()

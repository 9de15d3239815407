"""Phases in the frames of places: which place a contact belongs to, and that a policy follows the place."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from skillframe_segmenter.placed import Placed, Placement
from skillframe_segmenter.visits import BASE, visits_of
from skillframe_teaching.sessions import record
from skillframe_teaching.teacher import TeacherSettings

from skillframe.demonstration.record import Demonstration
from skillframe.document.file import learned
from skillframe.document.frame import as_plain, places_of
from skillframe.errors import InputError, UnknownName
from skillframe.execution.executor import simulate
from skillframe.execution.prepare import load_robot_model, load_world, prepare
from skillframe.extend import LearnOptions
from skillframe.extend.registry import registry
from skillframe.frames import Pose, quaternion_from_matrix, rotate, rotate_spatial, rotation_matrix
from skillframe.sequence import Moved
from skillframe.skill import Command, Impedance, Observation, Skill, no_reasons

RATE, PRESS_N = 100.0, 15.0
BOARD = {  # in the board's frame: a level face, and one that leans by 30 degrees
    "level": Pose(np.array([-0.1, 0.0, 0.0]), np.eye(3)),
    "leaning": Pose(np.array([0.1, 0.05, 0.02]), rotation_matrix([0.5236, 0.0, 0.0])),
}
STOOD = [Pose(np.array([0.05 * i, -0.03 * i, 0.0]), rotation_matrix([0.0, 0.0, 0.5 * i])) for i in range(3)]


def pressing(board, seed=0, order=("level", "leaning"), slide=0.0):
    """A person presses on each place: from 60 mm above to the face at 40 mm/s, 1 s of 15 N, and back at 80 mm/s."""
    rng, points, forces, turns = np.random.default_rng(seed), [], [], []
    for name in order:
        place = board.compose(BOARD[name])
        high, face = (place.at(np.array([0.0, 0.0, z])).position for z in (0.06, 0.0))
        end = place.at(np.array([slide, 0.0, 0.0])).position
        away = place.at(np.array([slide, 0.0, 0.06])).position
        for a, b, count, push in (
            (points[-1] if points else high, high, 100, 0.0), (high, face, 150, 0.0), (face, end, 100, PRESS_N),
            (end, away, 75, 0.0), (away, away, 30, 0.0),
        ):  # fmt: skip
            points += list(a + (b - a) * np.linspace(0.0, 1.0, count, endpoint=False)[:, None])
            forces += [push * place.rotation[:, 2]] * count
            turns += [place.rotation @ np.diag([1.0, -1.0, -1.0])] * count
    wrench = np.hstack([np.array(forces), np.zeros((len(forces), 3))]) + rng.normal(0.0, 0.05, (len(forces), 6))
    shaken = np.array(points) + rng.normal(
        0.0, 2e-5, (len(points), 3)
    )  # a hand that stood still to the bit would stall
    return Demonstration(
        time=np.arange(len(points)) / RATE, position=shaken, quaternion=quaternion_from_matrix(np.array(turns)),
        wrench=wrench, meta={"places": as_plain({name: board.compose(pose) for name, pose in BOARD.items()})},
        source=f"press{seed}",
    )  # fmt: skip


def shown(**more):
    return [pressing(board, i, **more) for i, board in enumerate(STOOD)]


@cache
def moved_policy():
    return policy(shown())


def policy(demonstrations, **settings):
    return learned(registry().skill("policy"), demonstrations, LearnOptions(settings=settings))


def named(demonstration, **poses):
    places = {**demonstration.meta["places"], **as_plain(poses)}
    return replace(demonstration, meta={"places": places})


def test_visits_begin_and_end_where_the_tool_came_and_went():
    rows, _ = visits_of(shown())
    for row in rows:
        assert [visit.place for visit in row] == ["level", "leaning"]
        first = row[0]  # 1 s of standing, then 60 mm at 40 mm/s to the touch at 2.5 s, 1 s of pressing
        assert first.touch == pytest.approx(2.5, abs=0.03)  # the contact's bound is at a tenth of the force
        assert first.far == pytest.approx(2.5 - 0.04 / 0.04, abs=0.05)
        assert first.near == pytest.approx(2.5 - 0.008 / 0.04, abs=0.05)
        assert first.leaves == pytest.approx(3.5, abs=0.1)  # speeds are averaged over 0.1 s
        assert first.out == pytest.approx((3.5 + 0.008 / 0.08, 3.5 + 0.04 / 0.08), abs=0.06)


def test_a_contact_belongs_to_what_it_moved_with_and_not_to_what_was_nearer():
    aside = BOARD["level"].at(np.array([0.02, 0.0, 0.0]))  # named 20 mm beside where it was touched
    near = [
        named(
            d, level=board.compose(aside),
            lamp=Pose(d.position[250] + 0.001 * i * np.ones(3), rotation_matrix([0.0, 0.0, 2.0 * i])),
        )
        for i, (d, board) in enumerate(zip(shown(), STOOD, strict=True))
    ]  # fmt: skip
    # the lamp follows the touch itself to 3 mm; what is fixed to the board agrees to the micrometre
    rows, scatters = visits_of(near)
    assert rows[0][0].place == "level"
    assert scatters[0]["lamp"] > 1e-3 > scatters[0]["level"]


def test_a_contact_that_moved_with_no_place_is_in_base():
    still = [pressing(STOOD[0], i) for i in range(3)]
    strays = [
        named(d, **{n: board.compose(pose) for n, pose in BOARD.items()}) for d, board in zip(still, STOOD, strict=True)
    ]
    rows, _ = visits_of(strays)
    assert {visit.place for visit in rows[0]} == {BASE}


@pytest.mark.slow
def test_phases_say_the_same_wherever_the_board_stood():
    turned = Pose(np.array([0.3, 0.2, -0.1]), rotation_matrix([0.2, -0.4, 2.5]))
    one = moved_policy()
    other = policy([pressing(turned.compose(board), i) for i, board in enumerate(STOOD)])
    for a, b in zip(one["phases"], other["phases"], strict=True):
        directions = [p["learned"]["phases"][0]["translation"]["desired_direction"] for p in (a, b)]
        np.testing.assert_allclose(directions[0], directions[1], atol=0.1)  # noise is drawn in base axes: a few degrees
        for way in ("way_in", "way_out"):
            for p, q in zip(a[way], b[way], strict=True):
                np.testing.assert_allclose(p["position"], q["position"], atol=2e-3)  # a touch is told to 10 ms


def test_presses_on_faces_that_lean_differently_are_not_pooled():
    document = moved_policy()
    assert [phase["place"] for phase in document["phases"]] == ["level", "leaning"]
    for phase in document["phases"]:
        direction = phase["learned"]["phases"][0]["translation"]["desired_direction"]
        assert direction @ np.array([0.0, 0.0, -1.0]) > np.cos(np.deg2rad(8.0))  # the face's own normal


def test_without_places_nothing_changes():
    one = pressing(STOOD[0], order=("level",))
    plain = policy([replace(one, meta={})])
    assert plain["phases"] == policy([one], places=False)["phases"]
    assert "places" not in plain


def test_demonstrations_that_do_not_agree_on_places_are_refused():
    first, other = pressing(STOOD[0]), pressing(STOOD[1], 1, order=("leaning", "level"))
    with pytest.raises(InputError, match="press1: visits leaning, level, and the first one level, leaning"):
        policy([first, other])
    air = replace(first, wrench=np.random.default_rng(0).normal(0.0, 1e-3, first.wrench.shape))
    with pytest.raises(InputError, match="touches nothing"):
        policy([first, air])
    with pytest.raises(InputError, match="names no place that all"):
        policy([first, replace(first, meta={"places": as_plain({"lamp": STOOD[0]})})])


class _Push(Skill):
    """Pushes along the frame's -z, stiff there, and never ends."""

    def start(self, observation, rngs):
        self._count = len(rngs)

    def step(self, observation):
        stiffness = np.diag([100.0, 200.0, 300.0, 1.0, 2.0, 3.0])
        pose = Pose(observation.pose.position - [0.0, 0.0, 1e-3], observation.pose.rotation)
        twist, force = np.tile([1.0, 2.0, 3.0, 4.0, 5.0, 6.0], (self._count, 1)), observation.wrench + 1.0
        return Command(pose, twist, Impedance(stiffness), force, np.zeros(self._count, int), no_reasons(self._count))


def steps(place, count=200):
    """Commands of a placed phase for a tool that is where it was told to be, which starts along with the place."""
    ways = [
        Pose(np.array([0.0, 0.0, 0.04]), np.eye(3)),
        Pose(np.array([0.0, 0.0, 0.01]), rotation_matrix([0.2, 0.0, 0.0])),
    ]
    skill, commands = Moved(lambda: Placed(Placement("hole", place, ways, [], 0.2), _Push), place), []
    pose = Pose(*(x[None] for x in place.compose(Pose(np.array([0.05, 0.02, 0.1]), rotation_matrix([0.0, 0.3, 0.0])))))
    for i in range(count):
        wrench = rotate_spatial(place.rotation, np.array([[0.1, 0.2, 0.3, 0.4, 0.5, 0.6]]))
        seen = Observation(np.array([0.01 * i]), 0.01, pose, np.zeros((1, 6)), wrench)
        if i == 0:
            skill.start(seen, [np.random.default_rng(0)])
        commands.append(skill.step(seen))
        pose = commands[-1].pose
    return commands


@pytest.mark.slow
def test_a_phase_that_is_carried_along_with_its_place_commands_the_same_there():
    place = Pose(np.array([0.4, -0.2, 0.1]), rotation_matrix([0.3, -0.8, 1.9]))
    turn, both = place.rotation, np.kron(np.eye(2), place.rotation)
    for a, b in zip(steps(Pose(np.zeros(3), np.eye(3))), steps(place), strict=True):
        np.testing.assert_allclose(b.pose.position, rotate(turn, a.pose.position) + place.position, atol=1e-9)
        np.testing.assert_allclose(b.pose.rotation, turn @ a.pose.rotation, atol=1e-9)
        np.testing.assert_allclose(b.impedance.stiffness, both @ a.impedance.stiffness @ both.T, atol=1e-9)
        np.testing.assert_allclose(b.twist, rotate_spatial(turn, a.twist), atol=1e-9)
        np.testing.assert_allclose(b.feedforward, rotate_spatial(turn, a.feedforward), atol=1e-9)
    assert np.any(steps(place)[-1].feedforward)  # the work began, and did not only travel


def test_a_run_goes_by_where_the_world_says_the_places_are_and_refuses_a_world_without_them():
    document, robot = moved_policy(), load_robot_model("free_tool")
    with pytest.raises(UnknownName, match=r"unknown place 'leaning'.*say where it is"):
        prepare(robot, load_world("free", {}), document)
    prepare(robot, load_world("free", {}), document, places=BOARD)


@pytest.mark.slow
def test_a_board_that_moved_is_worked_where_it_stands_now_and_not_where_it_stood():
    robot, board = load_robot_model("free_tool"), {"layout": 2, "count": 1}
    taught = load_world("task_board", board)
    demonstrations = record(robot, taught, TeacherSettings(), count=1, seed=5, duration_s=30.0).demonstrations
    document = policy(demonstrations)
    there = load_world("task_board", {**board, "x": 0.04, "y": -0.03, "yaw": 0.5, "tilt": 0.1})
    outcomes = []
    for told in (None, places_of(demonstrations[0])):
        skill, setup = prepare(robot, there, document, places=told)
        outcomes.append(simulate(skill, setup, {}, [np.random.default_rng(0)], duration_s=30.0))
    assert outcomes[0].success.all(), outcomes[0].failure
    assert not outcomes[1].success.any()  # told that the board has not moved

"""A part that rests at its depth is drawn back over the nominal axis, as far as its contacts let it."""

import numpy as np
import pytest
from skillframe_search.centre import ACROSS, Centre
from skillframe_search.handling import HANDLING
from skillframe_search.seat import CENTRING

from plugins.search.tests.test_seat import DOWN, Played
from skillframe.frames import Pose
from skillframe.skill import Observation, Status

END = np.array([[0.4, 0.0, 0.2]])


def drawn(wall_m, seconds=1.0, lag_m=0.0):
    """The last command and place of a tool 3 mm aside that follows, and touches a wall so far from the axis [m].

    Friction lets it follow so far behind.
    """
    skill, x = Centre(END, DOWN, 8.0), 0.003
    wanted = x
    for k in range(round(seconds / 0.01)):
        pose = Pose(END + np.array([[x, 0.0, 0.0]]), np.eye(3)[None])
        wrench = np.zeros((1, 6))
        wrench[0, 0] = ACROSS * (max(wall_m - wanted, 0.0) + min(lag_m, x - wanted))
        seen = Observation(np.array([0.01 * k]), 0.01, pose, np.zeros((1, 6)), wrench)
        if not k:
            skill.start(seen, [np.random.default_rng(0)])
        command = skill.step(seen)
        if command.status[0]:
            break
        wanted = float(command.pose.position[0, 0]) - 0.4
        x = min(x, max(wanted + lag_m, wall_m))
    return command, x


def test_a_part_that_nothing_holds_arrives_over_the_axis():
    command, x = drawn(-1.0)
    assert command.status[0] == Status.SUCCESS and x == pytest.approx(0.0, abs=0.00021)
    assert "drawn back by 2.8 of 3.0 mm" in command.reason[0] and "held" not in command.reason[0]


def test_what_friction_holds_back_with_less_than_that_arrives_as_well():
    """6 N at 4000 N/m are 1.5 mm."""
    command, x = drawn(-1.0, lag_m=0.0015)
    assert command.status[0] == Status.SUCCESS and x == pytest.approx(0.0, abs=0.00021)
    assert "held" not in command.reason[0]


def test_what_yields_to_the_stated_force_alone_is_wanted_no_farther_beyond_the_axis():
    """A script that never moves and feels nothing: it ends, wanted 8 N / 4000 N/m beyond."""
    skill = Centre(END, DOWN, 8.0)
    pose = Pose(END + 0.003 * np.eye(3)[:1], np.eye(3)[None])
    for k in range(40):
        seen = Observation(np.array([0.01 * k]), 0.01, pose, np.zeros((1, 6)), np.zeros((1, 6)))
        if not k:
            skill.start(seen, [np.random.default_rng(0)])
        command = skill.step(seen)
    assert command.status[0] == Status.SUCCESS
    assert command.pose.position[0, 0] - 0.4 == pytest.approx(-8.0 / ACROSS)


def test_a_wall_ends_it_where_it_holds_with_more_than_the_stated_force():
    command, x = drawn(0.0028)
    assert command.status[0] == Status.SUCCESS and x == pytest.approx(0.0028)
    assert "drawn back by 0.2 of 3.0 mm, held with" in command.reason[0]


def test_it_presses_along_the_way_and_is_stiff_across_it_alone():
    command, _ = drawn(-1.0, seconds=0.01)
    stiffness = command.impedance.stiffness
    assert stiffness[2, 2] == 0.0 and stiffness[0, 0] == stiffness[1, 1] == ACROSS
    assert command.feedforward[0, :3] @ DOWN > 0.0


def test_where_there_is_no_bottom_it_holds_its_height_and_does_not_press():
    skill = Centre(END, DOWN, 8.0, pressed=False)
    seen = Observation(
        np.zeros(1), 0.01, Pose(END + 0.003 * np.eye(3)[:1], np.eye(3)[None]), np.zeros((1, 6)), np.zeros((1, 6))
    )
    skill.start(seen, [np.random.default_rng(0)])
    command = skill.step(seen)
    np.testing.assert_array_equal(command.feedforward, 0.0)
    np.testing.assert_allclose(command.impedance.stiffness[:3, :3], ACROSS * np.eye(3))


def rests(aside, **changes):
    played = Played(**changes)
    played.go()
    played.deep[:], played.aside[:] = 0.0, aside
    return played, played.go(HANDLING.stall_s + 0.05)


def test_at_the_end_and_aside_it_is_drawn_back_once_and_then_done():
    played, command = rests(0.0015)
    assert not command.status.any()
    assert played.go(2.0).status.tolist() == [Status.SUCCESS] * 3  # a hole's walls hold it where it is
    names = [text.split(":")[0] for _, text in played.skill.journal(0)]
    assert names == ["push", played.skill.parts[CENTRING].name, "push", "ended"]
    assert rests(0.0015, centre_n=0.0)[1].status.all() and rests(0.0005)[1].status.all()


def test_what_nothing_stops_is_not_pressed_while_it_is_drawn_back():
    played = Played(stop_m=0.001)
    played.go()
    played.deep[:], played.aside[:] = 0.0, 0.0015
    command = played.go(0.4)  # drawn back from 0.3 s on
    assert (played.skill.current == CENTRING).all()
    np.testing.assert_array_equal(command.feedforward, 0.0)


def test_farther_aside_than_the_fixture_may_be_off_is_no_seat():
    played, _ = rests(0.02)
    played.go(HANDLING.stall_s + 2.0)
    names = [text.split(":")[0] for _, text in played.skill.journal(0)]
    assert names[:4] == ["push", "centre", "push", "approach"]

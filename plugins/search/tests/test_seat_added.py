"""What a seating adds to its push: it brakes, holds upright, rocks, swings and settles."""

from dataclasses import replace

import numpy as np
import pytest
from seat_played import DOWN, MOST_TILT, SEAT, Played, searching
from skillframe_search.handling import HANDLING
from skillframe_search.rocking import Rocking
from skillframe_search.seat import APPROACH, MOST_TURNING_S, PUSHING, REST_S, SEARCHING, SWINGING
from skillframe_search.swing import HOW

from skillframe.frames import norm, rotation_matrix
from skillframe.skill import Impedance, Status

SWUNG_S = HOW.lift_s + 4 * HOW.least_s + HOW.upright_s + (HOW.lift_m + 0.020) / HOW.down_m_s + 0.2
"""Duration of a swing 20 mm short of the end, of a part that does not move."""


def test_what_falls_in_is_braked_along_the_way_beyond_the_speed_of_the_catch():
    played = Played()
    for speed in (0.02, 0.03, 0.13):
        played.speed = speed
        brake = HANDLING.catch_ns_m * max(speed - 0.03, 0.0)
        np.testing.assert_allclose(
            played.go().feedforward[:, :3], np.tile(np.ones(3) - brake * DOWN, (3, 1)), atol=1e-9
        )


def test_a_part_that_rests_in_the_hole_after_a_search_is_rocked_and_only_then():
    played = searching()
    quiet = played.go().feedforward
    np.testing.assert_allclose(quiet[0], np.ones(6))  # nothing is added to a search
    played.search.ends = {0: Status.SUCCESS}
    played.deep[:] = -0.008
    assert norm(played.go(0.1).feedforward[0, 3:] - 1.0) < 1e-12  # it has rested for less than rock_after_s
    rocked = played.go(0.2).feedforward - 1.0
    assert norm(rocked[0, 3:]) == pytest.approx(0.4) and abs(rocked[0, 5]) < 1e-12
    assert norm(rocked[1, 3:]) == 0.0  # a push that has not been searched for


def test_a_part_that_stays_at_rest_in_the_hole_is_turned_more_slowly_and_harder():
    """Quickly first, which frees a jam, then slowly: a tool's inertia and damping hold a quick turn to a degree."""
    played = searching()
    played.search.ends = {0: Status.SUCCESS}
    played.deep[:] = -0.008
    played.go(HANDLING.slow_after_s + 0.05)
    rocked = [played.go().feedforward[0, 3:] - 1.0 for _ in range(100)]  # one turn of 1 Hz
    np.testing.assert_allclose(norm(np.array(rocked)), HANDLING.slow_nm)
    first, quarter, half = (np.array(rocked)[i] for i in (0, 25, 50))
    np.testing.assert_allclose(half, -first, atol=1e-9)
    assert abs(first @ quarter) < 1e-9 and HANDLING.slow_hz == 1.0


def test_in_the_hole_a_push_presses_along_the_way_alone_and_on_the_rim_as_it_was_learned():
    """A slanting push, stiff along itself and on one axis across. It is in from 2 mm below the first contact on."""
    played = Played()
    slant = np.array([np.sin(0.3), 0.0, -np.cos(0.3)])
    played.push.impedance = Impedance(np.zeros((6, 6)))
    stiffness = played.push.impedance.stiffness[:3, :3]
    stiffness += 1000.0 * np.outer(slant, slant) + 500.0 * np.outer([0.0, 1.0, 0.0], [0.0, 1.0, 0.0])
    played.deep[:] = (-0.012, -0.009, -0.012)
    played.push.lead = 0.010 * slant + np.array([0.0, 0.004, 0.0])
    command = played.go()
    lead = command.pose.position - played.seen().pose.position
    force = lead @ stiffness + command.feedforward[:, :3] - 1.0  # the script's own feed-forward
    wanted = np.tile([10.0 * np.sin(0.3), 2.0, -10.0 * np.cos(0.3)], (3, 1))
    wanted[1, :2] = 0.0
    np.testing.assert_allclose(force, wanted, atol=1e-9)


def test_in_the_hole_a_push_is_not_led_across_the_way_and_a_search_is(monkeypatch):
    played = searching()
    played.deep[:] = -0.009
    aside = np.array([0.03, 0.0, 0.0])
    for script in (played.push, played.search):
        step = script.step
        monkeypatch.setattr(script, "step", lambda seen, step=step: _led(step(seen), aside))
    command = played.go()
    np.testing.assert_allclose(command.twist[:, 0], [0.03, 0.0, 0.0])
    played.deep[:] = -0.012
    np.testing.assert_allclose(played.go().twist[1:, 0], 0.03)


def _led(command, aside):
    command.twist[:, :3] += aside
    return command


def test_a_part_that_stays_short_of_its_end_in_the_hole_is_swung_and_pushed_on_about_the_axis_found():
    """Of a hole of 60 mm 40 are left, and the hole leans by 2 degrees, the part 0.5 mm aside."""
    played = Played(contact_m=0.060)
    played.deep[:] = -0.060
    played.go()
    played.push.ends = {0: Status.SUCCESS}
    played.deep[0] = -0.020
    played.go(0.02)
    assert played.skill._urged[0]
    played.go(HANDLING.swing_s + 0.1)
    assert played.skill.current.tolist() == [SWINGING, SEARCHING, SEARCHING]
    played.turn[0] = lean = np.array([0.0, 0.035, 0.0])
    played.aside[0] = 0.0005
    played.go(SWUNG_S)
    assert played.skill.current[0] == PUSHING
    told = played.skill.journal(0)[-1][1]
    # the axis crosses the mouth 40 mm above the tip
    assert "the axis leans by 2.0 degrees" in told and f"the axis {0.5 + 40 * np.tan(0.035):.1f} mm aside" in told
    _, pose = played.push.begun[-1]
    np.testing.assert_allclose(pose.rotation[0], np.eye(3), atol=1e-9)  # upright, seen from where the fixture is
    torque = played.go(HANDLING.slow_after_s + 0.7 / HANDLING.tip_hz).feedforward[0, 3:] - rotation_matrix(
        lean
    ) @ np.ones(3)
    turns = (played.time - played.skill._since[0] - HANDLING.slow_after_s) * HANDLING.tip_hz
    assert norm(torque) == pytest.approx(HANDLING.tip_nm_rad * HANDLING.tip_pitch_m / 0.04 * turns, rel=0.02)
    assert played.skill._most_tilt()[0] == pytest.approx(np.sqrt(2.0) * HANDLING.known_rad)


def test_an_axis_that_is_farther_off_than_the_fixture_may_be_is_not_taken_for_its():
    played = Played(contact_m=0.060)
    played.deep[:] = -0.020
    played.go()
    played.push.ends = {0: Status.SUCCESS}
    played.go(HANDLING.swing_s + 0.1)
    played.turn[0] = (0.0, 1.1 * MOST_TILT, 0.0)
    played.go(SWUNG_S)
    assert "farther off than the fixture may be" in played.skill.journal(0)[-1][1]
    assert played.skill._frame is None and not played.skill._known.any()


def test_a_seating_that_starts_again_in_some_trials_knows_nothing_of_what_it_found_there():
    """Trial 0 was swung; it starts again as one that never was, and the others go on."""
    played, fresh = Played(contact_m=0.060), Played(contact_m=0.060)
    played.deep[:] = -0.020
    played.go()
    played.push.ends = {0: Status.SUCCESS}
    played.go(HANDLING.swing_s + 0.1)
    played.turn[0] = (0.0, 0.035, 0.0)
    played.go(SWUNG_S)
    assert played.skill._known[0]
    played.skill.switch(1, APPROACH, played.time, "returns")
    played.skill.switch(0, APPROACH, played.time, "returns")
    np.testing.assert_array_equal(played.skill._frame.rotation[0], np.eye(3))  # to the nominal place
    assert not played.skill._known[0] and played.skill._tilt[0] == SEAT.tilt_rad
    seen = played.seen()
    played.skill.restart(np.array([0]), seen, [np.random.default_rng(0)])
    fresh.skill.start(seen, [np.random.default_rng(i) for i in range(3)])
    a, b = (each.skill.step(seen) for each in (played, fresh))
    np.testing.assert_array_equal(a.feedforward[0], b.feedforward[0])
    np.testing.assert_array_equal(a.pose.position[0], b.pose.position[0])
    assert played.skill.journal(0) == fresh.skill.journal(0) and not played.skill._known[0]


@pytest.mark.parametrize("changes", [{}, {"settle_s": 0.5, "stop_m": 0.001}])
def test_a_part_at_its_end_is_not_rocked_unless_that_is_asked_for_and_it_is_stopped(changes):
    played = searching(**changes)
    played.search.ends = {0: Status.SUCCESS}
    played.deep[:] = -0.0004
    added = played.go(0.25).feedforward[0] - 1.0
    assert norm(added[3:]) < 1e-12 and abs(added[0]) < 1e-12 and abs(added[1]) < 1e-12


def test_a_part_that_rests_near_its_end_is_rocked_and_drawn_to_the_nominal_axis():
    """Before it is called seated. At 0.5 mm aside it is drawn with 2 N, at 4000 N/m, and at 2 mm with the most, 6 N."""
    played = Played(settle_s=0.5)
    played.go()
    played.deep[:], played.aside[:] = -0.0004, [0.0, 0.0005, 0.002]
    before = played.go(0.11).feedforward - 1.0  # a tick after the depth was reached it begins to rest
    np.testing.assert_allclose(before[:, [0, 1, 3, 4]], 0.0, atol=1e-12)
    added = played.go(0.14).feedforward - 1.0
    share = Rocking(HANDLING, replace(SEAT, settle_s=0.5), np.eye(3)).settling(np.array([0.24]))[0]
    assert 0.8 < share < 0.9
    np.testing.assert_allclose(added[:, 0], -share * np.minimum(4000.0 * played.aside, HANDLING.settle_n), atol=1e-9)
    np.testing.assert_allclose(norm(added[:, 3:]), share * HANDLING.settle_nm)
    np.testing.assert_allclose((played.go(0.4).feedforward - 1.0)[:, [0, 1, 3, 4]], 0.0, atol=1e-12)


def test_a_part_that_rests_short_of_its_end_is_not_drawn_aside():
    played = Played(settle_s=0.5)
    played.go()
    played.deep[:], played.aside[:] = -0.005, 0.001
    played.go(0.11)
    np.testing.assert_allclose((played.go(0.14).feedforward - 1.0)[:, [0, 1, 3, 4]], 0.0, atol=1e-12)


def test_a_part_that_still_turns_is_not_seated_yet_but_not_for_ever():
    """At 2 degrees a second it turns by 10 mrad in 0.3 s. At a tenth of that it rests."""
    played = Played(settle_s=0.5)
    played.go()
    played.deep[:], rate = 0.0, np.radians([2.0, 0.2, 0.0])
    seated = np.full(3, np.nan)
    for _ in range(400):
        played.turn[:, 0] += 0.01 * rate
        status = played.go().status
        seated = np.where(np.isnan(seated) & (status == Status.SUCCESS), played.time, seated)
    np.testing.assert_allclose(seated, 0.5 + np.array([MOST_TURNING_S, REST_S, REST_S]), atol=0.05)


@pytest.mark.parametrize("settle", [0.0, 0.5])
def test_a_part_that_goes_straight_in_is_pulled_upright_until_it_rests_short_of_its_end_or_settles(settle):
    played = Played(settle_s=settle)
    played.go()
    played.turn[:, 0] = 0.02
    for deep, pulled in ((-0.0115, True), (-0.009, True), (-0.0002, not settle)):
        played.deep[:] = deep
        assert played.go().feedforward[0, 3] - 1.0 == pytest.approx(-0.02 * HANDLING.upright_nm_rad * pulled, abs=1e-12)
    played.deep[:] = -0.009
    played.push.ends = {0: Status.SUCCESS}
    played.go(0.02)
    assert played.skill.current[0] == PUSHING  # it goes on, and rocks
    pulls = played.go().feedforward[:2, 3] - 1.0
    np.testing.assert_allclose(pulls, (0.0, -0.02 * HANDLING.upright_nm_rad), atol=1e-12)

"""What a seating adds to its push: catch, keep, lean, rock, and an attitude that follows."""

from dataclasses import replace

import numpy as np
import pytest
from seat_played import DOWN, MOST_TILT, SEAT, Played, searching
from skillframe_search.rocking import Rocking
from skillframe_search.seat import MOST_TURNING_S, PUSHING, REST_S, SEARCHING

from skillframe.frames import norm, rotation_matrix, rotation_vector
from skillframe.skill import Impedance, Status


def test_what_falls_in_is_braked_along_the_way_beyond_the_speed_of_the_catch():
    played = Played()
    for speed in (0.02, 0.03, 0.13):
        played.speed = speed
        brake = 400.0 * max(speed - 0.03, 0.0)
        np.testing.assert_allclose(
            played.go().feedforward[:, :3], np.tile(np.ones(3) - brake * DOWN, (3, 1)), atol=1e-9
        )


def test_what_lies_down_is_pulled_upright_with_more_beyond_the_stated_tilt():
    played = Played()
    for angle in (0.05, 0.3):
        played.turn[:] = (0.0, angle, 0.0)
        pull = 3.0 * angle + 20.0 * max(angle - MOST_TILT, 0.0)
        np.testing.assert_allclose(played.go().feedforward[0, 3:], (1.0, 1.0 - pull, 1.0), atol=1e-9)


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


def test_in_the_hole_the_attitude_wanted_follows_the_measured_one_up_to_the_stated_tilt_and_no_farther():
    played = searching()
    played.search.ends = {0: Status.SUCCESS}
    played.go(0.02)
    for angle in (0.06, 0.5):
        played.turn[:] = (angle, 0.0, 0.0)
        wanted = played.go(1.4).pose.rotation  # e^(-1.4 / 0.31) is 1.1 %
        followed = rotation_vector(wanted[0])
        np.testing.assert_allclose(followed, (min(angle, MOST_TILT), 0.0, 0.0), atol=0.012 * angle)
        played.deep[0] += 0.001
    np.testing.assert_allclose(wanted[1], rotation_matrix(played.turn[1]))  # the push's own, before any search


def test_a_part_that_stays_at_rest_in_the_hole_is_turned_more_slowly_and_harder():
    """Quickly first, which frees a jam, then slowly: a tool's inertia and damping hold a quick turn to a degree."""
    played = searching()
    played.search.ends = {0: Status.SUCCESS}
    played.deep[:] = -0.008
    played.go(SEAT.slow_after_s + 0.05)
    rocked = [played.go().feedforward[0, 3:] - 1.0 for _ in range(100)]  # one turn of 1 Hz
    np.testing.assert_allclose(norm(np.array(rocked)), SEAT.slow_nm)
    first, quarter, half = (np.array(rocked)[i] for i in (0, 25, 50))
    np.testing.assert_allclose(half, -first, atol=1e-9)
    assert abs(first @ quarter) < 1e-9 and SEAT.slow_hz == 1.0


@pytest.mark.parametrize(
    ("searched", "deep", "wide"),
    [(False, -0.012, False), (True, -0.012, True), (False, -0.009, True), (True, 0.0, True)],
)  # as wide at the end as at the mouth, since the fixture may be turned about either
def test_a_push_is_kept_where_the_fixture_may_be_which_is_wider_once_it_is_searched_for_or_is_in(searched, deep, wide):
    """Shift 2 mm, tilt 5 degrees, a hole of 12 mm: within 3.8 mm on the rim before the search, and 5.3 mm else."""
    played = searching(keep_n_m=1000.0) if searched else Played(keep_n_m=1000.0)
    played.search.ends = {0: Status.SUCCESS}
    played.deep[0] = deep
    most = np.sqrt(2.0) * (SEAT.shift_m + wide * SEAT.tilt_rad * SEAT.contact_m) + SEAT.aside_m
    for beyond, pull in ((-1e-4, 0.0), (0.002, 2.0)):
        played.aside[0] = most + beyond
        played.go(0.02)
        np.testing.assert_allclose(played.go().feedforward[0, :3], (1.0 - pull, 1.0, 1.0), atol=1e-9)


def test_what_is_driven_back_fast_is_not_held_out_by_the_damping_of_the_keep(monkeypatch):
    played = Played()
    played.aside[:] = 0.005
    seen = played.seen

    def moving(speed):
        found = seen()
        found.twist[:, 0] = speed
        return found

    played.aside[0] = 0.003
    monkeypatch.setattr(played, "seen", lambda: moving(0.05))
    assert played.go().feedforward[0, 0] == 1.0  # within it nothing is added, however fast it goes
    played.aside[:] = 0.005
    outward = []
    for speed in (0.05, 0.0, -1.0):
        monkeypatch.setattr(played, "seen", lambda speed=speed: moving(speed))
        outward.append(float(played.go().feedforward[0, 0]) - 1.0)
    assert outward[0] < outward[1] < 0.0
    assert outward[1] - outward[0] == pytest.approx(100.0 * 0.05)  # Ns/m
    assert outward[2] == 0.0


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


def test_the_tip_goes_on_a_spiral_once_the_push_goes_on_and_the_push_is_patient_with_it():
    """20 mm are left of a hole of 60: six turns, of which the first leans by a sixth of the most."""
    played = Played(contact_m=0.060)
    played.deep[:] = -0.060
    played.go()
    for script in (played.push, played.search):
        script.ends = {0: Status.SUCCESS}
        played.go(0.02)
    played.deep[:] = -0.020
    torque = played.go(SEAT.slow_after_s + 0.8).feedforward[0, 3:] - 1.0
    assert norm(torque) == pytest.approx(SEAT.slow_nm)  # after a search a torque alone
    assert not played.skill._urged[0]
    played.go(SEAT.patience_s - SEAT.slow_after_s - 0.8 + 0.02)
    assert played.skill._urged[0]
    torque = played.go(SEAT.slow_after_s + 1.0 / SEAT.tip_hz).feedforward[0, 3:] - 1.0
    assert norm(torque) == pytest.approx(SEAT.tip_nm_rad * MOST_TILT / 6.0, rel=0.03)
    played.go(3.0)  # 4.6 s in all, and it waits 5.75
    assert played.skill.current[0] == PUSHING
    played.go(1.5)
    assert played.skill.current[0] == SEARCHING


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
    share = Rocking(replace(SEAT, settle_s=0.5), np.eye(3)).settling(np.array([0.24]))[0]
    assert 0.8 < share < 0.9
    np.testing.assert_allclose(added[:, 0], -share * np.minimum(4000.0 * played.aside, SEAT.settle_n), atol=1e-9)
    np.testing.assert_allclose(norm(added[:, 3:]), share * SEAT.settle_nm)
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
def test_a_part_that_goes_straight_in_is_pulled_upright_until_it_rests_short_of_its_end_or_is_to_settle(settle):
    played = Played(settle_s=settle)
    played.go()
    played.turn[:, 0] = 0.02
    for deep, pulled in ((-0.0115, True), (-0.009, not settle), (-0.0002, not settle)):
        played.deep[:] = deep
        assert played.go().feedforward[0, 3] - 1.0 == pytest.approx(-0.02 * SEAT.upright_nm_rad * pulled, abs=1e-12)
    played.deep[:] = -0.009
    played.push.ends = {0: Status.SUCCESS}
    played.go(0.02)
    assert played.skill.current[0] == PUSHING  # it goes on, and rocks
    pulls = played.go().feedforward[:2, 3] - 1.0
    np.testing.assert_allclose(pulls, (0.0, -0.02 * SEAT.upright_nm_rad * (not settle)), atol=1e-12)

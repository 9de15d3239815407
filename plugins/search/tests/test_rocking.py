"""What turns a part that rests in a hole: torques that go round, and a spiral of the tip, by closed forms."""

from dataclasses import replace

import numpy as np
import pytest
from seat_played import MOST_TILT, SEAT
from skillframe_search.handling import HANDLING
from skillframe_search.rocking import AFTER_S, MEAN_S, SETTLE_AFTER_S, Rocking

from skillframe.frames import Pose, norm, rotation_matrix
from skillframe.skill import Observation

DEEP_HOLE = replace(SEAT, contact_m=0.060)
SPRING = 1e4
MOST = MOST_TILT


def seen(turn, rate=(0.0, 0.0, 0.0), time=0.0, dt=0.001):
    """Two tools that lean by a rotation vector [rad] and turn at a rate [rad/s]."""
    twist = np.tile([0.0, 0.0, 0.0, *rate], (2, 1))
    rotation = rotation_matrix(np.tile(turn, (2, 1)))
    return Observation(np.full(2, time), dt, Pose(np.zeros((2, 3)), rotation), twist, np.zeros((2, 6)))


def played(seat=DEEP_HOLE, how=HANDLING):
    rocking = Rocking(how, seat, np.eye(3))
    rocking.start(2)
    return rocking


def spiral(rocking, idle, turn=(0.0, 0.0, 0.0), rate=(0.0, 0.0, 0.0), deep=-0.02, urged=True):
    """The torque on the first of two tools that rest."""
    one, both = np.array([urged, False]), np.ones(2, dtype=bool)
    torque = rocking.torque(seen(turn, rate), np.full(2, idle), np.full(2, deep), both, one, MOST)
    assert norm(torque[1]) == pytest.approx(
        HANDLING.slow_nm
    )  # whose push does not go on yet is turned by a torque alone
    return torque[0]


def test_the_spiral_of_the_tip_has_its_pitch_over_how_deep_it_is_in():
    """60 mm of hole, 20 mm of them left: a lever of 40 mm, so that 2 mm of pitch are 50 mrad a turn."""
    how = replace(HANDLING, tip_pitch_m=0.002, tip_nm_rad=SPRING, tip_nm=1e6)
    for turns in (0.25, 1.0, 1.5):
        torque = spiral(played(how=how), HANDLING.slow_after_s + turns / how.tip_hz)
        assert norm(torque) == pytest.approx(SPRING * 0.05 * turns) and torque[2] == 0.0
    wide = spiral(played(how=how), HANDLING.slow_after_s + 30.0 / how.tip_hz)
    assert norm(wide) == pytest.approx(SPRING * MOST_TILT)
    ways = [spiral(played(how=how), HANDLING.slow_after_s + turns / how.tip_hz) for turns in (1.0, 1.25, 1.5)]
    assert ways[0] @ ways[1] == pytest.approx(0.0, abs=1e-9)
    np.testing.assert_allclose(ways[2] / norm(ways[2]), -ways[0] / norm(ways[0]), atol=1e-9)


def test_the_spiral_is_about_the_mean_attitude_damped_and_no_stronger_than_allowed():
    how = replace(HANDLING, tip_pitch_m=0.0, tip_nm_rad=10.0, tip_nm=1e6)
    rocking, lean = played(how=how), np.array([0.05, 0.0, 0.0])
    begin = HANDLING.slow_after_s + 1e-4
    assert norm(spiral(rocking, begin, lean)) < 0.01  # it begins where the part leans
    away = np.array([0.05, 0.04, 0.0])
    for _ in range(1000):  # a second of 1 ms, as long as the mean
        torque = spiral(rocking, begin + 0.001, away)
    left = 0.04 * np.exp(-1.0 / MEAN_S)
    assert torque[1] == pytest.approx(-10.0 * left, rel=0.05)
    still, moving = (spiral(played(how=how), begin, lean, rate) for rate in ((0.0, 0.0, 0.0), (0.0, 0.6, 0.3)))
    np.testing.assert_allclose(moving - still, [0.0, -0.3, 0.0], atol=1e-12)  # 0.5 Nms/rad, not about the way
    weak = replace(how, tip_nm_rad=SPRING, tip_nm=0.9)
    assert norm(spiral(played(how=weak), HANDLING.slow_after_s + 3.0)) == pytest.approx(0.9)


def test_a_spiral_is_the_same_to_the_bit_whoever_searches_beside_it():
    """Two tools that begin one after the other, pause and go on, against each by itself."""
    rocking, alone = played(DEEP_HOLE), [played(DEEP_HOLE) for _ in range(2)]
    for each in alone:
        each.start(1)
    spans = ((10, 40), (60, 90)), ((25, 70), (95, 99))
    rng, begun = np.random.default_rng(0), np.zeros(2, dtype=np.intp)
    for tick in range(100):
        rests = np.array([any(low <= tick < high for low, high in span) for span in spans])
        begun = np.where(rests, begun + 1, 0)
        idle, turn = HANDLING.slow_after_s + 0.0015 * begun, rng.normal(0.0, 0.02, (2, 3))
        whole = seen((0.0, 0.0, 0.0), time=1e-3 * tick)
        whole = whole._replace(pose=Pose(whole.pose.position, rotation_matrix(turn)))
        yes, deep = np.ones(2, dtype=bool), np.full(2, -0.02)
        both = rocking.torque(whole, idle, deep, rests, yes, MOST)
        for i, each in enumerate(alone):
            one = Observation(
                whole.time[i : i + 1], whole.dt, Pose(whole.pose.position[i : i + 1], whole.pose.rotation[i : i + 1]),
                whole.twist[i : i + 1], whole.wrench[i : i + 1],
            )  # fmt: skip
            mine = each.torque(one, idle[i : i + 1], deep[:1], rests[i : i + 1], yes[:1], MOST)
            np.testing.assert_array_equal(mine[0], both[i])


@pytest.mark.parametrize(("deep", "urged"), [(-0.058, True), (-0.02, False)])
def test_there_is_no_spiral_where_the_lever_is_short_or_before_the_push_goes_on(deep, urged):
    """0.7 mm on a lever of 2 mm are 20 degrees, which is more than a part may lean."""
    torque = spiral(played(DEEP_HOLE), HANDLING.slow_after_s + 1.0, deep=deep, urged=urged)
    assert norm(torque) == pytest.approx(HANDLING.slow_nm)
    found = played(DEEP_HOLE).patience(np.array([deep]), np.array([urged]), MOST)
    assert found[0] == HANDLING.patience_s


@pytest.mark.parametrize(("lever", "turns"), [(0.030, MOST_TILT * 0.030 / HANDLING.tip_pitch_m), (0.055, 6.0)])
def test_a_push_is_patient_until_the_spiral_is_at_its_widest(lever, turns):
    """Six turns at most."""
    seat = DEEP_HOLE
    found = played(seat).patience(np.array([lever - seat.contact_m]), np.array([True]), MOST)
    assert found[0] == pytest.approx(HANDLING.slow_after_s + turns / HANDLING.tip_hz + AFTER_S)
    none = replace(HANDLING, tip_pitch_m=0.0)  # nothing to be searched for, and nothing divided by
    assert played(seat, none).patience(np.zeros(1), np.array([True]), 0.0)[0] == HANDLING.patience_s


def test_what_settles_a_part_rises_holds_and_fades_within_its_time():
    seat = replace(SEAT, settle_s=0.6)
    idle = SETTLE_AFTER_S + 0.6 * np.array([-0.1, 0.0, 0.0625, 0.125, 0.5, 0.75, 1.0, 2.0])
    np.testing.assert_allclose(played(seat).settling(idle), [0.0, 0.0, 0.5, 1.0, 0.6, 0.3, 0.0, 0.0], atol=1e-9)
    np.testing.assert_array_equal(played(replace(SEAT, settle_s=0.0)).settling(idle), 0.0)
    ways = [played(seat).settle(np.full(2, t), np.array([1.0, 0.5])) for t in (0.0, 0.25 / HANDLING.rock_hz)]
    np.testing.assert_allclose(norm(ways[0]), [HANDLING.settle_nm, 0.5 * HANDLING.settle_nm])
    assert ways[0][0] @ ways[1][0] == pytest.approx(0.0, abs=1e-12) and not ways[0][:, 2].any()

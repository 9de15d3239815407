"""The points of an insertion: each tier in closed form."""

from types import SimpleNamespace

import numpy as np
import pytest
from skillframe_benchmarks import insertion

TIME = np.linspace(0.0, 5.0, 501)
HIGH, DEEP = 0.1, 0.06


def ran(end=-DEEP, *, success=True, aside=0.0, force=0.0, force_s=0.0, duration=5.0, **meta):
    """The tip goes from 0.1 m above a port straight down at one speed. The fixture stands turned and aside in base."""
    turn = np.array([0.0, 0.0, np.sin(0.3), np.cos(0.3)])
    place = np.array([0.5, 0.2, 0.3])
    way = np.stack([np.full(501, aside), np.full(501, aside), HIGH + (end - HIGH) * TIME / 5.0], axis=1)
    way[0, :2] = 0.0 if aside < 0.006 else aside
    rotation = np.array([[np.cos(0.6), -np.sin(0.6), 0.0], [np.sin(0.6), np.cos(0.6), 0.0], [0.0, 0.0, 1.0]])
    twist, wrench = np.zeros((501, 6)), np.zeros((501, 6))
    twist[:, 2], wrench[:, 2] = (end - HIGH) / 5.0, force * (force_s >= TIME)
    return SimpleNamespace(
        time=TIME, position=way @ rotation.T + place - [0.0, 0.0, 0.2], twist=twist, wrench=wrench,
        quaternion=np.tile([0.0, 0.0, 0.0, 1.0], (501, 1)), command_wrench=np.tile([0.0, 0, -2.0, 0, 0, 0], (501, 1)),
        body_position=np.tile(place, (501, 1, 1)), body_quaternion=np.tile(turn, (501, 1, 1)),
        meta={"success": success, "duration_s": duration, "progress": {"of_m": DEEP}, "bodies": [{"name": "fixture"}],
              "center_of_compliance": [0.0, 0.0, 0.0], "frames": {"tip": [0.0, 0.0, 0.2]}, **meta},
    )  # fmt: skip


def test_the_jerk_of_a_parabola_of_velocity_is_its_second_derivative():
    trace = ran()
    trace.twist = np.zeros((501, 6))
    trace.twist[:, 0] = 1.0 + 0.5 * 3.0 * TIME**2  # a local parabola fits it exactly
    trace.twist[:, 1] = 0.5 * 4.0 * TIME**2
    assert insertion.jerk(trace) == pytest.approx(5.0, rel=1e-6)
    trace.twist[200:] = 0.0  # at rest nothing counts, and 7 samples before it see the stop
    trace.time = TIME[:190]
    trace.twist = trace.twist[:190]
    assert insertion.jerk(trace) == pytest.approx(5.0, rel=1e-6)


def test_work_way_and_time_of_a_force_are_those_of_the_straight_motion():
    trace = ran(force=25.0, force_s=1.5)
    assert insertion.path(trace) == pytest.approx(HIGH + DEEP)
    assert insertion.energy(trace) == pytest.approx(2.0 * (HIGH + DEEP))
    assert insertion.force_time(trace) == pytest.approx(1.5, abs=0.01)
    trace.wrench[75, 2] = 0.0  # 0.75 s before, 0.74 s after
    assert insertion.force_time(trace) == pytest.approx(0.74, abs=0.011)


def test_a_success_has_all_points_but_for_its_way_into_the_port():
    """1 + 75 + 6 + 12, and 6 less 6 for each metre beyond the 0.1 m to the port: it goes 0.06 m further."""
    assert insertion.points(ran()) == pytest.approx(100.0 - 6.0 * DEEP)


@pytest.mark.parametrize(
    ("change", "lost"),
    [
        ({"duration": 32.5}, 6.0),  # half way from 5 s to 60 s
        ({"duration": 80.0}, 12.0),
        ({"force": 21.0, "force_s": 1.2}, 12.0),
        ({"force": 21.0, "force_s": 0.9}, 0.0),
        ({"force": 19.0, "force_s": 5.0}, 0.0),
        ({"touched": ["joint3", "table"]}, 24.0),
    ],
)
def test_time_force_and_collisions_cost_what_the_rules_say(change, lost):
    assert insertion.points(ran()) - insertion.points(ran(**change)) == pytest.approx(lost)


@pytest.mark.parametrize(
    ("end", "aside", "third"),
    [
        (-0.03, 0.0, 44.0),  # half the way in
        (-0.03, 0.0045, 44.0),  # by 4.5 mm along x and along y, 6.4 mm from the axis
        (0.02, 0.0, 25.0 * 0.6),  # half the start's 0.1 m is the farthest that counts
        (0.06, 0.0, 0.0),
    ],
)
def test_a_failure_has_points_for_how_far_in_or_how_near_it_ended(end, aside, third):
    trace = ran(end, aside=aside, success=False)
    motion = 18.0 + 6.0 * (1.0 - max(0.0, insertion.path(trace) - HIGH))
    assert insertion.points(trace) == pytest.approx(1.0 + third + (motion if third else 0.0))


def test_beside_the_port_a_low_tip_is_not_inside():
    trace = ran(-0.03, aside=0.006, success=False)
    near = 1.0 - np.linalg.norm([0.006, 0.006, 0.03]) / (0.5 * np.linalg.norm([0.006, 0.006, HIGH]))
    assert insertion.points(trace) < 1.0 + 25.0 * near + 24.0


def test_without_a_port_a_success_earns_all_and_a_failure_only_that_it_ran():
    """A straight way of 5 s, smooth: 1 + 75 + 6 + 12 + 6."""
    for none in ({"progress": None}, {"bodies": []}):
        assert insertion.points(ran(**none)) == pytest.approx(100.0)
        assert insertion.points(ran(success=False, **none)) == 1.0


def test_a_trial_that_diverged_has_no_jerk():
    trace = ran()
    trace.twist[-1] = np.inf
    assert np.isnan(insertion.jerk(trace))

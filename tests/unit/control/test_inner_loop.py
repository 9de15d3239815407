"""An arm's own loop: its filter against the exact solution, its delay in ticks, its servo against a push."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.linalg import expm

from skillframe.control.motors import InnerLoop
from skillframe.robot.interface import LOOP_DAMPING, SERVO, Control

DT = 1e-3


def arm(kind, delay=0.0, bandwidth=15.0):
    return Control(interface=kind, delay_s=delay, bandwidth_hz=bandwidth).admittance


def answer(kind, sent, delay=0.0, mass=3.0, push=0.0, bandwidth=15.0):
    """Place of one joint over time, integrated in ticks, and what the loop asked of it."""
    place, speed = np.zeros((1, 1)), np.zeros((1, 1))
    loop = InnerLoop(arm(kind, delay, bandwidth), place, lambda: np.full((1, 1, 1), mass), DT)
    ways, torques = [], []
    for value in sent:
        torque = loop.torque(np.full((1, 1), value), place, speed, np.zeros((1, 1)))
        speed = speed + DT * (torque + push) / mass
        place = place + DT * speed
        ways.append(place[0, 0])
        torques.append(torque[0, 0])
    return np.array(ways), np.array(torques)


def exact(kind, ticks, bandwidth=15.0):
    """Place after a step of the command to 1, at the ends of the ticks."""
    w = 2 * np.pi * bandwidth
    system = {"position": [[0, 1, 0], [-w * w, -2 * LOOP_DAMPING * w, w * w], [0, 0, 0]],
              "velocity": [[0, 1, 0], [0, -w, w], [0, 0, 0]]}[kind]  # fmt: skip
    step, state, ways = expm(np.array(system) * DT), np.array([0.0, 0.0, 1.0]), []
    for _ in range(ticks):
        state = step @ state
        ways.append(state[0])
    return np.array(ways)


@pytest.mark.parametrize("kind", ["position", "velocity"])
def test_a_joint_follows_a_step_as_the_filter_says(kind):
    """The simulated joint's own step is of first order: it may be a tick off, at the filter's fastest motion."""
    want = exact(kind, 400)
    found, _ = answer(kind, np.ones(400))
    fastest = np.abs(np.diff(want)).max()
    assert np.abs(found - want).max() < 1.2 * fastest
    assert found[-1] == pytest.approx(want[-1], abs=0.01 * want[-1])


@pytest.mark.parametrize("kind", ["position", "velocity"])
@pytest.mark.parametrize("ticks", [0, 1, 8, 40])
def test_a_command_is_heard_so_many_ticks_late_and_not_a_tick_sooner(kind, ticks):
    still, _ = answer(kind, np.ones(200))
    late, torque = answer(kind, np.ones(200), delay=ticks * DT)
    assert not torque[:ticks].any()
    assert torque[ticks] != 0.0
    np.testing.assert_array_equal(late[ticks:], still[: 200 - ticks])


@pytest.mark.parametrize(
    ("kind", "lag"), [("position", 2 * LOOP_DAMPING / (2 * np.pi * 15.0)), ("velocity", 1 / (2 * np.pi * 15.0))]
)
def test_a_ramp_is_followed_at_the_lag_that_the_total_delay_counts(kind, lag):
    """delay + 2 zeta/w, or 1/w, as somebody measures it on an arm with a slow sine."""
    ramp = np.full(1500, 0.1) if kind == "velocity" else 0.1 * DT * np.arange(1, 1501)
    place, _ = answer(kind, ramp, delay=0.008)
    behind = 0.1 * DT * 1500 - place[-1]
    assert behind / 0.1 == pytest.approx(lag + 0.008, abs=DT)  # ends of ticks


def test_a_push_bends_the_servo_by_its_stiffness_and_no_more():
    place, torque = answer("position", np.zeros(400), mass=3.0, push=6.0)
    assert place[-1] == pytest.approx(6.0 / (3.0 * SERVO**2), rel=1e-3)
    assert torque[-1] == pytest.approx(-6.0, rel=1e-3)


def test_the_bias_is_carried_and_masses_are_looked_at_every_twentieth_tick():
    asked = []

    def mass():
        asked.append(True)
        return np.full((2, 3, 3), np.nan) if len(asked) > 3 else np.tile(np.eye(3), (2, 1, 1))

    start = np.ones((2, 3))
    loop = InnerLoop(arm("position"), start, mass, DT)
    for _ in range(60):
        torque = loop.torque(start, start, np.zeros((2, 3)), np.array([[1.0, 2.0, 3.0]] * 2))
        np.testing.assert_allclose(torque, [[1.0, 2.0, 3.0]] * 2, atol=1e-12)  # rounding
    assert len(asked) == 3


@pytest.mark.parametrize("kind", ["position", "velocity"])
def test_a_joint_that_was_pushed_off_comes_back_as_two_equal_time_constants_say(kind):
    """e'' + 2 s e' + s^2 e = 0 from rest: e = e_0 (1 + s t) exp(-s t)."""
    start, mass = np.zeros((1, 1)), 2.0
    loop = InnerLoop(arm(kind), start, lambda: np.full((1, 1, 1), mass), DT)
    place, speed, ways = np.full((1, 1), 0.01), np.zeros((1, 1)), []
    for _ in range(40):
        torque = loop.torque(start, place, speed, np.zeros((1, 1)))
        speed = speed + DT * torque / mass
        place = place + DT * speed
        ways.append(place[0, 0])
    late = SERVO * DT * np.arange(1, 41)
    # a joint's step is of first order: a tick off at the fastest, which is s e_0 / e
    np.testing.assert_allclose(ways, 0.01 * (1.0 + late) * np.exp(-late), atol=SERVO * DT * 0.01 / np.e)


def test_the_filters_step_does_not_depend_on_how_often_the_tick_is_cut():
    """Exact: two ticks of half the length are one tick."""
    from skillframe.control.motors import _exact_step

    for kind in ("position", "velocity"):
        one, two = (np.array([*_exact_step(arm(kind), dt), (0.0, 0.0, 1.0)]) for dt in (2e-3, 1e-3))
        np.testing.assert_allclose(two @ two, one, atol=1e-12)


def test_a_row_does_not_depend_on_its_neighbours():
    rng = np.random.default_rng(3)
    masses = np.tile(np.eye(2), (4, 1, 1)) + 0.1 * rng.random((4, 2, 2))
    sent = rng.random((30, 4, 2))
    torques = []
    for rows in (slice(0, 4), slice(1, 2)):
        loop = InnerLoop(arm("position", 0.003), np.zeros((4, 2))[rows], lambda rows=rows: masses[rows], DT)
        torques.append([loop.torque(c[rows], 0.1 * c[rows], c[rows], c[rows]) for c in sent])
    for four, one in zip(*torques, strict=True):
        np.testing.assert_array_equal(four[1:2], one)
    assert all(not np.array_equal(a, b) for a, b in pairwise(torques[0]))

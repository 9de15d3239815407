"""What counts as having fallen in: by formula, without contact simulation."""

import numpy as np
import pytest
from skillframe_search.phase import Push, Stop
from skillframe_search.runtime import Watch

from skillframe.frames import Pose
from skillframe.skill import Observation

DT, PUSH = 1e-3, Push(direction=(0.0, 0.0, -1.0), force=10.0)


def observed(time, depth, answer):
    position, wrench = np.array([[0.0, 0.0, -depth]]), np.array([[0.0, 0.0, answer, 0.0, 0.0, 0.0]])
    return Observation(np.array([time]), DT, Pose(position, np.eye(3)[None]), np.zeros((1, 6)), wrench)


def fallen(depth, answer, seconds=2.0):
    """When it cries found [s], or None, with depth and answer as functions of time."""
    watch = Watch(PUSH, Stop(), np.array([[0.0, 0.0, -1.0]]), observed(0.0, depth(0.0), answer(0.0)))
    watch.answer[:] = answer(0.0)
    watch.settle(np.array([True]))
    for k in range(1, round(seconds / DT)):
        if watch.look(observed(k * DT, depth(k * DT), answer(k * DT)))[0]:
            return k * DT
    return None


def test_a_step_down_without_the_push_s_answer_is_a_hole():
    """It lets go at 1 s and is 5 mm deeper 50 ms later, 3 mm of them at 1.03 s."""
    when = fallen(lambda t: 0.1 * np.clip(t - 1.0, 0.0, 0.05), lambda t: 10.0 * (t < 1.0))
    assert when == pytest.approx(1.03, abs=0.005)


def test_depth_alone_is_no_hole():
    """A slope that answers all the way: 20 mm/s down. The surface follows 10 mm behind, more than 3 mm."""
    assert fallen(lambda t: 0.02 * t, lambda t: 10.0) is None


def test_a_lost_answer_alone_is_no_hole():
    """The tool hops for 0.1 s and comes down where it was."""
    assert fallen(lambda t: 0.0, lambda t: 10.0 * (abs(t - 1.0) > 0.05)) is None


def test_an_answer_that_was_lost_long_ago_does_not_make_a_slope_a_hole():
    assert fallen(lambda t: 0.02 * max(t - 1.3, 0.0), lambda t: 10.0 * (abs(t - 0.2) > 0.05), 3.0) is None

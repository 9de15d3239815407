"""Skills of several kinds through a link to a fake arm in the same process. A search ends where the part falls in."""

from __future__ import annotations

import pytest
from direct_link import arm
from test_drive import linked, tried, two_links

import skillframe

__all__ = ["two_links"]
WALL = {"world.wall_distance": 0.05}


def seat():
    return skillframe.learn(skillframe.record("peg_in_hole", "fr3", count=2, seed=1), "seat")


def search():
    shown = skillframe.record("peg_in_hole", "free_tool", teacher="blind", count=3, seed=1, set={"world.fillet": 8e-4})
    return skillframe.learn(shown, "search", at="tip")


def policy():
    return skillframe.segment(skillframe.record("valley", "fr3", count=2, seed=1, set=WALL), phases=2)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*spikes. 1 sample")  # of the first touch
@pytest.mark.parametrize(
    ("made", "world", "truth", "believed"),
    [
        (seat, "peg_in_hole", {"fixture__offset_x": 0.0015, "fixture__tilt_y": 0.03}, {}),
        (search, "peg_in_hole", {"fixture__offset_x": 0.0015, "world__fillet": 8e-4}, {"world.fillet": 8e-4}),
        (policy, "valley", {"fixture__offset_x": 0.004, "world__wall_distance": 0.05}, WALL),
    ],
)
@pytest.mark.parametrize("robot", ["fr3", "ur5e"])
def test_a_skill_of_any_kind_reaches_its_goal_where_the_fixture_truly_stands(made, world, truth, believed, robot):
    fake = arm(robot, world, **truth)
    run = tried(made(), robot, linked(robot, fake), world=world, believed=believed, witness="person", done=lambda: True)
    assert run.success, run
    assert fake.ground().goal or (made is search and "fell in" in run.trace.meta["reason"]), run

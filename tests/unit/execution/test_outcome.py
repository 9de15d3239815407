"""The judge of a trial: whose goal counts, and a goal that contradicts its own error."""

from types import SimpleNamespace

import numpy as np
import pytest

from skillframe.execution.outcome import MUCH, Outcomes
from skillframe.skill import Ended


def judged(before, after, goal):
    """Outcome of trials whose errors are `before` at the start and `after` at the end, (m, rad) each."""
    errors = iter([np.array(before), np.array(after)])
    count = len(before)
    scene = SimpleNamespace(goal=lambda state: np.array(goal), goal_error=lambda state: tuple(next(errors).T), way=None)
    setup = SimpleNamespace(scene=scene, robot=SimpleNamespace(spec=SimpleNamespace(limits=None)))
    shares = SimpleNamespace(energy=np.zeros(count), torque=None, speed=None, range=None, joints=None)
    drive = SimpleNamespace(
        plant=SimpleNamespace(tip_state=lambda: SimpleNamespace(second={})), shares=lambda: shares,
        outcome=lambda result: result,
    )  # fmt: skip
    nothing = np.zeros(count)
    contact = SimpleNamespace(estimate=nothing, peak=nothing, mean=nothing)
    outcomes = Outcomes(setup, drive, contact, count)
    setup.scene = SimpleNamespace(goal=lambda state: np.ones(count, dtype=bool), goal_error=None, way=None)
    outcomes.close(np.arange(count), 1.0, "done", Ended.SKILL, False)
    return outcomes.result(None, lambda i: [], SimpleNamespace(distance=nothing), False)


def test_the_goal_is_the_one_that_the_scene_had_before_the_skill_started():
    """`judged` replaces the scene, goal and error, between start and end."""
    result = judged([[0.06, 0.0]], [[0.061, 0.0]], [False])
    assert not result.success[0] and not result.goal_reached[0]
    assert result.final_error_m[0] == 0.061 and result.failure[0] == "goal not reached: done"


def test_a_success_that_is_much_farther_from_the_goal_than_the_start_is_a_contradiction_in_words():
    result = judged([[0.03, 0.0], [0.0, 0.1]], [[0.091, 0.0], [0.0, 0.5]], [True, True])
    assert not result.success.any()
    said = "contradiction: the goal criterion holds 91 mm and 0 rad from the goal, and the start was 30 mm and 0 rad"
    assert result.failure[0] == f"{said} from it"
    assert result.failure[1].startswith("contradiction: the goal criterion holds 0 mm and 0.5 rad from the goal")


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ((0.06, 0.2), (0.001, 0.0)),
        ((0.0, 0.0), (0.9 * MUCH[0], 0.9 * MUCH[1])),  # within the width of a goal
        ((0.06, 0.0), (0.001, 0.3)),  # nearer in one of the two
        ((0.0, 0.3), (0.02, 0.1)),
    ],
)
def test_a_success_that_is_nearer_than_the_start_or_within_a_goals_width_stays_one(before, after):
    assert judged([before], [after], [True]).success.all()

"""Verdicts on whole tasks run by an arm, from successes made up here."""

import numpy as np
import pytest
from skillframe_papers.rows import exceptions, screws, skills, whole_tasks
from skillframe_papers.rows.harness import Ran

from skillframe.execution.prepare import load_world
from skillframe.extend import RowRun


def ran(hits, count=24):
    return Ran(np.arange(count).reshape(4, -1) < hits)


@pytest.mark.parametrize(
    ("policy", "one", "shifted", "placed", "expected"),
    [
        (24, 0, 3, 2, "pass"),
        (24, 24, 3, 2, "fail"),  # one phase does as well
        (24, 0, 3, 20, "fail"),  # and so does a replay
        (20, 0, 3, 2, "reported"),
        (12, 0, 0, 0, "fail"),
    ],
)
def test_a_policy_is_worth_something_only_if_one_phase_and_replays_do_less(policy, one, shifted, placed, expected):
    names = ("policy", *whole_tasks.NULLS, whole_tasks.HALVES)
    counts = dict(zip(names, (policy, one, shifted, placed, policy), strict=True))
    row = whole_tasks.result(RowRun(settings={}), {name: ran(hits) for name, hits in counts.items()})
    assert row.verdict == expected
    assert f"cut in the middle, {policy} of 24" in row.ours and row.ours.endswith("by 95 % intervals not fewer")


def test_whole_tasks_start_as_shown_and_their_fixtures_stand_elsewhere_within_what_is_said():
    task = whole_tasks.TASKS["hose coupler"]
    scene = load_world(task.world, dict(task.params))
    draws = whole_tasks.draws(task, scene, 6, 1)
    shown = [start["start.tilt_y"] for start in scene.task.starts]
    assert draws["start.tilt_y"].tolist() == [shown[i % len(shown)] for i in range(6)]
    for key, most in task.moved.items():
        assert 0.0 < np.abs(draws[key]).max() <= most and len(set(draws[key])) == 6


SCREW = {
    "phases": [
        {
            "translation": {"desired_direction": [0.0, 0.0, -1.0], "speed": 0.004},
            "rotation": {"desired_direction": [0.0, 0.0, 1.0], "speed": 0.08},
            "pitch": 0.05,
        }
    ]
}


def test_a_screw_motion_pushes_and_turns_as_its_pitch_says_and_its_nulls_lack_one_of_them():
    assert screws.says(SCREW)
    assert not screws.says(screws.without(SCREW, "rotation")) and not screws.says(screws.without(SCREW, "translation"))
    assert not screws.says(screws.paced(SCREW)) and screws.says(SCREW)  # what is made of it leaves it as it is
    assert not screws.says({"phases": [{**SCREW["phases"][0], "pitch": 0.04}]})


@pytest.mark.parametrize(
    ("ours", "push", "turn", "told", "expected"),
    [
        (24, 2, 2, 4, "pass"),
        (24, 24, 2, 4, "fail"),
        (24, 2, 24, 4, "fail"),
        (24, 2, 2, 0, "fail"),
        (8, 0, 0, 4, "fail"),
    ],
)
def test_a_screw_s_row_fails_if_the_push_or_the_turn_does_it_alone_or_if_it_is_not_told(
    ours, push, turn, told, expected
):
    found = {screws.OURS: ran(ours), screws.PUSH: ran(push), screws.TURN: ran(turn), screws.HAND: ran(24)}
    row = screws.result(RowRun(settings={}), found, Ran.of(told, 4), 0)
    assert row.verdict == expected
    assert "by 95 % intervals not fewer: by hand: push and turn 24 of 24" in row.ours
    assert "so few sets do not show 90 % of sets" in row.ours


@pytest.mark.parametrize(
    ("ours", "alone", "spiral", "expected"),
    [(24, 0, 12, "pass"), (24, 24, 12, "fail"), (24, 0, 24, "fail"), (20, 0, 0, "reported"), (10, 0, 0, "fail")],
)
def test_a_search_on_a_stall_is_judged_beside_the_push_alone_and_beside_an_untaught_spiral(
    ours, alone, spiral, expected
):
    found = {exceptions.OURS: ran(ours), exceptions.NULL: ran(alone), exceptions.SPIRAL: ran(spiral)}
    row = exceptions.result(RowRun(settings={}), found, {exceptions.OURS: [5.0]})
    assert row.verdict == expected
    assert row.ours.endswith(f"no better than {exceptions.SPIRAL}") == (spiral == 24)
    assert row.rows[0][3] == "5.0 s" and row.rows[1][3] == "-"


def test_the_fixture_of_the_search_stands_3_to_5_mm_beside_its_place():
    off = exceptions.draws(50, 1)
    length = np.hypot(off["fixture.offset_x"], off["fixture.offset_y"])
    assert 0.003 <= length.min() < length.max() <= 0.005


@pytest.mark.parametrize("quick", [False, True])
def test_the_push_by_hand_is_run_from_the_same_starts_and_is_among_the_nulls(quick, monkeypatch):
    asked = {}

    def run(job, world, given, starts, *_):
        asked[world] = starts
        return {name: Ran(np.ones((len(each), 5), dtype=bool)) for name, each in given.items()}

    monkeypatch.setattr(skills, "run", run)
    monkeypatch.setattr(skills, "skills_of", lambda job, world, each=2: [skills.by_hand()] * 6)
    skills._pegs.cache_clear()
    for row in (skills.region, skills.peg, skills.single):
        told = row(RowRun(settings={}, quick=quick))
        assert told.verdict == "fail" and "no better than " in told.ours and "by hand: straight down" in told.ours
    skills._pegs.cache_clear()
    assert list(asked) == ["valley", "peg_in_hole"]

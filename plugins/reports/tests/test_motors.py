"""The table of what motors were asked for: worst and typical trial, each with its joint."""

import math

import pytest
from skillframe_reports.results import read_results
from skillframe_reports.sources import Chapter
from skillframe_reports.trust import motors_table

from skillframe.execution.trace import SHARE_JOINTS, SHARES
from tests.report_fakes import COLUMNS, rows, write_csv

SKILL = "peg.skill.json"


def results(tmp_path, given):
    """Shares of torque by trial of one skill, with a joint each; nothing is known of speed and range."""
    cells = {trial: (share, math.nan, math.nan, joint, "", "") for trial, (share, joint) in enumerate(given)}
    table = [[*row, *cells[row[0]]] for row in rows(len(given)) if row[1] == SKILL]
    write_csv(tmp_path / "results.csv", table, [*COLUMNS, *SHARES, *SHARE_JOINTS])
    return read_results(tmp_path / "results.csv")


def cells(markup):
    return [part.split("<")[0] for part in str(markup).split("<td")[1:] for part in [part.split(">", 1)[1]]]


def test_the_worst_and_the_median_trial_are_named_with_their_joints(tmp_path):
    given = [(0.2, "joint1"), (0.9, "joint2"), (0.3, "joint3"), (0.4, "joint4"), (0.1, "joint5")]
    drawn = motors_table(Chapter(name="c"), results(tmp_path, given))
    assert cells(drawn) == ["torque", SKILL, "90 %", "joint2", "1", "30 %", "joint3", "2"]


def test_of_an_even_number_the_lower_middle_trial_is_the_typical_one(tmp_path):
    drawn = motors_table(Chapter(name="c"), results(tmp_path, [(0.4, "a"), (0.1, "b"), (0.3, "c"), (0.2, "d")]))
    assert cells(drawn)[-3:] == ["20 %", "d", "3"]


@pytest.mark.parametrize("notes", [[], ["the URDF gives no range for elbow"]])
def test_without_shares_only_what_the_urdf_leaves_out_is_said(tmp_path, notes):
    drawn = motors_table(Chapter(name="c", scene={"notes": notes}), results(tmp_path, [(math.nan, "")]))
    assert not cells(drawn)
    assert ("The URDF gives no range for elbow." in str(drawn)) == bool(notes)
    assert bool(str(drawn)) == bool(notes)

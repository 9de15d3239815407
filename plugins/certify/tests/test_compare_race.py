"""The table of a race in `skillframe compare`: who was left out is marked, and its rows are not missing."""

import re

from click.testing import CliRunner
from skillframe_certify.commands.compare import command
from skillframe_certify.compare import compare
from skillframe_certify.trials import read_trials

from tests.unit.campaign.campaign_fakes import run
from tests.unit.campaign.test_race import folder_of, race_folder, reach

__all__ = ["folder_of", "race_folder"]


def test_compare_marks_a_skill_that_was_left_out(race_folder):
    n = run(race_folder, reach, traces=0)["skills"]["replay:demo.npz"]["left_out_after"]
    said = CliRunner().invoke(command, [str(race_folder / "results.csv")]).output
    assert re.search(rf"replay:demo.npz +{n}, left out", said)
    assert f"was left out of the race after {n} trials" in said


def test_compare_says_the_same_of_a_races_table_and_does_not_call_its_rows_missing(race_folder):
    run(race_folder, reach, traces=0)
    trials = read_trials(race_folder / "results.csv")
    assert trials.doubts == ()
    assert {pair.better for pair in compare(trials).pairs if "a.skill.json" in (pair.first, pair.second)} == {
        "a.skill.json"
    }

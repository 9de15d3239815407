"""What is said of a campaign that has not ended, of several skills, and of rows that ended out of order."""

import json

import numpy as np
import pytest
from campaign_fakes import TEXT, FakeParams, edit_rows, good, run, start, write_campaign
from skillframe_worlds.peg_in_hole import PegParams

from skillframe.campaign import evaluate
from skillframe.campaign.folder import prepare
from skillframe.campaign.partial_results import status_of
from skillframe.campaign.runner import Options, run_campaign
from skillframe.campaign.spec import CampaignSpec
from skillframe.campaign.summary import comparisons, read_summary
from skillframe.cli.campaign_words import show_rates
from skillframe.cli.main import run as command

GRID = '"world.clearance" = {{ grid = {{ from = 0.0001, to = 0.001, count = 12 }} }}'
PEG = TEXT.replace('"fake"\nskills', '"peg_in_hole"\nskills').replace("{extra}", GRID)


def interrupt(folder, params=FakeParams, after=24):
    def look(progress):
        if progress.done >= after:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_campaign(folder, good, Options(chunk=6), look, params)


@pytest.fixture
def part_of_a_grid(tmp_path):
    """An interrupted campaign over a grid, 24 of 96 runs."""
    spec = CampaignSpec.from_toml(write_campaign(tmp_path, trials=48, text=PEG), PegParams)
    prepare(spec, tmp_path / "out", lambda spec: {}, PegParams)
    interrupt(tmp_path / "out", PegParams)
    return tmp_path / "out"


def test_status_and_summary_of_an_unfinished_grid_give_counts_and_no_interval(part_of_a_grid):
    for shown in (status_of(part_of_a_grid, PegParams), read_summary(part_of_a_grid)):
        assert not shown["complete"]
        for figures in shown["skills"].values():
            assert (figures["trials"], figures["interval_95"]) == (12, None)
            assert "grid and values axes run in order" in figures["method"]
        (pair,) = shown["comparisons"]
        assert (pair["trials"], pair["p_value"]) == (12, None)


def test_the_status_command_says_in_words_why_there_is_no_interval(part_of_a_grid, capsys):
    assert command(["campaign", "status", str(part_of_a_grid)]) == 0
    said = capsys.readouterr().out
    assert "no interval: grid and values axes run in order" in said
    assert " .. " not in said
    assert command(["campaign", "status", str(part_of_a_grid), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["skills"]["a.skill.json"]["interval_95"] is None


def test_a_grid_that_has_run_to_its_end_has_its_interval_again(part_of_a_grid):
    summary = run_campaign(part_of_a_grid, good, None, None, PegParams)
    figures = summary["skills"]["a.skill.json"]
    assert (figures["trials"], figures["method"][:15]) == (48, "Clopper-Pearson")
    assert figures["interval_95"][0] < figures["rate"] < figures["interval_95"][1]


def out_of_order(folder, keep):
    """An interrupted campaign that has the rows of some trials only: (label, trial) decides."""
    run(folder, traces=0)
    edit_rows(folder, lambda records: [r for r in records if "trial" not in r or keep(r)])
    return status_of(folder, FakeParams)


def test_rows_after_the_first_missing_trial_are_not_counted(campaign, tmp_path):
    """Failures that take longer are not there yet: what is there is all success, and says nothing of the rate."""
    folder = start(campaign(trials=128), tmp_path / "out")
    status = out_of_order(folder, lambda row: row["success"])
    whole = {label: [] for label in status["skills"]}
    for row in load_rows(campaign_table(folder)):
        whole[row[1]].append(row)
    for label, figures in status["skills"].items():
        first = next(i for i, row in enumerate(whole[label]) if row[6] == "0")
        assert figures["trials"] == figures["successes"] == first
        assert figures["uncounted"] == sum(row[6] == "1" for row in whole[label]) - first
        truth = np.mean([row[6] == "1" for row in whole[label]])
        assert figures["interval_95"][0] <= truth <= figures["interval_95"][1]


def campaign_table(folder):
    return (folder / "results.csv").read_text()


def load_rows(text):
    return [line.split(",") for line in text.splitlines()[1:]]


def test_skills_are_compared_on_the_trials_that_both_have_without_a_gap(campaign, tmp_path):
    folder = start(campaign(trials=60), tmp_path / "out")
    status = out_of_order(folder, lambda row: row["trial"] < (20 if row["skill"] == "a.skill.json" else 45))
    assert [figures["trials"] for figures in status["skills"].values()] == [20, 45]
    assert status["comparisons"][0]["trials"] == 20


def test_no_more_than_one_in_twenty_campaigns_of_four_equal_skills_finds_a_difference():
    """Six single tests at 0.05 find one in about one in five."""
    spec = CampaignSpec(
        name="n", seed=1, trials=200, robot="r", world="w", skills=("a.json", "b.json", "c.json", "d.json")
    )
    labels, found, single = spec.labels, 0, 0
    for seed in range(200):
        wins = np.random.default_rng(seed).random((4, 200)) < 0.8
        rows = [
            {"trial": t, "skill": labels[k], "success": bool(wins[k, t]), "failure": ""}
            for t in range(200) for k in range(4)
        ]  # fmt: skip
        pairs = comparisons(spec, rows, complete=True)
        found += any(pair["p_value"] < 0.05 for pair in pairs)
        single += any(pair.get("p_value_uncorrected", pair["p_value"]) < 0.05 for pair in pairs)
    assert found <= 19  # the 99.9 % quantile of 200 campaigns at 0.05
    assert single > 19
    assert {pair["correction"] for pair in pairs} == {"Holm over 6 pairs"}


def test_two_skills_are_one_pair_and_need_no_correction(campaign, tmp_path):
    folder = start(campaign(trials=48), tmp_path / "out")
    (pair,) = run(folder)["comparisons"]
    assert pair["p_value"] == pair["p_value_uncorrected"]
    assert pair["correction"] == "none, there is one pair"


def resumed(tmp_path, monkeypatch, text, trials):
    """The exit code of `campaign resume` on a campaign with fake trials."""
    monkeypatch.setattr(evaluate, "evaluate", good)
    (tmp_path / "b.skill.json").write_text("{}")
    spec = CampaignSpec.from_toml(write_campaign(tmp_path, trials=trials, text=text), PegParams)
    prepare(spec, tmp_path / "out", lambda spec: {}, PegParams)
    return command(["campaign", "resume", str(tmp_path / "out"), "--traces", "0"])


def test_it_is_said_before_the_first_trial_that_a_grid_run_unevenly_will_have_no_interval(
    tmp_path, monkeypatch, capsys
):
    assert resumed(tmp_path, monkeypatch, PEG, 50) == 0
    said = capsys.readouterr()
    why = "no interval: 50 trials do not cover the grid's 12 cells equally often; make trials a multiple of 12"
    assert said.err.startswith(f"there will be {why}")
    assert why in said.out
    assert "p =" not in said.out


def test_the_command_says_for_how_many_pairs_a_p_value_is_corrected(tmp_path, monkeypatch, capsys):
    three = PEG.replace(GRID, "").replace('["a.skill.json",', '["a.skill.json", "b.skill.json",')
    assert resumed(tmp_path, monkeypatch, three, 60) == 0
    said = capsys.readouterr().out
    assert said.count(" (Holm over 3 pairs), McNemar (exact") == 3
    assert "  intervals, each 95 % by itself: Clopper-Pearson (exact" in said


def half_of_them_go_on(job):
    """Succeeds as `good` does; the skill of an odd trial has not ended by itself."""
    return [row | {"goal_reached": row["success"], "ended_itself": row["trial"] % 2 == 0} for row in good(job)]


def test_successes_whose_skill_had_not_ended_by_itself_are_counted_and_said(campaign, tmp_path, capsys):
    folder = start(campaign(trials=32), tmp_path / "out")
    skills = run(folder, half_of_them_go_on)["skills"]
    for label, figures in skills.items():
        odd = [row for row in load_rows(campaign_table(folder)) if row[1] == label and int(row[0]) % 2]
        assert figures["unended"] == sum(row[6] == "1" for row in odd) > 0
    show_rates(skills)
    said = f"{skills['a.skill.json']['unended']} of its successes had reached the goal, but not ended by themselves"
    assert said in capsys.readouterr().out
    assert run(start(campaign(trials=8), tmp_path / "old"))["skills"]["a.skill.json"]["unended"] == 0  # rows of 0.1

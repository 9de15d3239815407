"""A start inside something in campaigns: neither success nor failure, counted apart, in no rate and no interval."""

import csv
import json
import math
from dataclasses import replace

import pytest
from skillframe_reports.results import read_results

from skillframe.campaign.partial_results import status_of
from skillframe.campaign.race import StopRule
from skillframe.campaign.rows import refused
from skillframe.campaign.statistics import clopper_pearson
from skillframe.campaign.summary import below_bar, read_summary, refused_text
from tests.unit.campaign.campaign_fakes import FakeParams, good, run, start, write_campaign

WHY = "begins inside something: the tool is 1 mm inside the fixture"


def some_inside(job):
    """Every fifth trial begins inside the fixture."""
    return [
        refused(row | {"success": False, "failure": WHY, "ended_by": "start"}) if row["trial"] % 5 == 0 else
        row | {"ended_by": "skill"} for row in good(job)
    ]  # fmt: skip


@pytest.fixture
def folder(tmp_path):
    out = start(write_campaign(tmp_path / "in", trials=50), tmp_path / "out")
    run(out, some_inside)
    return out


def test_a_refused_start_is_in_no_rate_and_no_interval_and_its_number_stands_beside(folder):
    figures = read_summary(folder)["skills"]["a.skill.json"]
    with (folder / "results.csv").open() as file:
        rows = [row for row in csv.DictReader(file) if row["skill"] == "a.skill.json"]
    won = sum(row["success"] == "1" for row in rows)
    assert (figures["trials"], figures["refused"], figures["successes"]) == (40, 10, won)
    assert figures["interval_95"] == list(clopper_pearson(won, 40))
    assert figures["ended_by"] == {"skill": 40}
    assert WHY not in figures["failures"]
    assert figures["uncounted"] == 0
    assert read_summary(folder)["comparisons"][0]["trials"] == 40


def test_the_table_says_of_a_refused_start_neither_success_nor_failure(folder):
    with (folder / "results.csv").open() as file:
        gone = [row for row in csv.DictReader(file) if row["ended_by"] == "start"]
    assert len(gone) == 20
    for row in gone:
        assert row["success"] == ""
        assert row["failure"] == WHY
        assert math.isnan(float(row["peak_force_n"]))


def test_status_terminal_and_report_say_how_many_starts_were_refused(folder, capsys):
    from skillframe.cli.campaign_words import show_rates

    assert status_of(folder, FakeParams)["skills"]["a.skill.json"]["refused"] == 10
    show_rates(read_summary(folder)["skills"])
    said = capsys.readouterr().out
    assert "a.skill.json: 10 of 50 starts (20.0%) are refused and count neither as successes nor as failures" in said
    assert f"The first: trial 0 {WHY}" in said
    results = read_results(folder / "results.csv")
    assert results.rate("a.skill.json").trials == 40
    assert ", 10 starts inside something refused" in results.mark("a.skill.json")
    assert any("20 of 80 starts" in text or "20 of 100 starts" in text for text in results.notes)
    assert all(WHY not in cause for cause, _ in results.causes("a.skill.json"))


def test_a_campaign_whose_starts_are_all_inside_reaches_no_threshold(tmp_path):
    out = start(write_campaign(tmp_path / "in", trials=8, extra="[expect]\nrate = 0.5"), tmp_path / "out")
    summary = run(out, lambda job: [refused(row | {"success": False, "failure": WHY, "ended_by": "start"})
                                    for row in good(job)])  # fmt: skip
    from skillframe.campaign.folder import load

    assert below_bar(load(out, FakeParams), summary) == "a.skill.json: no trial, for all 8 starts are inside something"
    assert summary["skills"]["a.skill.json"]["rate"] is None
    assert refused_text({"refused": 0, "trials": 3}) == ""


def test_a_campaign_stops_early_by_the_trials_alone(tmp_path):
    """Of 200 rows half are refused: the width is that of 100 trials."""
    from skillframe.campaign.folder import load
    from skillframe.campaign.statistics import confidence_sequence

    width = confidence_sequence(60, 60).width
    extra = f"[stop]\ninterval_width = {width + 1e-9}"
    spec = load(start(write_campaign(tmp_path / "in", trials=500, extra=extra), tmp_path / "out"), FakeParams)
    rule = StopRule(replace(spec, skills=spec.skills[:1]))
    label = spec.labels[0]
    rule.add({"trial": t, "skill": label, "success": t % 2 == 1, "ended_by": "skill" if t % 2 else "start"}
             for t in range(500))  # fmt: skip
    assert rule.after == 119


@pytest.mark.needs_plugins
def test_a_campaign_in_a_real_world_counts_its_starts_inside_apart(tmp_path):
    from skillframe_testkit.checks.examples import example_demonstrations

    from skillframe import Campaign
    from skillframe.campaign.evaluate import starts
    from skillframe.extend.reading import write_demonstration

    write_demonstration(example_demonstrations()[0], tmp_path / "d.npz")
    campaign = Campaign(
        world="peg_in_hole", robot="free_tool", skills=[f"lmc:{tmp_path / 'd.npz'}"], trials=4, duration_s=0.1, seed=1,
        vary={"fixture.offset_z": {"values": [0.0, 0.00105, 0.002, 0.004]}}, set={"fixture.offset_x": 0.02},
    )  # fmt: skip
    results = campaign.run(tmp_path / "out")
    (rate,) = results.skills.values()
    assert (rate.trials, rate.refused) == (2, 2)
    assert len(results.table()["trial"]) == 2
    assert [row["failure"].partition(": ")[2] for row in results.rows[2:]] == [
        "the tool is 1 mm inside the fixture", "the tool is 3 mm inside the fixture",
    ]  # fmt: skip
    told = starts(results.spec)
    assert [bool(text) for text in told] == [False, False, True, True]
    assert json.loads((tmp_path / "out" / "summary.json").read_text())["skills"]

import csv

import pytest
from skillframe_reports.results import read_results

from skillframe.campaign.statistics import Basis, Plan
from skillframe.errors import InputError
from tests.report_fakes import COLUMNS, rows, write_csv

VARIED = ["fixture.tilt_y", "fixture.offset_x"]


@pytest.fixture
def table(tmp_path):
    write_csv(tmp_path / "results.csv", rows(40))
    return tmp_path / "results.csv"


def test_rates_pairs_and_causes_are_counted_from_the_rows(table):
    results = read_results(table, VARIED, Plan(trials=40, skills=2))
    with table.open(encoding="utf-8") as file:
        raw = list(csv.DictReader(file))
    for skill in results.skills:
        wins = sum(r["success"] == "1" for r in raw if r["skill"] == skill)
        assert results.rate(skill)[:2] == (wins, 40)
        assert sum(len(trials) for _, trials in results.causes(skill)) == 40 - wins
    assert sum(results.pairs(*results.skills)) == 40


def test_what_varied_is_found_without_the_campaign_file(table):
    assert read_results(table).varied == tuple(VARIED)


def test_a_complete_fixed_plan_gets_the_exact_interval_and_any_other_the_wider_one(table):
    skill = "peg.skill.json"
    exact = read_results(table, VARIED, Plan(trials=40, skills=2))
    early = read_results(table, VARIED, Plan(trials=40, skills=2, may_stop=True))
    cut = read_results(table, VARIED, Plan(trials=100, skills=2))
    assert [r.validity.basis for r in (exact, early, cut)] == [Basis.FIXED, Basis.EVERY_LOOK, Basis.EVERY_LOOK]
    narrow, wide = exact.rate(skill).interval, early.rate(skill).interval
    assert wide.low < narrow.low < narrow.high < wide.high
    assert cut.rate(skill).interval == wide


def test_a_last_row_cut_short_by_a_kill_is_left_out_and_said(table):
    whole = table.read_text(encoding="utf-8")
    table.write_text(whole + "40,peg.skill.json,7,0.1", encoding="utf-8")
    results = read_results(table, VARIED)
    assert len(results.rows) == 80
    assert "cut short" in results.notes[0]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda text: text.replace("success", "worked"), "no column success"),
        (lambda text: text.replace("peg.skill.json,7", "peg.skill.json", 1), "row 2"),
        (lambda text: text.replace("\n0,", "\nzero,", 1), "trial"),
        (lambda text: "", "no column"),
    ],
)
def test_a_table_that_cannot_be_read_is_refused_with_the_place(table, change, said):
    table.write_text(change(table.read_text(encoding="utf-8")), encoding="utf-8")
    with pytest.raises(InputError, match=said):
        read_results(table, VARIED)


def test_a_success_that_is_neither_yes_nor_no_is_refused(tmp_path):
    write_csv(tmp_path / "results.csv", [[0, "a", 1, 0.1, 0.2, "maybe", "", 1.0, 1.0, 0.0, 0.0]], COLUMNS)
    with pytest.raises(InputError, match="row 2: success"):
        read_results(tmp_path / "results.csv")

"""One definition of a peak, in every table and command."""

import csv
import re

import pytest
from skillframe_reports.markup import number
from skillframe_reports.page import render
from skillframe_reports.sources import read_chapters

from tests.report_fakes import COLUMNS, rows, trace, write_csv
from tests.report_fakes import campaign as full_campaign

MORE = ["peak_force_10ms_n", "peak_force_filtered_n"]


def page_of(folder):
    table = [
        [*row, 0.8 * row[COLUMNS.index("peak_force_n")], 0.7 * row[COLUMNS.index("peak_force_n")]] for row in rows()
    ]
    write_csv(folder / "results.csv", table, [*COLUMNS, *MORE])
    return re.sub(r"\s+", " ", re.sub(r"<[^>]+>", " ", render(read_chapters([folder]))))


@pytest.mark.slow
def test_every_peak_on_a_page_is_the_simulator_s_of_one_tick(tmp_path):
    folder = full_campaign(tmp_path / "peg")
    for path in (folder / "traces").glob("*"):
        path.unlink()
    forces = {"peak_force_n": 21.5, "peak_force_10ms_n": 20.5, "peak_force_filtered_n": 19.5}
    trace(samples=20, trial=3, **forces).save(folder / "traces" / "a.npz")
    text = page_of(folder)
    assert "A peak is the largest contact force of one control tick in simulation." in text
    assert "peak contact force in simulation 21.5 N, over 10 ms 20.5 N, by the estimate 19.5 N" in text
    assert len(re.findall(r"medians: peak contact force in simulation [\d.]+ N, duration", text)) == 2
    with (folder / "results.csv").open(encoding="utf-8") as file:
        top = max(float(row["peak_force_n"]) for row in csv.DictReader(file))
    shown = [number(share * top) for share in (1.0, 0.8, 0.7)]
    assert "highest {} N (over 10 ms {} N, by the estimate {} N)".format(*shown) in text
    for what in re.findall(r"peak [a-z ]*force[a-z ]{0,20}", text.lower().partition("how this was made")[0]):
        assert "in simulation" in what, what

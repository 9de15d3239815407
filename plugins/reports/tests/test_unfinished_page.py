"""What a page shows of a campaign that has not ended, and of several skills."""

import re
import shutil

import numpy as np
import pytest
from skillframe_reports.page import write_report

from tests.report_fakes import COLUMNS, rows, write_csv
from tests.report_fakes import campaign as full_campaign

GRID = """
"fixture.tilt_y" = { grid = { from = -0.3, to = 0.3, count = 6 } }
"fixture.offset_x" = { grid = { from = -0.004, to = 0.004, count = 20 } }
"""
WHY = "grid and values axes run in order"
SPAN = re.compile(r'class="span"')


def campaign(folder):
    """Without traces and recordings, which take most of a page's time."""
    full_campaign(folder)
    shutil.rmtree(folder / "traces")
    return folder


def page(folder, change=lambda text: text):
    spec = folder / "campaign.toml"
    spec.write_text(change(spec.read_text(encoding="utf-8")), encoding="utf-8")
    write_report([folder], folder.with_suffix(".html"))
    return folder.with_suffix(".html").read_text(encoding="utf-8")


def on_a_grid(text):
    return text.partition("[vary]")[0] + "[vary]" + GRID


def grid_rows(trials, skills=("peg.skill.json", "replay:demo1.npz")):
    tilts, offsets = np.linspace(-0.3, 0.3, 6), np.linspace(-0.004, 0.004, 20)
    table = []
    for t in range(trials):
        tilt, offset = tilts[t // 20 % 6], offsets[t % 20]
        table += [[t, s, 7, tilt, offset, int(abs(offset) < 0.003), "stuck", 3.0, 9.0, 0.0, 0.0] for s in skills]
    return table


def test_a_page_of_an_unfinished_grid_has_counts_no_interval_and_the_reason(tmp_path):
    folder = campaign(tmp_path / "c")
    write_csv(folder / "results.csv", grid_rows(70), COLUMNS)
    text = page(folder, on_a_grid)
    assert "There are no intervals and no p-values: " + WHY in text
    assert "Cells and points are counts without an interval" in text
    assert not SPAN.search(text)
    assert "confidence interval" not in text
    assert "whisker" not in text.partition("<body>")[2].replace("page.css", "")
    assert re.search(r"<td[^>]*>none</td>", text)


def test_a_page_of_the_whole_grid_has_exact_intervals_in_the_map_too(tmp_path):
    folder = campaign(tmp_path / "c")
    write_csv(folder / "results.csv", grid_rows(120), COLUMNS)
    text = page(folder, on_a_grid)
    assert "95 % confidence interval (Clopper-Pearson)" in text
    assert SPAN.search(text)
    assert WHY not in text


def test_cells_of_an_unfinished_campaign_have_the_interval_that_holds_at_every_look(tmp_path):
    folder = campaign(tmp_path / "c")
    write_csv(folder / "results.csv", rows(60), COLUMNS)
    text = page(folder)
    tips = re.findall(r"<title>(\d+) of (\d+), ([^<]*)</title></rect>", text)
    assert tips
    assert all(re.fullmatch(r"95 % confidence interval .* % \(valid at every look\)", kind) for _, _, kind in tips)


def test_a_page_says_that_the_cells_intervals_are_not_corrected_for_their_number(tmp_path):
    said = "Each of these intervals is 95 % by itself, without correction for their number"
    assert said in page(campaign(tmp_path / "c"))


def test_rows_that_ended_out_of_order_are_left_out_and_counted_on_the_page(tmp_path):
    folder = campaign(tmp_path / "c")
    kept = [row for row in rows(120) if row[0] < 40 or row[5] == 1]
    write_csv(folder / "results.csv", kept, COLUMNS)
    reach = {s: next(t for t in range(121) if [t, s] not in [r[:2] for r in kept]) for s in (kept[0][1], kept[1][1])}
    text = page(folder)
    beyond = sum(row[0] >= reach[row[1]] for row in kept)
    assert beyond > 0
    assert f"{beyond} finished runs are not counted: trials before them are missing" in text
    assert f" of {reach['peg.skill.json']} trials succeeded" in text


@pytest.mark.parametrize(("skills", "said"), [(2, "p: chance"), (4, "p, Holm over 6 pairs: chance")])
def test_p_values_of_several_pairs_are_corrected_and_it_is_said(tmp_path, skills, said):
    folder, names = campaign(tmp_path / "c"), [f"{name}.skill.json" for name in "abcd"[:skills]]
    rng = np.random.default_rng(1)
    table = [
        [t, s, 7, 0.1 * t, 0.2 * t, int(rng.random() < 0.7), "stuck", 3.0, 9.0, 0.0, 0.0]
        for t in range(120) for s in names
    ]  # fmt: skip
    write_csv(folder / "results.csv", table, COLUMNS)
    text = page(folder, lambda spec: spec.replace('"peg.skill.json", "replay:demo1.npz"', str(names)[1:-1]))
    assert said in text


def test_without_a_campaign_file_the_intervals_say_what_they_assume(tmp_path):
    folder = campaign(tmp_path / "c")
    (folder / "campaign.toml").unlink()
    said = "The intervals hold if the trials are independent and their number was fixed beforehand."
    assert page_of(folder).count(said) == 1


def page_of(folder):
    write_report([folder], folder.with_suffix(".html"))
    return folder.with_suffix(".html").read_text(encoding="utf-8")


def test_a_skill_whose_first_trial_is_missing_is_on_the_page_with_no_trials(tmp_path):
    folder = campaign(tmp_path / "c")
    kept = [row for row in rows(30) if (row[0], row[1]) != (0, "replay:demo1.npz")]
    write_csv(folder / "results.csv", kept, COLUMNS)
    text = page(folder)
    assert "29 finished runs are not counted" in text
    assert "0 of 0" in text
    assert not re.search(r"\bnan\b", text.partition("<main>")[2].partition("<footer>")[0])

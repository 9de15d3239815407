"""A page that follows a campaign while it runs."""

import json

import pytest
from skillframe_reports.page import write_report
from skillframe_reports.sources import read_chapters
from skillframe_reports.watch import watch_report

from skillframe.campaign.folder import FolderLock
from skillframe.campaign.partial_results import has_ended, live_table
from skillframe.campaign.summary import read_summary
from skillframe.cli.main import run as typed
from tests.report_fakes import campaign as full_campaign
from tests.unit.campaign.campaign_fakes import run, start, write_campaign

REFRESH = '<meta http-equiv="refresh"'


@pytest.fixture
def folder(tmp_path):
    """A fake campaign of 48 trials of two skills that is ready to run."""
    return start(write_campaign(tmp_path / "plan", trials=48), tmp_path / "out")


def half(folder):
    """Run it, then leave what a kill in its middle leaves: rows that are torn, no tables."""
    run(folder, chunk=8, traces=0)
    whole = (folder / "rows.jsonl").read_bytes()
    lines = whole.splitlines(keepends=True)
    (folder / "rows.jsonl").write_bytes(b"".join(lines[: len(lines) // 2]) + lines[len(lines) // 2][:20])
    (folder / "results.csv").unlink()
    (folder / "summary.json").unlink()
    return whole


def test_the_rows_of_a_campaign_that_has_not_ended_give_counts_up_to_the_first_gap(folder):
    half(folder)
    (chapter,) = read_chapters([folder])
    counted = chapter.results
    assert 0 < len(counted.rows) < chapter.planned == 96
    assert not counted.complete
    assert counted.skills == ("a.skill.json", "replay:demo.npz")


def test_the_stored_rows_give_the_table_that_the_campaign_writes_in_the_end(folder):
    run(folder, traces=0)
    written = read_chapters([folder])[0].results
    assert live_table(folder, []) is None
    with FolderLock(folder):
        assert live_table(folder, []) is not None
        stored = read_chapters([folder])[0].results
    outcome = [(r.trial, r.skill, r.success, r.failure) for r in written.rows]
    assert [(r.trial, r.skill, r.success, r.failure) for r in stored.rows] == outcome
    names = written.rows[0].values.keys() & stored.rows[0].values.keys()
    assert {"duration_s", "peak_force_n", "start.tilt_y"} <= names
    assert all(
        repr(a.values[n]) == repr(b.values[n]) for a, b in zip(written.rows, stored.rows, strict=True) for n in names
    )


def test_the_page_follows_the_rows_loads_itself_again_and_no_longer_when_all_has_ended(folder, tmp_path):
    whole = half(folder)
    page, pages, said = tmp_path / "page.html", [], []

    def sleep(seconds):
        assert seconds >= 1.0
        pages.append(page.read_text(encoding="utf-8"))
        if len(pages) == 2:  # more rows have come
            (folder / "rows.jsonl").write_bytes(b"".join(whole.splitlines(keepends=True)[:-20]))
        if len(pages) == 4:  # the rest
            run(folder, traces=0)

    watch_report([folder], page, said.append, sleep)
    counts = [text for text in said if "runs counted" in text]
    assert len(pages) == 4
    assert len(counts) == 2, "a page is made when rows have come, and only then"
    assert all(REFRESH in text and "has not ended" in text for text in pages)
    assert pages[0] == pages[1] != pages[2]
    assert sum("nobody runs it now" in text for text in said) == 1
    write_report([folder], page)
    assert REFRESH not in page.read_text(encoding="utf-8")


def test_an_ended_campaign_and_a_folder_without_rows_are_not_waited_for(folder, tmp_path):
    assert not has_ended(folder)
    run(folder, traces=0)
    assert has_ended(folder)
    with FolderLock(folder):
        assert not has_ended(folder)
    made = full_campaign(tmp_path / "by hand")
    assert has_ended(made)


def test_a_campaign_that_was_interrupted_is_waited_for(folder):
    run(folder, traces=0)
    summary = read_summary(folder)
    (folder / "summary.json").write_text(json.dumps({**summary, "complete": False}))
    assert not has_ended(folder)


def test_ctrl_c_stops_watching_in_a_sentence_and_leaves_a_page_that_stands_still(folder, tmp_path, monkeypatch, capsys):
    half(folder)

    def sleep(seconds):
        raise KeyboardInterrupt

    monkeypatch.setattr(watch_report, "__defaults__", (sleep,))
    page = tmp_path / "page.html"
    assert typed(["report", str(folder), "--out", str(page), "--watch"]) == 130
    said = capsys.readouterr()
    assert "stopped watching" in said.err
    assert "Traceback" not in said.err
    assert REFRESH not in page.read_text(encoding="utf-8")


def test_rows_are_read_though_their_world_is_registered_nowhere(folder):
    half(folder)
    assert "fake" in (folder / "campaign.toml").read_text()
    assert read_chapters([folder])[0].results.rows

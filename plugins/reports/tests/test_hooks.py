"""What the distribution registers: sections in their order, and outputs that are written."""

import pytest
from skillframe_reports.page import Page, render, sections_of
from skillframe_reports.sources import read_chapters

from skillframe.extend import Moment, SectionType, no_progress
from skillframe.extend.homes import homes
from skillframe.extend.registry import Plugin, load_registry, registry
from tests.report_fakes import campaign, trace

OWN = ["verdict", "learned", "demonstrations", "run", "works", "made"]


@pytest.fixture(autouse=True)
def small_stills(monkeypatch):
    """The stills' size is no matter here, their cost is."""
    monkeypatch.setattr("skillframe_reports.runs.STILL_WIDTH", 56)
    monkeypatch.setattr("skillframe_reports.runs.STILL_HEIGHT", 42)


@pytest.fixture(scope="module")
def chapter(tmp_path_factory):
    """A campaign without traces, which is quick."""
    folder = campaign(tmp_path_factory.mktemp("report") / "peg")
    for path in (folder / "traces").glob("*"):
        path.unlink()
    return read_chapters([folder])[0]


def names(chapter):
    return [section.name for section in sections_of(Page(chapter, "c1", {}))]


def test_a_campaign_has_every_section_and_a_trace_alone_has_two(chapter, tmp_path):
    assert names(chapter) == OWN
    trace(samples=5).save(tmp_path / "a.npz")
    assert names(read_chapters([tmp_path / "a.npz"])[0]) == ["run", "made"]


def test_a_section_that_draws_stands_by_its_order_and_is_left_out_where_it_draws_nothing(chapter, monkeypatch):
    known = load_registry()
    plugin = known.add(Plugin(name="own", distribution="dist-own", version="1.2"), lambda: object())
    for name, order, html in (("first", 5, "<em>1</em>"), ("between", 42, "<em>2</em>"), ("none", 1, "")):
        record = SectionType(name=name, summary="a section", title=name, order=order, draw=lambda page, html=html: html)
        known._keep("section", record, plugin)
    monkeypatch.setattr("skillframe_reports.page.registry", lambda: known)
    assert names(chapter) == ["first", *OWN[:4], "between", *OWN[4:]]
    text = render([chapter])
    assert '<section id="c1-between"><h2>between</h2><em>2</em></section>' in text
    assert text.index('href="#c1-first"') < text.index('href="#c1-verdict"')


def test_every_output_has_its_home_in_the_core_s_list():
    own = {name.partition(":")[2] for name, home in homes().items() if home == "reports" and name.startswith("output:")}
    mine = {n for n in registry().names("output") if registry().provider("output", n).name == "reports"}
    assert own == mine


@pytest.mark.parametrize(("output", "begins"), [("still", b"\x89PNG"), ("replay", b"<!DOCTYPE html>")])
@pytest.mark.slow
def test_an_output_of_a_trace_is_written(tmp_path, output, begins):
    given = trace(samples=5)
    subject = Moment(given, None, False) if output == "still" else given
    assert registry().output(output).write(subject, tmp_path / "a", no_progress) == ""
    assert (tmp_path / "a").read_bytes().startswith(begins)

"""Sections of plug-ins on the page: made from its files, escaped, and each for itself."""

import html
import re
import shutil

import pytest
from skillframe_reports.markup import Markup
from skillframe_reports.page import render, write_report
from skillframe_reports.parts import MOST_BYTES
from skillframe_reports.sources import read_chapters

from skillframe.cli.main import run
from skillframe.errors import UnknownName
from skillframe.extend import Grid, Illustration, ReportFiles, SectionType
from skillframe.extend.registry import Plugin, load_registry
from tests.report_fakes import campaign, trace

EVIL = "<script>alert('x')</script>\"'><img src=x onerror=alert(1)>"
DRAWING = f'<svg xmlns="http://www.w3.org/2000/svg"><script>alert(1)</script><text>{html.escape(EVIL)}</text></svg>'


class Sly(str):
    """Text that says that it is markup already, and stays so when it is made a text."""

    def __str__(self):
        return Markup(EVIL)


@pytest.fixture(autouse=True)
def small_stills(monkeypatch):
    """The stills' size is no matter here, their cost is."""
    monkeypatch.setattr("skillframe_reports.runs.STILL_WIDTH", 56)
    monkeypatch.setattr("skillframe_reports.runs.STILL_HEIGHT", 42)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """One trace of a campaign without geometry to draw, which is quick."""
    made = campaign(tmp_path_factory.mktemp("report") / "peg")
    shutil.rmtree(made / "traces")
    return made


@pytest.fixture
def page(folder, monkeypatch):
    """Makes the page of the folder with some sections registered: page(name=make, ...)."""

    def make(**sections):
        known = load_registry()
        plugin = known.add(Plugin(name="own", distribution="dist-own", version="1.2"), lambda: object())
        for name, factory in sections.items():
            title = f"Title of {name} <b>"
            known._keep("section", SectionType(name=name, summary="a section", title=title, make=factory), plugin)
        monkeypatch.setattr("skillframe_reports.parts.registry", lambda: known)
        return render(read_chapters([folder]))

    return make


def body(text, name):
    """What stands in a section of a plug-in."""
    return re.search(rf'<section id="c1-plugin-{name}">(.*?)</section>', text, re.DOTALL).group(1)


def test_text_tables_and_drawings_stand_under_the_title_and_before_how_it_was_made(page):
    text = page(own=lambda files: [
        f"of {files.title}", Grid(("skill", "force [N]"), [("a", 12.3456), ("b", float("nan"))], "two rows"),
        Illustration("A line", "drawn", '<svg xmlns="http://www.w3.org/2000/svg"/>'),
    ])  # fmt: skip
    made = body(text, "own")
    assert "<h2>Title of own &lt;b&gt;</h2><p>of peg, fixture tilted and moved</p>" in made
    assert '<td class="num">12.3</td>' in made and '<td class="num">–</td>' in made and "two rows" in made
    assert 'src="data:image/svg+xml;base64,' in made
    assert text.index("c1-plugin-own") < text.index('id="c1-made"')
    assert '<a href="#c1-plugin-own">Title of own &lt;b&gt;</a>' in text


@pytest.mark.parametrize("given", [EVIL, Markup(EVIL), Sly(EVIL)], ids=["text", "markup", "sly"])
def test_nothing_that_a_section_gives_is_taken_for_markup(page, given):
    made = page(
        own=lambda files: [given, Grid((given,), [(given,)], given), Illustration(given, given, DRAWING)]
    )  # fmt: skip
    mine = body(made, "own")
    assert "<script" not in mine and "<img src=x" not in mine and "onerror=alert(1)>" not in mine.replace("&gt;", "")
    assert mine.count(html.escape(EVIL)) == 7  # paragraph, head, cell, caption; title, alt and caption of the drawing
    assert DRAWING not in made


def fails(how):
    def make(files):
        yield "begun"
        how()

    return make


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (fails(lambda: 1 / 0), "ZeroDivisionError: division by zero"),
        (fails(lambda: exit(3)), "SystemExit: 3"),
        (lambda files: "one text", "it gave one text; give a list of parts"),
        (lambda files: None, "TypeError"),
        (lambda files: [b"bytes"], "it gave bytes, not text, Grid or Illustration"),
        (lambda files: [Grid(("a", "b"), [(1,)])], "a row of its table has 1 cells, and its head 2"),
        (lambda files: ["x" * (MOST_BYTES + 1)], "it is larger than 2 MB"),
        (lambda files: [files.path("../secret.txt")], "unknown file of the report"),
        (lambda files: [fails, EVIL], "it gave function"),
    ],
)
@pytest.mark.slow
def test_a_section_that_fails_is_named_and_costs_no_other_part_of_the_page(page, make, said):
    alone = page(whole=lambda files: ["whole"])
    text = page(bad=make, whole=lambda files: ["whole"])
    assert said in html.unescape(body(text, "bad"))
    assert "Section bad of dist-own 1.2 could not make this section" in body(text, "bad")
    without = text.replace(f'<section id="c1-plugin-bad">{body(text, "bad")}</section>', "")
    assert without.replace('<a href="#c1-plugin-bad">Title of bad &lt;b&gt;</a>', "") == alone


def test_half_a_surrogate_pair_does_not_cost_the_page(page):
    assert "broken ? word" in page(own=lambda files: ["broken \ud800 word"])


@pytest.mark.slow
def test_a_section_with_nothing_to_say_leaves_no_trace(page):
    assert page(own=lambda files: []) == page()


def test_what_a_section_prints_stays_out_of_stdout(page, capsys):
    page(own=lambda files: [str(print("hello"))])
    said = capsys.readouterr()
    assert said.out == "" and "hello" in said.err


def test_a_section_sees_the_files_of_the_folder_and_the_page_says_which_it_used(page, folder, tmp_path):
    (tmp_path / "secret.txt").write_text("secret")
    (folder / "notes.txt").write_text("own notes")
    (folder / "out.txt").symlink_to(tmp_path / "secret.txt")
    (folder / ".hidden").write_text("hidden")
    seen = []

    def make(files):
        seen.extend(files.names)
        return [files.path("notes.txt").read_text(), files.path("results.csv").read_text()[:5]]

    text = page(own=make)
    assert {"results.csv", "notes.txt", "skills/peg.skill.json"} <= set(seen)
    assert not {"out.txt", ".hidden"} & set(seen)
    assert "own notes" in body(text, "own")
    assert text.count("<td>notes.txt</td>") == 1 and text.count("<td>results.csv</td>") == 1
    assert "notes.txt" not in page()


@pytest.mark.slow
def test_a_run_s_trace_is_all_that_a_section_sees_of_it(tmp_path, monkeypatch):
    known, seen = load_registry(), []
    record = SectionType(
        name="own", summary="a section", title="Own", make=lambda files: seen.append(files.names) or []
    )
    known._keep("section", record, known.plugins[0])
    monkeypatch.setattr("skillframe_reports.parts.registry", lambda: known)
    (tmp_path / "other").mkdir()
    for path in (tmp_path / "a.npz", tmp_path / "other" / "a.npz"):
        trace(seed=3).save(path)
    write_report([tmp_path / "a.npz"], tmp_path / "page.html")
    assert seen == [["a.npz"]]
    write_report([tmp_path / "a.npz", tmp_path / "other" / "a.npz"], tmp_path / "page.html")
    assert seen[1] == sorted([str(tmp_path / "a.npz"), str(tmp_path / "other" / "a.npz")])


def test_a_file_that_is_not_there_is_refused_with_the_nearest_name(tmp_path):
    files = ReportFiles(title="x", files={"results.csv": tmp_path / "results.csv"})
    with pytest.raises(UnknownName, match=r"did you mean 'results\.csv'"):
        files.path("result.csv")
    assert files.used == []


def test_a_plugin_s_section_reaches_the_page_of_the_command(install, fresh_registry, folder, tmp_path, monkeypatch):
    install("own", """
        from skillframe import hookimpl
        from skillframe.extend import SectionType
        @hookimpl
        def skillframe_sections():
            yield SectionType(name="rows", summary="counts", title="Rows", make=count)
        def count(files):
            return [f"{len(files.path('results.csv').read_text().splitlines()) - 1} rows"]
    """)  # fmt: skip
    monkeypatch.setenv("SKILLFRAME_PLUGINS", "reports,own")
    assert run(["report", str(folder), "--out", str(tmp_path / "page.html")]) == 0
    assert "<p>240 rows</p>" in (tmp_path / "page.html").read_text()

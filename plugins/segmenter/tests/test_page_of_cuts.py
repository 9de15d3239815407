"""`segment --page`: the page's line, run again, is the same cut, and holds what was typed."""

import html
import json
import re
import shlex

import pytest

from skillframe.cli.main import run
from skillframe.extend.reading import write_demonstration
from tests.figures import quasistatic as made


@pytest.fixture
def recordings(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    names = ["one.npz", "the second.npz", "three.npz"]
    for name, each in zip(names, made.demonstrations("ls", 2), strict=True):
        write_demonstration(each.demonstration, tmp_path / name)
    return names


def line_of(page):
    return html.unescape(re.search(r'<code id="line">(.*?)</code>', page.read_text(encoding="utf-8"))[1])


def rows_of(page):
    return json.loads(re.search(r'id="cuts">(.*?)</script>', page.read_text(encoding="utf-8"), re.S)[1])["recordings"]


@pytest.mark.slow
def test_the_line_is_what_was_typed_without_the_boundaries_and_runs(recordings, tmp_path, capsys):
    typed = [*recordings, "--out", "p.json", "--page", "p.html", "--set", "merge_votes=0.7", "--set", "recoveries=0"]
    assert run(["segment", *typed, "--set-boundary", "2:1=1.5"]) == 0
    assert "p.html: open it in a browser" in capsys.readouterr().out
    line = shlex.split(line_of(tmp_path / "p.html"))
    assert sorted(line) == sorted(["skillframe", "segment", *typed])
    assert line[:5] == ["skillframe", "segment", *recordings]
    row = rows_of(tmp_path / "p.html")[1]
    assert (row["shown"], row["set"]) == ([1.5], [True])
    assert run(line[1:]) == 0
    again = rows_of(tmp_path / "p.html")
    assert [each["shown"] for each in again] == [
        each["boundaries"] for each in json.loads((tmp_path / "p.json").read_text())["demonstrations"]
    ]
    assert again[1]["shown"] == row["found"] == row["rest"]


def test_a_page_of_another_ending_is_refused_before_the_work(recordings, tmp_path, capsys):
    assert run(["segment", *recordings, "--out", "p.json", "--page", "p.png"]) == 2
    assert "let it end in .html" in capsys.readouterr().err
    assert not (tmp_path / "p.json").exists()


def test_a_boundary_that_leaves_too_short_a_phase_is_one_sentence_and_writes_nothing(recordings, tmp_path, capsys):
    assert run(["segment", *recordings, "--out", "p.json", "--page", "p.html", "--set-boundary", "1:1=0.1"]) == 2
    assert "one.npz: boundary 1 at 0.1 s leaves a phase of 0.1 s, and one needs 0.2 s" in capsys.readouterr().err
    assert not (tmp_path / "p.html").exists()

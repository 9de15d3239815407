"""What docs/how-to/campaign.md shows of reports is typed and run, in a folder that holds what it takes for granted."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

from skillframe.cli.main import run
from tests.report_fakes import campaign, trace

PAGE = (Path(__file__).resolve().parents[2] / "docs" / "how-to" / "campaign.md").read_text(encoding="utf-8")


def block(language: str) -> str:
    """The first block in a language of the page's part on reports."""
    return re.findall(rf"```{language}\n(.*?)```", PAGE.partition("## Make a report\n")[2], re.DOTALL)[0]


@pytest.fixture
def results(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folders and traces that the page names."""
    for name in ("peg", "valley"):
        campaign(tmp_path / "results" / name)
    trace().save(tmp_path / "run1.npz")
    trace(success=False).save(tmp_path / "run2.npz")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("skillframe_reports.runs.STILL_WIDTH", 56)  # the stills' size is no matter here, their cost is
    monkeypatch.setattr("skillframe_reports.runs.STILL_HEIGHT", 42)
    return tmp_path


@pytest.mark.slow
def test_the_commands_of_the_page_make_the_pages_that_they_name(results: Path) -> None:
    lines = [line.partition("#")[0] for line in block("").splitlines()]
    for line in lines:
        assert run(shlex.split(line)[1:]) == 0
    assert sorted(path.name for path in results.glob("*.html")) == ["both.html", "peg.html", "runs.html"]
    assert len(lines) == 3


@pytest.mark.slow
def test_the_python_of_the_page_writes_the_same_page_as_the_command(results: Path) -> None:
    exec(compile(block("python"), "campaign.md", "exec"), {})
    by_python = (results / "peg.html").read_bytes()
    (results / "peg.html").unlink()
    assert run(shlex.split(block("").splitlines()[0].partition("#")[0])[1:]) == 0
    assert (results / "peg.html").read_bytes() == by_python

"""What docs/how-to/seat.md composes is recorded, learned and run: a search completes the insertions that stall."""

import re
import shlex
from pathlib import Path

import pytest

from skillframe.cli.main import run

PAGE = (Path(__file__).resolve().parents[2] / "docs" / "how-to" / "seat.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```(\w*)\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL)


def typed(word):
    """The first command of the page that holds a word."""
    lines = [line for language, block in BLOCKS if not language for line in block.splitlines()]
    return shlex.split(next(line for line in lines if word in line))[1:]


@pytest.mark.slow
@pytest.mark.needs_plugins
@pytest.mark.figures
def test_the_search_of_the_page_mends_the_insertions_that_stall(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    record = ["record", "--world", "peg_in_hole", "--robot", "panda", "--count", "2", "--seed", "1"]
    assert run([*record, "--out", "peg.npz"]) == 0
    assert run(["learn", "peg1.npz", "peg2.npz", "--out", "peg.skill.json"]) == 0
    assert run(typed("--teacher blind")) == 0
    learn = [word for word in typed("--skill search") if word != "blind*.npz"]
    assert run([*learn, *(f"blind{i}.npz" for i in range(1, 6))]) == 0
    capsys.readouterr()
    exec(compile(next(code for language, code in BLOCKS if language == "python"), "seat.md", "exec"), {})
    over, *beside = capsys.readouterr().out.splitlines()
    assert over.startswith("True")
    assert "search" not in over
    assert len(beside) == 2
    assert all(line.startswith("True") and "recover: begins, as insert failed" in line for line in beside)

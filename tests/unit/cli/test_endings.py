"""A file to write that is called like another kind of file is refused before the work begins."""

import pytest

from skillframe.cli.main import run
from skillframe.cli.options import KINDS, PAGE, SKILL, TRACE

COMMANDS = {
    "run.csv": ["run", "peg.skill.json", "--world", "free", "--out"],
    "run.npz": ["run", "peg.skill.json", "--world", "free", "--replay"],
    "skill.npz": ["learn", "demo.npz", "--out"],
    "policy.csv": ["segment", "demo.npz", "--out"],
    "report.pdf": ["report", "results", "--out"],
    "page.json": ["show", "peg.skill.json", "--page"],
    "trial.html": ["campaign", "replay", "results", "3", "--out"],
}


NEED_REPORTS = {"run.npz", "report.pdf"}
NAMES = [pytest.param(n, marks=pytest.mark.needs_plugins) if n in NEED_REPORTS else n for n in COMMANDS]


@pytest.mark.parametrize("name", NAMES)
def test_the_ending_of_another_kind_is_refused_with_the_right_one(name, capsys, tmp_path):
    assert run([*COMMANDS[name], str(tmp_path / name)]) == 2
    said = capsys.readouterr().err
    assert name in said
    assert "let it end in ." in said
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("kind", [TRACE, SKILL, PAGE])
def test_every_ending_is_taken_that_is_right_or_means_nothing(kind, tmp_path):
    names = [*("file" + ending for ending in kind.endings), "file", "FILE" + kind.endings[0].upper(), "peg.v2"]
    assert [kind.convert(str(tmp_path / name), None, None).name for name in names] == names
    assert set(kind.endings) <= KINDS

"""What docs/tutorial/index.md shows up to its campaign is typed, and prints what the page says in words."""

import re
import shlex
import tomllib
from pathlib import Path

import pytest

from skillframe.cli.demo import PEG
from skillframe.cli.main import run

FOLDER = Path(__file__).resolve().parents[2] / "docs" / "tutorial"
PAGE = (FOLDER / "index.md").read_text(encoding="utf-8")
TYPED, PROVED = PAGE.split("## Prove")
BLOCKS = re.findall(r"^```(\w*)\n(.*?)^```$", TYPED, re.MULTILINE | re.DOTALL)
COMMANDS = [
    shlex.split(line)[1:]
    for language, block in BLOCKS
    if not language
    for line in block.replace("\\\n", " ").splitlines()
]
FIGURES = re.compile(r"-?\d+\.\d+(?:e-?\d+)?")  # the last digits of decimals differ from one processor to the next


def words(text):
    return " ".join(FIGURES.sub("#", text).split())


@pytest.mark.slow
@pytest.mark.needs_plugins
def test_the_commands_of_the_tutorial_print_what_it_shows(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert [run(command) for command in COMMANDS] == [0] * 6
    captured = capsys.readouterr()
    said = words(captured.err + captured.out)
    shown = [block for language, block in BLOCKS if language == "text"]
    quoted = [text for text in re.findall(r"^\| `([^`]+)` \|", TYPED, re.MULTILINE) if "..." not in text]
    assert (len(shown), len(quoted)) == (3, 5)
    lines = [*quoted, *(line for block in shown for line in block.splitlines())]
    assert not [line for line in lines if words(line) not in said]


@pytest.mark.slow
@pytest.mark.needs_plugins
def test_the_tilt_at_which_the_tutorial_fails_does_fail(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    tilt = re.search(r"[Ww]ith `--set (fixture\.tilt_y=[\d.]+)`", TYPED)[1]
    record, _, learn, _, attempt, _ = COMMANDS
    assert (run(record), run(learn)) == (0, 0)
    assert run([*attempt, "--set", tilt]) == 1
    assert "came to rest" in capsys.readouterr().out


def test_the_campaign_of_the_tutorial_is_that_of_the_demo():
    shown = tomllib.loads(re.search(r"^```toml\n(.*?)^```", PROVED, re.MULTILINE | re.DOTALL)[1])
    assert shown == tomllib.loads((FOLDER / "peg.toml").read_text(encoding="utf-8"))
    demo = tomllib.loads(PEG.format(trials=96, robot="panda", rate=0.9))
    for campaign in (shown, demo):  # the demo draws its ranges independently, since it requires a rate
        campaign["vary"] = {name: next(iter(axis.values())) for name, axis in campaign["vary"].items()}
    assert {**shown, "skills": None, "expect": {"rate": 0.9}} == {**demo, "skills": None}

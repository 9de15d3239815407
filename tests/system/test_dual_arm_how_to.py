"""What docs/how-to/dual-arm.md shows is typed and run, from the two demonstrations to the pair that inserts."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from skillframe.cli.main import run
from skillframe.execution.trace import Trace

pytestmark = [pytest.mark.slow, pytest.mark.needs_plugins]
PAGE = (Path(__file__).resolve().parents[2] / "docs" / "how-to" / "dual-arm.md").read_text(encoding="utf-8")


def commands(heading: str) -> list[list[str]]:
    """The commands under a heading of the page, without the program's name."""
    text = PAGE.partition(f"## {heading}")[2].partition("```\n")[2].partition("```")[0]
    return [shlex.split(line)[1:] for line in text.replace("\\\n", " ").splitlines()]


@pytest.fixture(scope="module")
def taught(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with what the first two steps of the page make."""
    folder = tmp_path_factory.mktemp("dual")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        for words in [*commands("1."), *commands("2.")]:
            assert run(words) == 0
    return folder


def test_two_demonstrations_of_one_arm_teach_a_skill_for_both(
    taught: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(taught)
    assert [words[0] for words in commands("2.")] == ["learn", "show"]
    assert run(commands("2.")[1]) == 0
    said = capsys.readouterr().out
    assert said.count("is compliant about y") == 2  # configuration D: both arms, in rotation


def test_the_run_of_the_page_inserts_and_leaves_the_replay_that_it_names(
    taught: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(taught)
    ((*words,),) = commands("3.")
    assert run([*words, "--out", "pair.npz"]) == 0
    assert (taught / "pair.html").is_file()
    assert Trace.load(taught / "pair.npz").meta["success"]


def test_the_python_of_the_page_has_both_arms(
    taught: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(taught)
    found: dict[str, Any] = {}
    exec(compile(PAGE.partition("```python\n")[2].partition("```")[0], "dual-arm.md", "exec"), found)
    assert capsys.readouterr().out.count("True") == 2
    assert {np.shape(trace.wrench)[1] for trace in found["done"].arms.values()} == {6}
    assert set(found["done"].arms) == {"left", "right"}

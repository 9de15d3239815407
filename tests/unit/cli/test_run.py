import json
from pathlib import Path

import pytest

from skillframe.cli.main import run
from skillframe.conformance.examples import example_demonstrations
from skillframe.demonstration.files import write_demonstration

pytestmark = pytest.mark.needs_plugins


@pytest.fixture
def skill(tmp_path: Path) -> str:
    path = tmp_path / "left.npz"
    write_demonstration(example_demonstrations()[0], path)
    return f"lmc:{path}"


def test_a_run_leaves_a_trace_a_page_and_a_film(skill: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    files = {"trace": tmp_path / "run.npz", "replay": tmp_path / "run.html", "video": tmp_path / "run.mp4"}
    options = ["--out", str(files["trace"]), "--replay", str(files["replay"]), "--video", str(files["video"])]
    code = run(["run", skill, "--world", "free", "--duration", "0.1", *options, "--json"])
    said = json.loads(capsys.readouterr().out)
    assert code == (0 if said["success"] else 1)
    assert {what: said[what] for what in files} == {what: str(path) for what, path in files.items()}
    assert all(path.stat().st_size > 1000 for path in files.values())


def test_a_film_that_could_not_be_written_is_refused_before_the_run(
    skill: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["run", skill, "--world", "free", "--out", str(tmp_path / "run.npz"), "--video", "run.gif"]) == 2
    assert "not a name of a film" in capsys.readouterr().err
    assert not (tmp_path / "run.npz").exists()

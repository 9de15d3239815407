import json
from pathlib import Path

import pytest
import yaml
from skillframe_testkit.checks.examples import example_demonstrations

from skillframe.cli.main import run
from skillframe.extend.reading import write_demonstration

pytestmark = pytest.mark.needs_plugins


@pytest.fixture
def skill(tmp_path: Path) -> str:
    paths = [tmp_path / "left.npz", tmp_path / "right.npz"]
    for path, demonstration in zip(paths, example_demonstrations(), strict=True):
        write_demonstration(demonstration, path)
    out = tmp_path / "slide.skill.json"
    assert run(["learn", *map(str, paths), "--out", str(out)]) == 0
    return str(out)


@pytest.mark.parametrize("form", ["crisp", "aic_motion_update", "cartesian_controllers"])
def test_a_learned_skill_is_written_as_yaml_of_every_format(skill: str, form: str, tmp_path: Path) -> None:
    out = tmp_path / "out.yaml"
    assert run(["export", skill, "--to", form, "--orientation", "1,0,0,0", "--out", str(out)]) == 0
    assert isinstance(yaml.safe_load(out.read_text()), dict)
    assert "# slide.skill.json: push along -z at 20 mm/s" in out.read_text()


def test_the_formats_are_listed(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["export", "--json"]) == 0
    assert [f["name"] for f in json.loads(capsys.readouterr().out)] == [
        "aic_motion_update", "cartesian_controllers", "crisp", "urscript",
    ]  # fmt: skip


def test_the_centre_of_compliance_can_be_elsewhere_than_where_it_was_learned(skill: str, tmp_path: Path) -> None:
    out = tmp_path / "out.yaml"
    assert run(["export", skill, "--to", "crisp", "--coc", "0,0,0.125", "--out", str(out)]) == 0
    assert "centre of compliance (0, 0, 0.125) m" in out.read_text()


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--to", "crips"], "did you mean 'crisp'"),
        (["--to", "cartesian_controllers"], "--orientation"),
        (["--to", "crisp", "--orientation", "1,1,0,0"], "not a unit quaternion"),
        (["--to", "crisp", "--phase", "2"], "no phase 2"),
        (["--to", "crisp", "--coc", "tpi"], "tpi"),
        ([], "missing '--to'"),
    ],
)
def test_what_cannot_be_exported_is_one_sentence_and_no_file(
    skill: str, options: list[str], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out.yaml"
    assert run(["export", skill, *options, "--out", str(out)]) == 2
    assert said in capsys.readouterr().err
    assert not out.exists()


def test_export_says_on_the_terminal_and_in_json_what_it_was_checked_against_and_from_which_version_it_holds(
    skill: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out.yaml"
    capsys.readouterr()
    assert run(["export", skill, "--to", "crisp", "--out", str(out)]) == 0
    said = capsys.readouterr().out
    assert "checked against utiasDSL/crisp_controllers 2b33ab7" in said
    assert "needs crisp_controllers 1.3.0 or newer" in said
    assert run(["export", skill, "--to", "aic_motion_update", "--out", str(out), "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["checked_against"].startswith("intrinsic-dev/aic db40abc")
    assert any("10 N" in note for note in answer["notes"])
    assert run(["export", "--json"]) == 0
    assert all(f["checked_against"] for f in json.loads(capsys.readouterr().out))

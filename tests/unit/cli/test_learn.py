import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from skillframe_testkit.checks.examples import example_demonstrations

from skillframe.cli.main import run
from skillframe.document.file import load
from skillframe.extend.reading import read_demonstration, write_demonstration

pytestmark = pytest.mark.needs_plugins


@pytest.fixture(scope="module")
def demos(tmp_path_factory):
    folder = tmp_path_factory.mktemp("demos")
    paths = [folder / "left.npz", folder / "right.csv"]
    for path, demonstration in zip(paths, example_demonstrations(), strict=True):
        write_demonstration(demonstration, path)
    return [str(path) for path in paths]


@pytest.fixture(scope="module")
def slide(demos, tmp_path_factory):
    """A skill that the command has learned. Read only."""
    out = tmp_path_factory.mktemp("slide") / "slide.skill.json"
    assert run(["learn", *demos, "--out", str(out)]) == 0
    return out


def test_learn_writes_a_skill_file(slide, demos):
    document = load(slide)
    assert document["type"] == "lmc"
    assert [s["file"] for s in document["learned_from"]] == demos
    assert all(len(s["sha256"]) == 64 for s in document["learned_from"])
    part = document["phases"][0]["translation"]
    assert set(part) == {
        "desired_direction", "speed", "compliant_axes", "fully_compliant", "stiffness", "damping", "evidence",
    }  # fmt: skip
    assert {
        "explained", "feasible_solid_angle_sr", "work_teacher_j", "work_environment_j", "criterion",
    } <= set(part["evidence"])  # fmt: skip


def test_what_was_learned_is_told_in_three_lines_and_the_evidence_when_asked(slide, demos, tmp_path, capsys):
    out = tmp_path / "a.json"
    assert run(["learn", *demos, "--out", str(out)]) == 0
    assert out.read_bytes() == slide.read_bytes()  # learning twice gives the same
    what, sure, then = capsys.readouterr().out.splitlines()
    assert what == f"{out}: push along -z at 20 mm/s; free along x; holds its orientation"
    assert re.fullmatch(r"sure: the push is known to about \d+ degrees; from 2 demonstrations", sure)
    assert then.startswith("next: good; try it")
    assert run(["show", str(out)]) == 0
    assert "compliant axis" in capsys.readouterr().out


def test_ambiguity_is_a_sentence_and_no_exit_code(demos, tmp_path, capsys):
    out = tmp_path / "one.json"
    assert run(["learn", demos[0], "--out", str(out)]) == 0
    _, sure, then = capsys.readouterr().out.splitlines()
    assert sure.startswith("sure: the push is open: up to ") and sure.endswith("; from 1 demonstration")
    assert then.startswith("next: add a demonstration from the other side, going towards ")
    assert run(["show", str(out)]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "record another demonstration from the other side" in said and " sr" in said


def test_a_kind_that_gives_no_advice_tells_all_of_its_words(demos, tmp_path, capsys):
    assert run(["learn", demos[0], "--skill", "replay", "--out", str(tmp_path / "r.json")]) == 0
    said = capsys.readouterr().out
    assert said.startswith(f"{tmp_path / 'r.json'}: ") and "sure: " not in said


def test_points_axes_and_settings_reach_the_file(demos, tmp_path):
    out = tmp_path / "a.json"
    options = ["--at", "wrist", "--hand", "0,0,0.1", "--axes", "phase_start", "--set", "stiffness_n_m=1500"]
    assert run(["learn", *demos, "--out", str(out), *options]) == 0
    document = load(out)
    assert document["frame"]["learned_at"] == [0.0, 0.0, -0.15]
    assert document["frame"]["center_of_compliance"] == [0.0, 0.0, -0.15]
    assert document["frame"]["work_at"] == [0.0, 0.0, 0.1]
    assert document["frame"]["axes"] == "phase_start"
    assert document["settings"]["stiffness_n_m"] == 1500.0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--skill", "lcm"], "did you mean 'lmc'"),
        (["--at", "wrst"], "did you mean 'wrist'"),
        (["--set", "step=3"], "unknown key 'step'"),
        (["--set", "step_m"], "is not KEY=VALUE"),
        (["--axes", "tool"], "phase_start"),
    ],
)
def test_bad_requests_exit_2_with_a_sentence_and_write_nothing(demos, tmp_path, capsys, arguments, message):
    out = tmp_path / "a.json"
    assert run(["learn", *demos, "--out", str(out), *arguments]) == 2
    assert message in capsys.readouterr().err
    assert not out.exists()


def test_what_looks_wrong_in_a_recording_is_said_when_it_is_learned_from(demos, tmp_path, capsys):
    demo = read_demonstration(demos[0])
    biased = tmp_path / "biased.npz"
    write_demonstration(replace(demo, wrench=demo.wrench + 7.0 * (np.arange(6) == 0)), biased)
    assert run(["learn", str(biased), "--out", str(tmp_path / "a.json")]) == 0
    assert f"warning: {biased}: bias: 6.99 N" in capsys.readouterr().err


def test_a_missing_demonstration_exits_2(tmp_path, capsys):
    assert run(["learn", str(tmp_path / "none.npz"), "--out", str(tmp_path / "a.json")]) == 2
    assert "no such file" in capsys.readouterr().err


def test_show_says_it_in_words_with_who_made_it_and_json_stands_alone(slide, capsys):
    by = load(slide)["created_by"]
    assert run(["show", str(slide)]) == 0
    said = capsys.readouterr().out
    assert said.startswith("push along -z at 20 mm/s; free along x")
    assert f"made by skillframe-lmc {by['plugin_version']} with skillframe {by['skillframe']}" in said
    assert run(["show", str(slide), "--json"]) == 0
    shown = json.loads(capsys.readouterr().out)
    assert shown["phases"] == load(slide)["phases"]
    assert shown["words"][0].startswith("push along -z")


@pytest.mark.slow
def test_explain_writes_one_page_that_needs_nothing_else(slide, tmp_path):
    page = tmp_path / "deep" / "a.html"
    assert run(["show", str(slide), "--page", str(page)]) == 0
    text = page.read_text()
    assert text.startswith("<!doctype html>")
    assert text.count("<img") == 3
    assert "http" not in text.replace("data:image", "")
    assert "push along -z" in text


@pytest.mark.parametrize("command", [["show"], ["show", "--page", "x.html"]])
def test_a_damaged_skill_file_exits_2_and_names_the_key(slide, tmp_path, capsys, command):
    document = json.loads(slide.read_text())
    document["phases"][0]["translation"]["stiffness"] = [[1.0, 0.0], [0.0, 1.0]]
    (tmp_path / "a.json").write_text(json.dumps(document))
    assert run([*command, str(tmp_path / "a.json")]) == 2
    assert "phases[0].translation.stiffness" in capsys.readouterr().err


def two_phases(path: Path) -> str:
    """A slide, then another way down: the examples' first demonstration, and it again half a turn about z."""
    one = example_demonstrations()[0]
    turn = np.diag([-1.0, -1.0, 1.0])
    slide = one.time >= 0.5
    after = (one.position[slide] - one.position[slide][0]) @ turn.T + one.position[-1]
    wrench = np.concatenate([one.wrench[slide, :3] @ turn.T, one.wrench[slide, 3:]], axis=1)
    wrench += np.random.default_rng(0).normal(scale=1e-3, size=wrench.shape)  # noise does not repeat itself
    both = replace(
        one, time=np.arange(len(one) + slide.sum()) / one.rate, position=np.concatenate([one.position, after]),
        quaternion=np.concatenate([one.quaternion, one.quaternion[slide]]),
        wrench=np.concatenate([one.wrench, wrench]),
    )  # fmt: skip
    write_demonstration(both, path)
    return str(path)


def test_a_demonstration_of_several_phases_is_told_with_the_command_that_cuts_it(tmp_path, capsys):
    files = [two_phases(tmp_path / "a b.npz"), two_phases(tmp_path / "c.npz")]
    assert run(["learn", *files, "--out", str(tmp_path / "s.json")]) == 0
    captured = capsys.readouterr()
    (said,) = [line for line in captured.err.splitlines() if line.startswith("note: ") and "phases" in line]
    assert captured.out.splitlines()[-1] == "next: cut the demonstrations into phases, as the note says"
    assert said.startswith(f"note: {files[0]} (and 1 more) has probably several phases: in contact it moves by ")
    assert said.endswith(f"type: skillframe segment '{files[0]}' {files[1]} --out NAME.policy.json")


def test_demonstrations_of_one_phase_and_skills_that_play_a_motion_back_hear_nothing_of_phases(demos, tmp_path, capsys):
    assert run(["learn", *demos, "--out", str(tmp_path / "s.json")]) == 0
    assert run(["learn", two_phases(tmp_path / "a.npz"), "--skill", "replay", "--out", str(tmp_path / "r.json")]) == 0
    assert "phases" not in capsys.readouterr().err


def test_half_of_a_set_that_looks_like_several_phases_says_nothing(demos, tmp_path, capsys):
    assert run(["learn", demos[0], two_phases(tmp_path / "a.npz"), "--out", str(tmp_path / "s.json")]) == 0
    assert "phases" not in capsys.readouterr().err

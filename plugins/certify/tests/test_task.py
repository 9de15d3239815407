"""One file that leads to a certificate: what it has to say, and the folder that it settles in."""

import tomllib
from pathlib import Path

import pytest
from skillframe_certify.commands.task import steps_of
from skillframe_certify.task import TaskFile
from skillframe_worlds.valley import ValleyParams

from skillframe.campaign.spec import CampaignSpec
from skillframe.cli.main import run
from skillframe.errors import InputError

TEXT = """
world = "valley"
teacher = 2
seed = 3
rate = 0.9
[set]
"world.friction" = 0.5
[vary]
"fixture.offset_x" = { uniform = ["-15mm", "15mm"] }
"""


def written(folder, text=TEXT):
    folder.mkdir(exist_ok=True)
    (folder / "valley.task.toml").write_text(text)
    return TaskFile.from_toml(folder / "valley.task.toml")


def test_the_folder_holds_a_campaign_with_the_tasks_ranges(tmp_path):
    task, out = written(tmp_path / "in"), tmp_path / "out"
    task.settle(out)
    (out / "skill.skill.json").write_text("{}")
    spec = CampaignSpec.from_toml(out / "campaign.toml", ValleyParams)
    assert spec.vary["fixture.offset_x"].numbers == (-0.015, 0.015)
    assert (spec.name, spec.seed, spec.fixed) == ("valley", 3, {"world.friction": 0.5})
    task.settle(out)  # to go on


def test_a_world_of_a_file_is_found_where_the_task_lies_from_wherever_it_is_typed(tmp_path, monkeypatch):
    folder = tmp_path / "in"
    text = TEXT.replace('"valley"', '"parts.toml"').replace("teacher", 'robot = "./arm"\nteacher')
    written(folder, text)
    (folder / "arm").mkdir()
    for here, path in ((folder, "valley.task.toml"), (tmp_path, "in/valley.task.toml")):
        monkeypatch.chdir(here)
        said = tomllib.loads(TaskFile.from_toml(Path(path)).campaign(tmp_path / "out"))
        assert (said["world"], Path(said["robot"])) == (str(folder / "parts.toml"), folder / "arm")


def test_steps_whose_outcome_is_there_are_done_and_a_begun_proof_is_gone_on_with(tmp_path):
    task, out = written(tmp_path / "in"), tmp_path / "out"
    task.settle(out)
    before = steps_of(task, out, 2)
    verbs = ["map", "find-failure", "sensitivity", "run"]
    assert [step.command[:2] for step in before[2:6]] == [["certify", verb] for verb in verbs]
    assert "--out" in before[2].command
    assert not any(step.done() for step in before)
    for name in ("demo1.npz", "demo2.npz"):
        (out / "demonstrations" / name).write_bytes(b"")
    (out / "proof").mkdir()
    (out / "proof" / "question.json").write_text("{}")
    after = steps_of(task, out, 2)
    assert [step.done() for step in after] == [True, False, False, False, False, False, False]
    assert after[2].command == ["certify", "map", str(out / "proof"), "--workers", "2"]
    assert [step.may_say_no for step in after] == [False, False, False, True, False, True, False]


def test_what_the_learner_is_told_stands_in_the_command(tmp_path):
    text = TEXT.replace("seed = 3", 'seed = 3\nlearner = "seat"\nat = "wrist"').replace(
        "[set]", "[learn]\nshift = 0.001\n[set]"
    )
    task, out = written(tmp_path / "in", text), tmp_path / "out"
    learn = steps_of(task, out, None)[1].command
    assert learn[3:-2] == ["--skill", "seat", "--at", "wrist", "--set", "shift=0.001"]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("teacher = 2\n", ""), "give one of the two"),
        (("teacher = 2\n", 'teacher = 2\ndemonstrations = ["a.npz"]\n'), "give one of the two"),
        (("teacher = 2\n", 'demonstrations = ["a.npz"]\n'), r"demonstrations\[0\]: no such file: a.npz"),
        (('"fixture.offset_x" = { uniform = ["-15mm", "15mm"] }\n', ""), "vary: is empty"),
        (("seed = 3", "sed = 3"), "sed"),
    ],
)
def test_what_is_wrong_in_a_task_file_is_said(tmp_path, change, said):
    with pytest.raises(InputError, match=said):
        written(tmp_path / "in", TEXT.replace(*change))


def test_a_folder_of_another_task_is_left_alone(tmp_path):
    out = tmp_path / "out"
    written(tmp_path / "in").settle(out)
    with pytest.raises(InputError, match="belongs to another task"):
        written(tmp_path / "in", TEXT.replace("seed = 3", "seed = 4")).settle(out)
    with pytest.raises(InputError, match="is not an empty folder"):
        written(tmp_path / "in").settle(tmp_path / "in")


def test_a_skill_that_was_repaired_after_its_proof_began_is_refused(tmp_path, capsys):
    task, out = written(tmp_path / "in"), tmp_path / "out"
    task.settle(out)
    (out / "proof" / "look" / "skills").mkdir(parents=True)
    for place in (out, out / "proof" / "look" / "skills"):
        (place / "skill.skill.json").write_text("{}")
    (out / "skill.skill.json").write_text('{"better": true}')
    assert run(["certify", "run", str(tmp_path / "in" / "valley.task.toml"), "--out", str(out)]) == 2
    assert "is not the skill that" in capsys.readouterr().err


def test_certify_run_tells_a_task_from_a_campaign_by_what_is_in_it(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    written(tmp_path)
    Path("a.skill.json").write_text('{"format": "skillframe.skill", "version": 1}')
    for words, said in (
        (["valley.task.toml"], "--out: is missing; name a folder"),
        (
            ["valley.task.toml", "--out", "o", "--rate", "0.9"],
            "and a task's file says what is certified; leave out --rate",
        ),
        (["valley.task.toml", "--out", "o", "--json"], "leave out --json"),
        (["a.skill.json", "--out", "o"], "is a skill file, and a campaign is wanted here"),
    ):
        assert run(["certify", "run", *words]) == 2
        assert said in capsys.readouterr().err
    assert not Path("o").exists()

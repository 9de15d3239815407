"""One file that leads to a certificate: what it has to say, and the folder that it settles in."""

import tomllib
from pathlib import Path

import pytest

from skillframe.campaign.claims.task import TaskFile
from skillframe.campaign.spec import CampaignSpec
from skillframe.cli.certify import steps_of
from skillframe.errors import InputError
from skillframe.world.worlds.valley import ValleyParams

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
    verbs = ["map", "break", "matter", "certify"]
    assert [step.command[:2] for step in before[2:6]] == [["campaign", verb] for verb in verbs]
    assert "--out" in before[2].command
    assert not any(step.done() for step in before)
    for name in ("demo1.npz", "demo2.npz"):
        (out / "demonstrations" / name).write_bytes(b"")
    (out / "proof").mkdir()
    (out / "proof" / "question.json").write_text("{}")
    after = steps_of(task, out, 2)
    assert [step.done() for step in after] == [True, False, False, False, False, False, False]
    assert after[2].command == ["campaign", "map", str(out / "proof"), "--workers", "2"]
    assert [step.may_say_no for step in after] == [False, False, False, True, False, True, False]


def test_what_the_learner_is_told_stands_in_the_command(tmp_path):
    text = TEXT.replace("seed = 3", 'seed = 3\nat = "wrist"\nexception = "search"').replace(
        "[set]", "[learn]\nshift = 0.001\n[set]"
    )
    task, out = written(tmp_path / "in", text), tmp_path / "out"
    learn = steps_of(task, out, None)[1].command
    assert learn[3:-2] == ["--skill", "lmc", "--at", "wrist", "--exception", "search", "--set", "shift=0.001"]


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

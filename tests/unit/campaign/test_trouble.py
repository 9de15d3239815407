"""Trouble of the environment never becomes a row. What a skill does wrong does."""

import shutil

import campaign_fakes as fakes
import pytest
from campaign_fakes import table

from skillframe.campaign import evaluate
from skillframe.campaign.driver import CampaignError, attempt
from skillframe.campaign.folder import load
from skillframe.campaign.rows import ChunkJob
from skillframe.campaign.runner import replay_trial
from skillframe.errors import InputError, MissingDependency, SkillframeError, UnknownName
from skillframe.fmu.build import find_fmu


def test_a_file_that_vanishes_stops_the_campaign_and_resume_ends_in_the_identical_table(out, reference):
    (out / "material").touch()

    def lose(progress):
        if progress.done == 32:
            (out / "material").unlink(missing_ok=True)

    words = r"stopped, while on trials 16 to 23 of a\.skill\.json: FileNotFoundError.*material.*no row.*campaign resume"
    with pytest.raises(CampaignError, match=words):
        fakes.run(out, fakes.needs_a_file, lose, chunk=8)
    assert len(table(out).splitlines()) == 1 + 32
    with pytest.raises(CampaignError, match="says nothing about the skill"):
        fakes.run(out, fakes.needs_a_file)
    (out / "material").touch()
    fakes.run(out, fakes.needs_a_file, traces=0)
    assert table(out) == reference(48)


def raising(error):
    def evaluate(job):
        if fakes._guilty(job):
            raise error
        return fakes.good(job)

    return evaluate


@pytest.mark.parametrize(
    "error",
    [
        MemoryError(), FileNotFoundError(2, "no such file"), OSError(28, "No space left on device"), TimeoutError(),
        ModuleNotFoundError("No module named 'torch'"), UnknownName("skill", "lmc", []),
        MissingDependency("a C compiler", "an FMU", "pip install ziglang"),
    ],
    ids=lambda e: type(e).__name__,
)  # fmt: skip
def test_trouble_of_the_environment_has_no_row(out, error):
    with pytest.raises(CampaignError, match="no row was written"):
        fakes.run(out, raising(error), chunk=8)
    assert b"\n37,a.skill.json" not in table(out)
    assert b"error:" not in table(out)


def test_a_robot_a_skill_or_a_world_that_cannot_be_loaded_has_no_row(out, monkeypatch):
    """The fakes' robot is an empty URDF, their skill file holds no skill, and no such world is registered."""
    job = ChunkJob(spec=load(out, fakes.FakeParams).plain(), folder=str(out), skill=0, trials=(0,))
    for name, what in (("load_robot_model", "robot"), ("load_skill", "skill a.skill.json"), ("", "world fake")):
        answer = attempt(evaluate.evaluate, job)
        assert answer.trouble
        assert answer.text.startswith(f"the {what} cannot be loaded: ")
        if name:
            monkeypatch.setattr(evaluate, name, lambda *arguments: (None, None))


def test_an_fmu_that_vanishes_has_no_row(out):
    def evaluate(job):
        if fakes._guilty(job):
            find_fmu(out / "gone.fmu")
        return fakes.good(job)

    with pytest.raises(CampaignError, match=r"gone\.fmu: no such file.* no row was written"):
        fakes.run(out, evaluate, chunk=8)


@pytest.mark.parametrize(
    "error",
    [
        ValueError("odd"), KeyError("state"), ZeroDivisionError(), FloatingPointError(), SkillframeError("far"),
        InputError("world.slope", "is 2.0", "give 0 < slope < 1.4 rad"), SystemExit(7), GeneratorExit(),
    ],
    ids=lambda e: type(e).__name__,
)  # fmt: skip
def test_what_a_skill_or_a_world_does_wrong_is_that_trials_failure(out, reference, error):
    assert fakes.run(out, raising(error), traces=0)["complete"]
    mine, other = table(out).splitlines(), reference(48).splitlines()
    (changed,) = [a for a, b in zip(mine, other, strict=True) if a != b]
    assert changed.startswith(b"37,a.skill.json,7,")
    assert b",0,error: " in changed or b',0,"error: ' in changed
    assert changed.endswith(b",nan,nan,nan,nan,nan,nan,nan,lost,nan,nan,,,,0,0,nan")


def test_sys_exit_in_a_skill_ends_its_trial_and_not_the_campaign(out):
    fakes.run(out, raising(SystemExit(7)), traces=0)
    assert b"called sys.exit(7)" in table(out)
    assert replay_trial(out, 37, always_leaves, None, fakes.FakeParams).changed == {}


def always_leaves(job):
    raise SystemExit(7)


@pytest.mark.parametrize("replaced", [False, True])
def test_a_folder_that_is_moved_while_it_runs_stops_it_and_is_gone_on_with_where_it_is_now(
    out, reference, tmp_path, replaced
):
    moved = tmp_path / "moved"

    def move(progress):
        if progress.done == 16:
            out.rename(moved)
            if replaced:
                shutil.copytree(moved, out)

    with pytest.raises(CampaignError, match="moved or deleted while it ran"):
        fakes.run(out, notify=move, chunk=8, traces=0)
    assert out.exists() == replaced
    fakes.run(moved, traces=0)
    assert table(moved) == reference(48)


@pytest.mark.slow
def test_one_worker_in_trouble_gets_no_more_work_and_the_others_do_its_trials(out, reference):
    told = []
    fakes.run(out, fakes.needs_luck, told.append, workers=2, chunk=8, traces=0)
    assert table(out) == reference(48)
    notes = [p.note for p in told if p.note]
    assert any("gets no work: unknown skill 'lmc'" in note for note in notes), notes


def test_a_lone_surrogate_in_a_skills_words_is_kept_as_its_escape(out):
    assert fakes.run(out, fakes.half_a_pair)["complete"]
    before = table(out)
    assert b"bad \\udcff" in before
    fakes.run(out, fakes.half_a_pair)
    assert table(out) == before
    assert replay_trial(out, 17, fakes.half_a_pair, None, fakes.FakeParams).changed == {}

"""Trouble of the environment never becomes a row; what a skill does wrong does."""

import os
import signal
import time

import campaign_fakes as fakes
import pytest

from skillframe.campaign.driver import CampaignError
from skillframe.campaign.replay import replay_trial
from skillframe.campaign.runner import run_campaign
from skillframe.errors import InputError, MissingDependency, SkillframeError, UnknownName
from tests.unit.campaign.test_runner import check_ended, interruptible, table

LABEL = "a.skill.json"


@pytest.fixture
def out(campaign, tmp_path):
    return fakes.start(campaign(trials=48), tmp_path / "out")


@pytest.fixture
def reference(campaign, tmp_path):
    folder = fakes.start(campaign(trials=48), tmp_path / "reference")
    fakes.run(folder, traces=0)
    return table(folder)


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
    assert table(out) == reference


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
    (changed,) = [a for a, b in zip(table(out).splitlines(), reference.splitlines(), strict=True) if a != b]
    assert changed.startswith(b"37,a.skill.json,7,")
    assert b",0,error: " in changed or b',0,"error: ' in changed


def test_sys_exit_in_a_skill_ends_its_trial_and_not_the_campaign(out):
    fakes.run(out, fakes.leaves, traces=0)
    assert b"37,a.skill.json" in table(out) and b"called sys.exit(7)" in table(out)
    assert replay_trial(out, 37, always_leaves, None, fakes.FakeParams).changed == {}


def always_leaves(job):
    raise SystemExit(7)


def test_a_folder_that_is_moved_while_it_runs_stops_it_and_is_gone_on_with_where_it_is_now(out, reference, tmp_path):
    moved = tmp_path / "moved"

    def move(progress):
        if progress.done == 16:
            out.rename(moved)

    with pytest.raises(CampaignError, match="moved or deleted while it ran"):
        fakes.run(out, notify=move, chunk=8, traces=0)
    assert not out.exists()
    fakes.run(moved, traces=0)
    assert table(moved) == reference


def test_one_worker_in_trouble_gets_no_more_work_and_the_others_do_its_trials(out, reference):
    told = []
    fakes.run(out, fakes.needs_luck, told.append, workers=2, chunk=8, traces=0)
    assert table(out) == reference
    notes = [p.note for p in told if p.note]
    assert any("gets no work: unknown skill 'lmc'" in note for note in notes), notes


def test_a_lone_surrogate_in_a_skills_words_is_kept_as_its_escape(out):
    assert fakes.run(out, fakes.half_a_pair)["complete"]
    before = table(out)
    assert b"bad \\udcff" in before
    fakes.run(out, fakes.half_a_pair)
    assert table(out) == before
    assert replay_trial(out, 17, fakes.half_a_pair, None, fakes.FakeParams).changed == {}


FULL = "import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (6000, 6000))"


def test_a_full_disk_names_the_file_and_exits_2(tmp_path):
    process, out = interruptible(tmp_path, [], prelude=FULL)  # a file may not grow: what a full disk does to a write
    _, errors = process.communicate(timeout=120)
    assert process.returncode == 2, errors
    assert f"error: {out / 'rows.jsonl'}: File too large; finished rows are kept" in errors
    assert (out / "rows.jsonl").read_bytes().endswith(b"}\n")  # nothing half-written
    assert run_campaign(out, fakes.good)["complete"]  # with room again


@pytest.mark.parametrize("options", [[], ["--workers", "2"]])
def test_sigterm_writes_the_tables_and_exits_143(tmp_path, options):
    process, out = interruptible(tmp_path, options)
    while not (out / "rows.jsonl").exists() or (out / "rows.jsonl").read_bytes().count(b'"trial"') < 20:
        assert process.poll() is None
        time.sleep(0.02)
    os.kill(process.pid, signal.SIGTERM)
    assert 20 <= check_ended(process, out, 143) < 800

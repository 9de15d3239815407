"""Campaigns from Python: a file, a dict and objects are one plan, and results hold what the folder holds."""

import gc
import json
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from skillframe import Campaign, CampaignResults, learn, report, run
from skillframe.errors import InputError
from skillframe.robot.spec import load_robot

pytestmark = pytest.mark.needs_plugins
VALLEY = ("valley", "free_tool")
SHORT = {"duration_s": 0.1}
VARY = {"start.offset_x": {"uniform": [-0.01, 0.01]}}


@pytest.fixture(scope="module")
def results(skill, demonstrations, tmp_path_factory):
    skills = {"slide": skill, "replay": learn(demonstrations[0], "replay")}
    folder = tmp_path_factory.mktemp("campaign") / "results"
    plan = Campaign(world="valley", skills=skills, robot="free_tool", vary=VARY, trials=6, seed=3, coc="tip")
    return plan.run(folder, traces=1)


def test_results_hold_rates_rows_columns_and_traces(results):
    assert list(results.skills) == ["slide.skill.json", "replay.skill.json"]
    rate = results.skills["slide.skill.json"]
    table = results.table("slide")
    assert rate.trials == len(table["success"]) == 6
    assert rate.successes == table["success"].sum()
    assert rate.rate == rate.successes / 6
    low, high = rate.interval_95
    assert low <= rate.rate <= high
    assert np.all(np.abs(table["start.offset_x"]) <= 0.01)
    assert np.array_equal(table["start.offset_x"], results.table("replay")["start.offset_x"])
    assert len(results.rows) == 12
    assert results.comparisons[0]["trials"] == 6
    assert f"{rate.successes} of 6" in repr(results)
    assert results.run_of(0, "slide").success == table["success"][0]
    with pytest.raises(InputError, match="left no trace"):
        results.run_of(5)


def test_results_of_a_folder_are_those_of_the_run(results):
    again = CampaignResults(str(results.folder))
    assert repr(again.rows) == repr(results.rows)  # NaN is not equal to itself
    assert again.skills == results.skills


@pytest.mark.slow
def test_a_file_a_dict_and_keywords_are_one_plan(skill, tmp_path, monkeypatch, results):
    skill.save(tmp_path / "slide.skill.json")
    text = 'seed = 3\ntrials = 6\nrobot = "free_tool"\nworld = "valley"\ncoc = "tip"\nskills = ["slide.skill.json"]\n'
    (tmp_path / "plan.toml").write_text(text + '[vary]\n"start.offset_x" = { uniform = [-0.01, 0.01] }\n')
    keys = {"world": "valley", "skills": str(tmp_path / "slide.skill.json"), "robot": "free_tool",
            "vary": VARY, "seed": 3, "coc": "tip", "trials": 6}  # fmt: skip
    plans = [
        Campaign(tmp_path / "plan.toml"),
        Campaign(keys),
        Campaign(**keys),
        Campaign(tmp_path / "plan.toml", trials=6),
    ]
    monkeypatch.chdir(tmp_path.parent)
    tables = [plan.run(traces=0).table() for plan in plans]
    for table in tables:
        assert repr(table) == repr(results.table("slide"))  # NaN is not equal to itself


def test_keywords_replace_keys_of_the_file(skill, tmp_path):
    skill.save(tmp_path / "slide.skill.json")
    text = 'seed = 3\ntrials = 600\nrobot = "free_tool"\nworld = "valley"\nskills = ["slide.skill.json"]\n'
    (tmp_path / "plan.toml").write_text(text)
    assert Campaign(tmp_path / "plan.toml", trials=2).spec.trials == 2
    assert Campaign(tmp_path / "plan.toml", trials=2).spec.labels == ("slide.skill.json",)


@pytest.mark.slow
def test_a_temporary_folder_goes_with_the_results(skill):
    results = Campaign(world="free", skills=skill, robot="free_tool", trials=1, duration_s=0.1).run()
    folder = results.folder
    assert (folder / "results.csv").is_file()
    del results
    gc.collect()
    assert not folder.exists()


def test_a_full_folder_is_refused(skill, results):
    plan = Campaign(world="free", skills=skill, robot="free_tool", trials=1)
    with pytest.raises(InputError, match="holds a campaign already"):
        plan.run(results.folder)


def test_two_skills_of_one_name_are_told_to_have_names(skill):
    with pytest.raises(InputError, match="name them"):
        Campaign(world="free", skills=[skill, skill])


def test_a_loaded_robot_goes_by_its_file_unless_it_differs(skill):
    spec = load_robot("free_tool")
    assert Campaign(world="free", skills=skill, robot=spec).spec.robot_name == "free_tool"
    with pytest.raises(InputError, match="differs from"):
        Campaign(world="free", skills=skill, robot=replace(spec, summary="another"))


@pytest.mark.slow
def test_a_report_takes_results_runs_and_their_files_alike(results, skill, tmp_path):
    done = run(skill, *VALLEY, **SHORT).save(tmp_path / "run.npz")
    given = [results, done, done.trace, results.folder, tmp_path / "run.npz"]
    for i, each in enumerate(given):
        assert report(each, tmp_path / f"{i}.html").is_file()
    both = report([results, done], tmp_path / "both.html").read_text()
    assert "Single runs" in both or "A run of" in both
    assert json.loads(results.folder.joinpath("summary.json").read_text())["name"] in both


SCRIPT = """
from skillframe import Campaign, learn, record
print("started")
skill = learn(record("valley", "free_tool", count=2, seed=1))
print(Campaign(world="free", skills=skill, robot="free_tool", trials=4, duration_s=0.1).run(workers=2, traces=0))
"""


@pytest.mark.slow
def test_a_script_without_a_main_guard_is_not_run_again_by_its_workers(tmp_path):
    (tmp_path / "script.py").write_text(SCRIPT)
    done = subprocess.run(
        [sys.executable, "script.py"], cwd=tmp_path, capture_output=True, text=True, check=True, timeout=300
    )
    assert done.stdout.count("started") == 1
    assert "lmc.skill.json" in done.stdout

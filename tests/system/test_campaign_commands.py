"""Campaigns through the command line and the real executor: a recorded valley, replayed over declared errors."""

import csv
import json
import math

import pytest

from skillframe.cli.main import run
from skillframe.execution.trace import Trace

pytestmark = pytest.mark.needs_plugins

CAMPAIGN = """
name = "valley"
seed = {seed}
trials = {trials}
robot = "free_tool"
world = "valley"
skills = ["replay:demo.npz"]
duration_s = {seconds}
[vary]
{vary}
"""
VARY = """
"fixture.offset_x" = { uniform = [-0.03, 0.03] }
"start.offset_y" = { normal = [0.0, 0.002] }
"world.friction" = { choice = [0.1, 0.3] }
"world.slope" = { grid = [0.7, 0.8] }
"sensor.force_noise" = { sobol = [0.1, 0.5] }
[set]
"start.offset_z" = 0.04
"""


@pytest.fixture(scope="module")
def demonstration(tmp_path_factory):
    path = tmp_path_factory.mktemp("demonstration") / "demo.npz"
    assert run(["record", "--world", "valley", "--robot", "free_tool", "--seed", "1", "--out", str(path)]) == 0
    return path


@pytest.fixture
def campaign(demonstration, tmp_path):
    def write(vary=VARY, seed=3, trials=12, extra="", seconds=4.0):
        (tmp_path / "demo.npz").write_bytes(demonstration.read_bytes())
        path = tmp_path / "valley.toml"
        path.write_text(CAMPAIGN.format(seed=seed, trials=trials, vary=vary, seconds=seconds) + extra)
        return str(path)

    return write


def table(folder):
    return list(csv.DictReader((folder / "results.csv").read_text().splitlines()))


@pytest.mark.slow
def test_run_status_and_replay_tell_one_story(campaign, tmp_path, capsys):
    out = tmp_path / "results"
    assert run(["campaign", "run", campaign(trials=6), "--out", str(out), "--traces", "1"]) == 0
    rows = table(out)
    assert [row["trial"] for row in rows] == [str(i) for i in range(6)]
    assert {row["success"] for row in rows} == {"0", "1"}
    assert {row["world.slope"] for row in rows} == {"0.7", "0.8"}
    capsys.readouterr()
    assert run(["campaign", "status", str(out), "--json"]) == 0
    status = json.loads(capsys.readouterr().out)
    summary = json.loads((out / "summary.json").read_text())
    successes = sum(int(row["success"]) for row in rows)
    assert status["complete"]
    assert status["skills"] == summary["skills"]
    assert status["skills"]["replay:demo.npz"]["successes"] == successes
    trace = tmp_path / "5.npz"  # tests/laws/test_identity.py compares the rows of all trials
    assert run(["campaign", "replay", str(out), "5", "--out", str(trace)]) == 0
    meta = Trace.load(trace).meta
    assert (meta["trial"], meta["success"]) == (5, rows[5]["success"] == "1")
    assert repr(meta["peak_force_n"]) == rows[5]["peak_force_n"]
    assert repr(meta["draws"]["fixture.offset_x"]) == rows[5]["fixture.offset_x"]
    kept = Trace.load(out / "traces" / "00000_replay_demo.npz.npz")
    assert kept.meta["bodies"]
    assert repr(kept.meta["peak_force_n"]) == rows[0]["peak_force_n"]
    scene = json.loads((out / "scene.json").read_text())
    assert (scene["world"], len(scene["fixture"]) > 0) == ("valley", True)


@pytest.mark.slow
def test_workers_chunks_and_a_resume_end_in_the_identical_table(campaign, tmp_path):
    path = campaign()
    tables = []
    for name, options in [("a", []), ("b", ["--chunk", "5"]), ("c", ["--workers", "2"])]:
        assert run(["campaign", "run", path, "--out", str(tmp_path / name), *options, "--traces", "0"]) == 0
        tables.append((tmp_path / name / "results.csv").read_bytes())
    rows = tmp_path / "c" / "rows.jsonl"
    rows.write_bytes(rows.read_bytes()[:-1200])
    assert run(["campaign", "resume", str(tmp_path / "c"), "--traces", "0"]) == 0
    tables.append((tmp_path / "c" / "results.csv").read_bytes())
    assert len(set(tables)) == 1


@pytest.mark.slow
def test_a_campaign_runs_again_from_its_own_folder(campaign, tmp_path):
    assert run(["campaign", "run", campaign(), "--out", str(tmp_path / "a")]) == 0
    for name in ("demo.npz", "valley.toml"):
        (tmp_path / name).unlink()
    assert run(["campaign", "run", str(tmp_path / "a" / "campaign.toml"), "--out", str(tmp_path / "b")]) == 0
    assert (tmp_path / "a" / "results.csv").read_bytes() == (tmp_path / "b" / "results.csv").read_bytes()


@pytest.mark.slow
def test_a_rate_below_its_bar_exits_1(campaign, tmp_path, capsys):
    vary = '"fixture.offset_x" = { uniform = [0.2, 0.3] }'  # the valley is somewhere else
    path = campaign(vary, trials=4, extra="[expect]\nrate = 0.9\n", seconds=0.5)
    assert run(["campaign", "run", path, "--out", str(tmp_path / "out"), "--traces", "0"]) == 1
    assert "below the threshold of 0.9" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("vary", "words"),
    [
        ('"world.slpoe" = { uniform = [0.7, 0.8] }', "did you mean 'world.slope'?"),
        ('"fixture.offest_x" = { uniform = [0.7, 0.8] }', "did you mean 'fixture.offset_x'?"),
        ('"world.slope" = { uniform = [0.7, 1.8] }', "1.8 rad is beyond 0.5deg to 80deg"),
        ('"world.friction" = { choice = [0.1, -0.1] }', "-0.1 is beyond 0 to 5"),
        ("[set]\nworld.radius = -1.0", "radius"),
    ],
)
def test_what_cannot_run_exits_2_says_why_and_leaves_no_folder(campaign, tmp_path, capsys, vary, words):
    assert run(["campaign", "run", campaign(vary), "--out", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    assert words in error
    assert "Traceback" not in error
    assert sorted(p.name for p in tmp_path.iterdir()) == ["demo.npz", "valley.toml"]


@pytest.mark.slow
def test_a_start_out_of_reach_is_that_trials_failure_and_not_the_campaigns(campaign, tmp_path, capsys):
    vary = '"start.offset_x" = { values = [0.0, 0.0, 2.5, 0.0] }'
    text = campaign(vary, trials=4, seconds=0.1).replace("free_tool", "panda")
    path = tmp_path / "valley.toml"
    path.write_text(path.read_text().replace("free_tool", "panda"))
    assert run(["campaign", "run", text, "--out", str(tmp_path / "out"), "--traces", "0"]) == 0
    rows = table(tmp_path / "out")
    assert [row["failure"].startswith("error: arm 'arm' does not reach") for row in rows] == [False, False, True, False]


@pytest.mark.parametrize(
    "arguments",
    [
        ["run", "absent.toml", "--out", "x"],
        ["run", "absent.toml"],
        ["resume", "absent"],
        ["status", "absent"],
        ["replay", "absent", "0"],
        ["replay", "absent", "-1"],
        ["resume", "absent", "--workers", "0"],
        ["resume", "absent", "--workers", "2", "--scheduler", "tcp://127.0.0.1:1"],
    ],
)
def test_usage_errors_exit_2(arguments, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert run(["campaign", *arguments]) == 2
    captured = capsys.readouterr()
    assert captured.err
    assert "Traceback" not in captured.err


@pytest.mark.slow
def test_a_campaign_tells_its_outcome_as_json_names_robot_and_world_and_is_quiet_when_asked(campaign, tmp_path, capsys):
    vary = '"fixture.offset_x" = { uniform = ["-30mm", "30mm"] }\n"start.tilt_z" = { choice = [0, "1deg"] }\n'
    out = str(tmp_path / "results")
    capsys.readouterr()
    path = campaign(vary, trials=4, seconds=0.1)  # what it says is asked, and not whether the part arrives
    assert run(["campaign", "run", path, "--out", out, "--traces", "2", "--json", "-q"]) == 0
    told = capsys.readouterr()
    said = json.loads(told.out)
    assert told.err == ""
    assert (said["robot"], said["world"]) == ("free_tool", "valley")
    assert said["results"] == str(tmp_path / "results" / "results.csv")
    assert said["skills"].keys() == json.loads((tmp_path / "results" / "summary.json").read_text())["skills"].keys()
    rows = table(tmp_path / "results")
    assert all(-0.03 <= float(row["fixture.offset_x"]) < 0.03 for row in rows)
    assert {float(row["start.tilt_z"]) for row in rows} <= {0.0, math.radians(1.0)}
    assert run(["campaign", "resume", out, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["skills"] == said["skills"]
    assert run(["campaign", "status", out]) == 0
    assert "(free_tool in valley)" in capsys.readouterr().out
    assert run(["campaign", "status", out, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["robot"] == "free_tool"


def test_a_unit_of_another_dimension_in_a_campaign_is_refused(campaign, tmp_path, capsys):
    path = campaign('"fixture.offset_x" = { uniform = ["-3deg", 0.1] }\n')
    assert run(["campaign", "run", path, "--out", str(tmp_path / "results")]) == 2
    assert "vary.fixture.offset_x.uniform[0]: expected a quantity in m, got -3deg" in capsys.readouterr().err

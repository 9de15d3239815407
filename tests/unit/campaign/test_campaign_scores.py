"""Scores of a plug-in in campaigns and runs: columns only where asked, the same whatever else runs, and on the page."""

import csv
import json
import math

import numpy as np
import pytest
from skillframe_testkit.checks.examples import example_demonstrations

from skillframe.campaign.spec import CampaignSpec
from skillframe.cli.main import run
from skillframe.errors import InputError, UnknownName
from skillframe.execution.trace import Trace
from skillframe.extend.reading import write_demonstration

PLUGIN = """
import numpy as np
from skillframe import hookimpl
from skillframe.extend import ScoreType, SkillType
from skillframe.skill import Command
from skillframe_testkit.suites import HoldSkill

def way(trace):
    return np.linalg.norm(np.diff(trace.position, axis=0), axis=1).sum()

def last(trace):
    return float("nan") if trace.meta["draws"]["start.offset_x"] < 0.0 else trace.time[-1]

def broken(trace):
    return {}["absent"]

def greedy(trace):
    trace.position[0] = 0.0
    return 1.0

@hookimpl
def skillframe_skills():
    yield SkillType(
        name="hold", summary="holds", build=lambda document: HoldSkill(duration=0.05), example=dict,
        learn=lambda demonstrations, options: {"frame": {"learned_at": [0.0, 0.0, 0.0], "work_at": [0.0, 0.0, 0.0],
            "center_of_compliance": [0.0, 0.0, 0.0], "axes": "base"}, "phases": [{}]})

@hookimpl
def skillframe_scores():
    yield ScoreType(name="way", summary="How far the tool moved.", unit="m", compute=way)
    yield ScoreType(name="last", summary="When it ended, if it began right of the middle", unit="s", compute=last)
    yield ScoreType(name="broken", summary="raises", unit="1", compute=broken)
    yield ScoreType(name="greedy", summary="writes into the trace", unit="1", compute=greedy)
    yield ScoreType(name="endless", summary="is infinite", unit="1", compute=lambda trace: float("inf"))
    yield ScoreType(name="wordy", summary="is no number", unit="1", compute=lambda trace: "much")
"""
CAMPAIGN = """
seed = 3
trials = 5
robot = "free_tool"
world = "free"
skills = ["hold:demo.npz"]
duration_s = 0.1
{scores}
[vary]
"start.offset_x" = {{ uniform = [-0.01, 0.01] }}
"""


@pytest.fixture
def campaign(tmp_path, monkeypatch, install, fresh_registry):
    """Runs a campaign with some scores; its folder."""
    install("measured", PLUGIN)
    monkeypatch.chdir(tmp_path)
    write_demonstration(example_demonstrations()[0], tmp_path / "demo.npz")

    def make(scores=(), out="results", code=1):
        line = f"scores = {json.dumps(list(scores))}" if scores else ""
        (tmp_path / "c.toml").write_text(CAMPAIGN.format(scores=line))
        assert run(["campaign", "run", "c.toml", "--out", out, "-q"]) in (0, code)
        return tmp_path / out

    return make


def rows(folder):
    return list(csv.DictReader((folder / "results.csv").read_text().splitlines()))


def test_scores_are_the_last_columns_where_asked_and_change_no_other_cell(campaign):
    without, scored = campaign(out="without"), campaign(["way", "last"], out="scored")
    plain, more = rows(without), rows(scored)
    assert list(more[0]) == [*plain[0], "score.way", "score.last"]
    assert [{k: v for k, v in row.items() if not k.startswith("score.")} for row in more] == plain
    assert "scores" not in json.loads((without / "summary.json").read_text())
    assert "scores" not in (without / "campaign.toml").read_text()
    assert "scores" not in CampaignSpec.from_toml(without / "campaign.toml").plain()


def test_a_score_is_the_plugin_s_figure_of_that_trial_and_nan_where_there_is_none(campaign, capsys):
    out = campaign(["way", "last"])
    for row in rows(out):
        left = float(row["start.offset_x"]) < 0.0
        assert math.isnan(float(row["score.last"])) == left
        assert run(["campaign", "replay", str(out), row["trial"], "--out", "one.npz"]) == 0  # the same bits
        trace = Trace.load(out.parent / "one.npz")
        assert float(row["score.way"]) == np.linalg.norm(np.diff(trace.position, axis=0), axis=1).sum()
        assert trace.meta["scores"]["last"]["value"] == (None if left else trace.time[-1])
        assert trace.meta["scores"]["way"]["unit"] == "m"
    summary = json.loads((out / "summary.json").read_text())["scores"]
    figures = [float(row["score.way"]) for row in rows(out)]
    assert summary["way"]["skills"]["hold:demo.npz"] == {
        "trials": 5, "median": sorted(figures)[2], "smallest": min(figures), "largest": max(figures),
    }  # fmt: skip
    assert summary["last"]["skills"]["hold:demo.npz"]["trials"] == sum(r["score.last"] != "nan" for r in rows(out)) < 5


def test_a_killed_and_resumed_campaign_ends_with_the_same_scores(campaign):
    out = campaign(["way", "last"])
    whole = (out / "results.csv").read_bytes()
    lines = (out / "rows.jsonl").read_bytes().splitlines(keepends=True)
    (out / "rows.jsonl").write_bytes(b"".join(lines[:4]))
    run(["campaign", "resume", str(out), "-q"])
    assert (out / "results.csv").read_bytes() == whole


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("broken", "score broken raised KeyError: 'absent'"),
        ("greedy", "score greedy raised ValueError: assignment destination is read-only"),
        ("endless", "score endless gave inf; NaN says that a trial has no such figure"),
        ("wordy", "score wordy gave 'much', not a number"),
    ],
)
def test_a_score_that_fails_stops_the_campaign_with_its_name_and_is_never_a_row(campaign, capsys, name, said):
    out = campaign(["way", name], code=2)
    assert said in capsys.readouterr().err
    assert rows(out) == []


def test_unknown_and_repeated_scores_are_refused_before_anything_runs(campaign, tmp_path):
    campaign(out="first")
    (tmp_path / "c.toml").write_text(CAMPAIGN.format(scores='scores = ["wya"]'))
    with pytest.raises(UnknownName, match="unknown score 'wya'; did you mean 'way'"):
        CampaignSpec.from_toml(tmp_path / "c.toml")
    (tmp_path / "c.toml").write_text(CAMPAIGN.format(scores='scores = ["way", "last", "way"]'))
    with pytest.raises(InputError, match=r"scores\[2\]: 'way' is named twice"):
        CampaignSpec.from_toml(tmp_path / "c.toml")
    (tmp_path / "c.toml").write_text(CAMPAIGN.format(scores='scores = "way"'))
    with pytest.raises(InputError, match="scores: expected a list"):
        CampaignSpec.from_toml(tmp_path / "c.toml")


def test_a_run_tells_its_scores_as_json_in_words_and_in_its_trace(campaign, tmp_path, capsys):
    campaign(out="first")
    typed = ["run", "hold:demo.npz", "--world", "free", "--robot", "free_tool", "--duration", "0.1"]
    typed += ["--set", "start.offset_x=-0.001", "--score", "way", "--score", "last", "--out", "run.npz"]
    capsys.readouterr()
    run([*typed, "--json"])
    told = json.loads(capsys.readouterr().out)["scores"]
    trace = Trace.load(tmp_path / "run.npz")
    assert told["way"]["value"] == np.linalg.norm(np.diff(trace.position, axis=0), axis=1).sum()
    assert told["last"] == {**told["last"], "value": None, "unit": "s"}
    run(typed)
    said = capsys.readouterr().out
    assert "score last: none" in said and "score way: " in said and " m\n" in said
    assert run([*typed[:-2], "--score", "wya"]) == 2
    assert "did you mean 'way'" in capsys.readouterr().err


def test_a_score_is_no_quantity_that_varied_where_campaign_toml_is_missing(campaign):
    from skillframe_reports.results import read_results

    assert read_results(campaign(["way", "last"]) / "results.csv").varied == ("start.offset_x",)


def test_a_score_that_fails_does_not_cost_the_run_that_it_was_asked_of(campaign, tmp_path, capsys):
    campaign(out="first")
    typed = ["run", "hold:demo.npz", "--world", "free", "--robot", "free_tool", "--score", "broken", "--out", "run.npz"]
    assert run([*typed, "--duration", "0.1"]) == 2
    assert "score broken raised KeyError" in capsys.readouterr().err
    assert "scores" not in Trace.load(tmp_path / "run.npz").meta


def test_a_worker_needs_the_plugin_of_a_score(campaign):
    from skillframe.campaign.provenance import identity, needed_plugins

    spec = CampaignSpec.from_toml(campaign(["way"]) / "campaign.toml")
    assert needed_plugins(spec, identity()) >= {"skillframe", "dist-measured"}
    plain = CampaignSpec(name="x", seed=1, trials=1, robot="panda", world="free", skills=(), scores=("way",))
    assert needed_plugins(plain, identity()) == {"skillframe-worlds", "dist-measured"}


@pytest.mark.needs_plugins
@pytest.mark.slow
def test_a_report_shows_the_scores_of_a_campaign_and_of_a_run_without_the_plugin(campaign, tmp_path, monkeypatch):
    out = campaign(["way", "last"])
    run(["run", "hold:demo.npz", "--world", "free", "--robot", "free_tool", "--score", "way", "--out", "run.npz", "-q"])
    monkeypatch.setenv("SKILLFRAME_PLUGINS", "reports")
    from skillframe.extend.registry import registry

    registry.cache_clear()
    assert run(["report", str(out), "run.npz", "--out", "page.html"]) == 0
    page = (tmp_path / "page.html").read_text()
    assert "<h3>Scores</h3>" in page and "way: How far the tool moved." in page
    assert "last: When it ended, if it began right of the middle." in page
    assert "; way 0" in page  # of the run
    assert "score.way" not in page.split("<h3>Scores</h3>")[0]  # it is no quantity that varied

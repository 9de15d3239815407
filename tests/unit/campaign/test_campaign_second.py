"""How far second parts of a fixture file moved, as columns of a campaign's table, and in the words of a run."""

import csv
import math

import pytest
from skillframe_reports.results import read_results
from skillframe_reports.runs import _story
from skillframe_testkit.checks.examples import example_demonstrations

from skillframe.campaign.rows import columns, decode, encode, rows_of
from skillframe.campaign.spec import CampaignSpec
from skillframe.campaign.store import write_results
from skillframe.cli.main import run
from skillframe.execution.trace import Trace
from skillframe.extend.reading import write_demonstration
from tests.part_meshes import FILE, round_pair, write
from tests.unit.campaign.test_campaign_scores import PLUGIN

BLOCK = "boxes = [{ size = [0.01, 0.01, 0.02], xyz = [0.04, 0.0, 0.05] }]\nmass = 0.01\n"
SECOND = f"""
[[second]]
name = "door"
joint = "slide"
range = [-0.0002, 0.0]
{BLOCK}
[[second]]
name = "stone"
joint = "free"
boxes = [{{ size = [0.006, 0.01, 0.01], xyz = [0.0105, 0.0, 0.006] }}]
"""
CAMPAIGN = (
    'seed = 1\ntrials = 3\nrobot = "free_tool"\nworld = "fixture.toml"\nskills = ["hold:demo.npz"]\nduration_s = 0.1\n'
)
NAMES = ["second.door.travel", "second.stone.moved", "second.stone.turned"]


@pytest.mark.slow
def test_a_campaign_s_table_says_how_far_second_parts_moved(tmp_path, monkeypatch, install, fresh_registry):
    install("measured", PLUGIN)
    monkeypatch.setenv("SKILLFRAME_PLUGINS", "worlds,parts,measured")
    monkeypatch.chdir(tmp_path)
    write_demonstration(example_demonstrations()[0], tmp_path / "demo.npz")
    write(tmp_path, *round_pair(), FILE + SECOND)
    (tmp_path / "c.toml").write_text(CAMPAIGN)
    assert run(["campaign", "run", "c.toml", "--out", "out", "-q"]) in (0, 1)
    rows = list(csv.DictReader((tmp_path / "out" / "results.csv").read_text().splitlines()))
    assert list(rows[0])[-3:] == NAMES and len(rows) == 3
    for row in rows:
        assert float(row["second.door.travel"]) == pytest.approx(-2e-4, abs=5e-5)  # its range ends it; a stop gives way
        assert float(row["second.stone.moved"]) == pytest.approx(1e-3, abs=1e-4)  # onto the block; contacts sink
    assert run(["campaign", "replay", "out", "1", "--out", "one.npz"]) == 0  # bit-identical, or the exit code is 1
    meta = Trace.load(tmp_path / "one.npz").meta
    assert {f"second.{name}": repr(value) for name, value in meta["second"].items()} == {n: rows[1][n] for n in NAMES}
    turned = math.degrees(meta["second"]["stone.turned"])
    assert f"stone.moved {1000.0 * meta['second']['stone.moved']:.2f} mm" in _story(meta)
    assert f"stone.turned {turned:.1f} degrees" in _story(meta)


def test_second_parts_are_no_varied_quantity_and_a_lost_trial_has_none(tmp_path):
    spec = CampaignSpec(name="n", seed=1, trials=3, robot="r", world="w", skills=("a.json",))
    outcome = {"success": [True], "failure": [""], "second.gear.angle": [math.nan]}
    whole, lost = (
        rows_of(spec, 0, (0, 1), {key: 2 * value for key, value in outcome.items()}),
        rows_of(spec, 0, (2,), {key: outcome[key] for key in ("success", "failure")}),
    )
    whole[0]["second.gear.angle"], whole[1]["second.gear.angle"] = 0.25, 0.5
    assert columns(spec, whole)[-1] == "second.gear.angle" and "second.gear.angle" not in columns(spec)
    stored = {key: encode(value) for key, value in rows_of(spec, 0, (1,), outcome)[0].items()}
    assert stored["second.gear.angle"] == "nan" and math.isnan(decode(stored)["second.gear.angle"])
    write_results(tmp_path, spec, [*whole, *lost])
    read = read_results(tmp_path / "results.csv")
    assert read.rows[0].values["second.gear.angle"] == 0.25 and not read.varied
    assert (tmp_path / "results.csv").read_text().endswith(",nan\n")

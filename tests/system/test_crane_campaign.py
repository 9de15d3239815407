"""A campaign of hydraulic cranes whose FMUs fail: every trial has its row, and the one that failed its sentence."""

import csv
import json

import numpy as np
import pytest
from skillframe_papers.rows.crane_runs import MOVING, Follow, diamond

from skillframe.cli.main import run
from skillframe.execution.executor import Setup, begin
from skillframe.execution.prepare import load_robot_model, load_world
from skillframe.fmu.build import find_compiler
from tests.fmu_cache import own_cache  # noqa: F401
from tests.system.worn_cylinder import campaign

pytestmark = [
    pytest.mark.slow, pytest.mark.needs_plugins, pytest.mark.skipif(find_compiler() is None, reason="no C compiler"),
]  # fmt: skip
TRIALS, CRASH, HANG, SECONDS = 3, 2, 1, 0.5
VARIED = ("supply_pressure", "deadband", "delay", "friction_scale")


def test_a_crash_and_a_hang_end_one_trial_each_and_the_table_can_be_resumed_and_replayed(tmp_path, capsys):
    out = tmp_path / "results"
    path = campaign(tmp_path / "campaign", TRIALS, CRASH, HANG, seconds=SECONDS)
    assert run(["campaign", "run", str(path), "--out", str(out), "--traces", "0"]) == 0
    table = (out / "results.csv").read_bytes()
    rows = list(csv.DictReader(table.decode().splitlines()))
    assert [row["trial"] for row in rows] == [str(i) for i in range(TRIALS)]
    assert "lift_piston (worn_cylinder.fmu) crashed (SIGSEGV) while stepping from 7.2" in rows[CRASH]["failure"]
    assert "lift_piston (worn_cylinder.fmu) did not answer within 5 s" in rows[HANG]["failure"]
    assert f"time limit: {SECONDS:g} s" in rows[0]["failure"]
    assert (out / "robots" / "worn_crane" / "worn_cylinder.fmu").is_file()

    assert run(["campaign", "replay", str(out), str(CRASH)]) == 0
    log = out / "rows.jsonl"
    log.write_bytes(log.read_bytes()[:-900])  # as a kill leaves it: the last row is there in part
    capsys.readouterr()
    assert run(["campaign", "resume", str(out), "--chunk", "1", "--traces", "0"]) == 0
    assert (out / "results.csv").read_bytes() == table
    summary = json.loads((out / "summary.json").read_text())
    assert summary["skills"]["corner.skill.json"]["trials"] == TRIALS

    page = tmp_path / "report.html"
    assert run(["report", str(out), "--out", str(page)]) == 0
    text = page.read_text(encoding="utf-8")
    assert "crashed (SIGSEGV)" in text and "did not answer" in text
    assert all(f"actuator.{name}" in text for name in VARIED)


def test_a_trial_whose_fmu_refuses_to_start_ends_at_once_with_its_sentence_and_the_others_go_on(tmp_path, monkeypatch):
    monkeypatch.setattr("skillframe.extend.drives.require_within", lambda *known: None)
    campaign(tmp_path, TRIALS, CRASH, HANG)
    file = tmp_path / "worn_crane" / "robot.toml"
    foreign = 'fmu = "worn_cylinder.fmu"\ninitial_force = "initial_force"'
    file.write_text(file.read_text().replace('fmu = "hydraulic_cylinder"', foreign))
    robot, where = load_robot_model(str(file)), load_world("pallets", {})
    draws = {"actuator.deadband": np.array([0.0, 1.5])}
    rngs = [np.random.default_rng(i) for i in range(2)]
    loop = begin(Follow(diamond, MOVING), Setup(robot=robot, scene=where), draws, rngs, None)
    loop.prepare()
    assert loop.active.tolist() == [0] and loop.outcomes.duration[1] == 0.0
    assert "parameter deadband is 1.5; it must be below 1" in loop.outcomes.reason[1]
    assert np.isfinite(loop.drive.actuated.master.force[:3]).all()

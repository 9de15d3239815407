"""200 cranes with FMUs over supply pressure, valve deadband, delay and friction. One FMU crashes and one hangs."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

from skillframe.cli.main import run
from tests.figures.teaching import row
from tests.fmu_cache import own_cache  # noqa: F401
from tests.system.worn_cylinder import campaign

pytestmark = [pytest.mark.figures, pytest.mark.needs_plugins]
TRIALS, CRASH, HANG = 200, 57, 142
VARIED = ("supply_pressure", "deadband", "delay", "friction_scale")
QUARTERS = 4


def show(name: str, values: np.ndarray, wins: np.ndarray) -> None:
    edges = np.quantile(values, np.linspace(0.0, 1.0, QUARTERS + 1))
    which = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, QUARTERS - 1)
    row(name, *(f"{edges[q]:.3g}..{edges[q + 1]:.3g}: {wins[which == q].mean():.2f}" for q in range(QUARTERS)))


def test_two_hundred_rows_name_the_two_trials_whose_fmu_failed(tmp_path: Path) -> None:
    out = tmp_path / "results"
    path = campaign(tmp_path / "campaign", TRIALS, CRASH, HANG, seconds=12.0)
    assert run(["campaign", "run", str(path), "--out", str(out), "--chunk", "20"]) == 0
    rows = list(csv.DictReader((out / "results.csv").read_text().splitlines()))
    assert [r["trial"] for r in rows] == [str(i) for i in range(TRIALS)]
    fmu = {i: r["failure"] for i, r in enumerate(rows) if "worn_cylinder.fmu" in r["failure"]}
    for i, text in fmu.items():
        row(f"trial {i}", text)
    assert fmu.keys() == {CRASH, HANG}
    assert "crashed (SIGSEGV)" in fmu[CRASH] and "did not answer" in fmu[HANG]
    wins = np.array([float(r["success"]) for r in rows])
    row("success", f"{wins.sum():.0f}/{TRIALS}")
    for name in VARIED:
        show(name, np.array([float(r[f"actuator.{name}"]) for r in rows]), wins)
    for trial in (0, CRASH):
        assert run(["campaign", "replay", str(out), str(trial)]) == 0
    table, log = (out / "results.csv").read_bytes(), out / "rows.jsonl"
    log.write_bytes(log.read_bytes()[:-3000])  # as a kill leaves it: some rows are gone, one is there in part
    assert run(["campaign", "resume", str(out), "--chunk", "20"]) == 0
    assert (out / "results.csv").read_bytes() == table
    page = tmp_path / "report.html"
    assert run(["report", str(out), "--out", str(page)]) == 0
    text = page.read_text(encoding="utf-8")
    assert all(f"actuator.{name}" in text for name in VARIED)
    assert "crashed (SIGSEGV)" in text and "did not answer" in text

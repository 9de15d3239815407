"""Recordings made elsewhere go through `demonstration convert` and `learn`; whether a direction works has a formula."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from skillframe.cli.main import run
from tests.oracle.grooves import Groove, any_style, write

pytestmark = pytest.mark.needs_plugins


def learned(groove: Groove, folder: Path) -> dict:
    rng = np.random.default_rng([5, groove.seed])
    style, files = any_style(rng), []
    for i, recording in enumerate(groove.show()):
        path = write(recording, folder, f"demo{i}", style, rng)
        if style["millimetres"] and path.suffix == ".csv":
            assert run(["demonstration", "convert", str(path), "--units", "mm", "--out", str(folder / f"{i}.npz")]) == 0
            path = folder / f"{i}.npz"
        files.append(str(path))
    assert run(["demonstration", "check", *files]) == 0
    assert run(["learn", *files, "--out", str(folder / "skill.json")]) == 0
    return json.loads((folder / "skill.json").read_text())["phases"][0]["translation"]


SEEDS = [*range(12), *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(12, 72))]


@pytest.mark.parametrize("seed", SEEDS)
def test_a_groove_of_any_shape_attitude_and_file_is_learned_as_a_push_that_slides_down_both_walls(
    seed: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    groove = Groove(seed)
    found = learned(groove, tmp_path)
    assert found["desired_direction"] is not None, found["evidence"]["message"]
    assert groove.feasible(np.array(found["desired_direction"]))
    assert len(found["compliant_axes"]) == 1
    # 25 degrees: two demonstrations of unequal slopes lean the mean motion across the groove
    assert abs(np.dot(found["compliant_axes"][0], groove.across)) > np.cos(np.deg2rad(25.0))
    assert "Warning" not in capsys.readouterr().err

"""Recordings made elsewhere go through `convert` and `learn`. Whether a direction works has a formula."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from skillframe.cli.main import run
from tests.oracle.grooves import Groove, any_style, unconditioned, write

pytestmark = pytest.mark.needs_plugins


def learned(groove: Groove, folder: Path, *, biased: bool) -> dict:
    rng = np.random.default_rng([5, groove.seed])
    style, files = any_style(rng), []
    for i, recording in enumerate(groove.show()):
        if biased:
            recording = unconditioned(recording, groove.noise, rng)
            style["frame"] = "tool"
        path = write(recording, folder, f"demo{i}", style, rng)
        if style["millimetres"] and path.suffix == ".csv":
            assert run(["convert", str(path), "--set", "units=mm", "--out", str(folder / f"{i}.npz")]) == 0
            path = folder / f"{i}.npz"
        if biased:
            assert run(["filter", str(path), "--out", str(folder / f"clean{i}.npz")]) == 0
            path = folder / f"clean{i}.npz"
        files.append(str(path))
    assert run(["check", *files]) == 0
    assert run(["learn", *files, "--out", str(folder / "skill.json")]) == 0
    return json.loads((folder / "skill.json").read_text())["phases"][0]["translation"]


SEEDS = [*range(4), *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(4, 70))]


@pytest.mark.parametrize("biased", [False, True])
@pytest.mark.parametrize("seed", SEEDS)
def test_a_groove_of_any_shape_attitude_and_file_is_learned_as_a_push_that_slides_down_both_walls(
    seed: int, biased: bool, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    groove = Groove(seed)
    found = learned(groove, tmp_path, biased=biased)
    assert found["desired_direction"] is not None, found["evidence"]["message"]
    push, axes = np.array(found["desired_direction"]), np.array(found["compliant_axes"])
    assert groove.feasible(push)
    assert len(axes) == 1
    assert groove.gives_way(push, axes[0])
    said = capsys.readouterr().err
    assert "Warning" not in said  # of numpy
    assert "were taken for bias" not in said

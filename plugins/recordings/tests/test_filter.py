from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from skillframe.cli.main import run
from skillframe.demonstration.convention import weight_wrench
from skillframe.demonstration.record import Demonstration
from skillframe.extend.reading import read_demonstration, write_demonstration
from skillframe.frames import rotate_spatial


@pytest.fixture(autouse=True)
def demo(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Demonstration:
    """Two seconds of turning in free air with bias and 0.9 kg on the sensor, then a press, as demo.npz."""
    monkeypatch.chdir(tmp_path)
    s = np.linspace(0.0, 1.0, 600)
    rotation = Rotation.from_rotvec(np.stack([np.sin(9 * s), np.sin(6 * s), 0 * s], axis=-1))
    wrench = rotate_spatial(rotation.as_matrix(), np.array([5.0, -2.0, 1.0, 0.1, 0.0, 0.0]))
    wrench += weight_wrench(rotation.as_matrix(), 0.9, np.array([0.0, 0.0, 0.05]))
    wrench += np.random.default_rng(0).normal(size=(600, 6)) * np.repeat([0.05, 0.003], 3)
    wrench[420:, 2] += 20.0
    demo = Demonstration(
        time=3.0 * s, position=np.zeros((600, 3)), quaternion=rotation.as_quat(), wrench=wrench,
        meta={"wrench": {"includes_tool_weight": True}},
    )  # fmt: skip
    write_demonstration(demo, "demo.npz")
    return demo


def test_weight_and_bias_go_and_the_press_stays(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["filter", "demo.npz", "--free-air", "0,2", "--json", "--out", "clean.npz"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["payload"]["mass_kg"] == pytest.approx(0.9, abs=0.005)
    clean = read_demonstration("clean.npz")
    assert np.abs(clean.wrench[:400].mean(axis=0)).max() < 0.02
    assert clean.wrench[450:, 2].mean() == pytest.approx(20.0, abs=0.05)
    assert clean.meta["conditioning"]["method"] == "smoother"


def test_nothing_asked_for_changes_nothing(demo: Demonstration) -> None:
    assert run(["filter", "demo.npz", "--no-bias", "--method", "none", "--out", "same.csv"]) == 0
    assert np.array_equal(read_demonstration("same.csv").wrench, demo.wrench)


def test_a_push_from_the_start_is_not_taken_for_bias_in_silence(
    demo: Demonstration, capsys: pytest.CaptureFixture[str]
) -> None:
    wrench = demo.wrench - demo.wrench[:1] + 12.0 * (np.arange(6) == 2)
    write_demonstration(replace(demo, wrench=wrench, meta={}), "pushed.npz")
    assert run(["filter", "pushed.npz", "--free-air", "0,0.5", "--out", "clean.npz"]) == 0
    assert capsys.readouterr().err == ""
    assert run(["filter", "pushed.npz", "--out", "clean.npz"]) == 0
    assert "were taken for bias; if the recording starts in contact, name a stretch" in capsys.readouterr().err


def test_given_noise_and_corner_are_used(capsys: pytest.CaptureFixture[str]) -> None:
    command = ["filter", "demo.npz", "--no-bias", "--method", "filter", "--noise", "0.2,0.01", "--corner", "15"]
    assert run([*command, "--json", "--out", "f.npz"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["noise"] == pytest.approx([0.2] * 3 + [0.01] * 3)
    assert said["corner_hz"] == pytest.approx([15.0] * 6)


def test_the_answer_in_words_has_units(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["filter", "demo.npz", "--free-air", "0,2", "--out", "clean.npz"]) == 0
    out = capsys.readouterr().out
    assert "0.900 kg" in out or "0.899 kg" in out or "0.901 kg" in out
    assert "corner" in out


@pytest.mark.parametrize(
    "options",
    [
        ["--free-air", "1"],
        ["--free-air", "nan,2"],
        ["--free-air", "1,1.01"],
        ["--noise", "-1,1"],
        ["--corner", "0"],
        ["--method", "median"],
    ],
)
def test_wrong_options_exit_2_and_write_nothing(options: list[str]) -> None:
    assert run(["filter", "demo.npz", *options, "--out", "x.npz"]) == 2
    assert not Path("x.npz").exists()

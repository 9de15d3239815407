"""Teaching the crane by teleoperation, through the command line: recorded, read, learned, refused."""

import json

import numpy as np
import pytest

from skillframe.cli.main import run
from skillframe.extend.reading import read_demonstration
from tests.crane_teaching import LEARN, margin

CRANE = ["record", "--world", "pallets", "--robot", "hiab_xs031", "--teacher", "teleoperation"]


@pytest.mark.slow
@pytest.mark.needs_plugins
@pytest.mark.figures
def test_two_demonstrations_of_an_operator_teach_a_push_that_is_feasible(tmp_path, capsys):
    near = ["--set", "world.away=0.3", "--set", "world.above=0.25"]
    assert run([*CRANE, *near, "--count", "2", "--seed", "3", "--out", str(tmp_path / "push.csv"), "--json"]) == 0
    files = json.loads(capsys.readouterr().out)["files"]
    first = read_demonstration(files[0])
    assert first.meta["wrench"] == {
        "frame": "base", "point": "tool", "sign": "environment", "includes_tool_weight": False
    }  # fmt: skip
    assert first.meta["teacher"] == "teleoperation" and first.rate == pytest.approx(100.0)
    assert set(first.extra) == {"sigma_1", "sigma_2", "force_valid"} and np.all(first.extra["sigma_1"] > 0.0)
    pushed = first.wrench[np.abs(first.wrench[:, 2]) > 2000.0]
    assert len(pushed) > 50 and np.all(pushed[:, 2] > 0.0)  # the stack pushes the tool up
    options = [part for name, value in LEARN.items() for part in ("--set", f"{name}={json.dumps(value)}")]
    assert run(["learn", *files, "--out", str(tmp_path / "push.skill.json"), *options]) == 0
    part = json.loads((tmp_path / "push.skill.json").read_text())["phases"][0]["translation"]
    angle = np.degrees(np.arctan2(part["desired_direction"][2], part["desired_direction"][0]))
    assert margin(angle) >= 10.0
    assert len(part["compliant_axes"]) == 1


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--set", "teacher.feed_velocity=true"], "loop gain 5.25 is not below 1"),
        (["--set", "teacher.force_scale=100"], "loop gain 3.33 is not below 1"),
        (["--set", "teacher.hand_stiffness=400", "--set", "teacher.delay_s=0.15"], "loop gain 1.00 is not below 1"),
        (["--set", "teacher.delay_s=-0.1"], "--set teacher.delay_s: -0.1 s is beyond 0s to"),
        (["--set", "teacher.packet_hz=0"], "--set teacher.packet_hz: 0 Hz is beyond 0.01Hz to"),
        (["--set", "teacher.aim=2deg"], "unknown key 'aim'; did you mean 'aim_noise'?"),
        (["--teacher", "kinesthetic"], "nobody leads hiab_xs031 by hand"),
    ],
)
def test_a_channel_that_cannot_be_used_is_refused_in_a_sentence_and_leaves_no_file(options, said, tmp_path, capsys):
    assert run([*CRANE, *options, "--out", str(tmp_path / "push.npz")]) == 2
    refusals = [line for line in capsys.readouterr().err.splitlines() if line.lower().startswith("error: ")]
    assert len(refusals) == 1 and said in refusals[0]
    assert not list(tmp_path.iterdir())


def test_options_of_machines_are_refused_for_a_robot_that_is_none(tmp_path, capsys):
    words = ["record", "--world", "valley", "--robot", "free_tool", "--angle", "0"]
    assert run([*words, "--out", str(tmp_path / "x.npz")]) == 2
    assert "angle: is for machines that are taught by an operator" in capsys.readouterr().err

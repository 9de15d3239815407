"""What docs/how-to/own-fmu.md shows is built, checked and run."""

import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from skillframe_testkit.suites import ScriptedSkill

from skillframe.cli.main import run
from skillframe.execution.executor import simulate
from skillframe.execution.prepare import load_robot_model
from skillframe.fmu.build import find_compiler
from tests.laws.runs import generators, setup

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler")
PAGE = (Path(__file__).resolve().parents[2] / "docs" / "how-to" / "own-fmu.md").read_text(encoding="utf-8")


def block(language, word=""):
    return next(b for b in re.findall(rf"```{language}\n(.*?)```", PAGE, re.DOTALL) if word in b)


def motor_of_the_page(folder):
    """The page's motor in `fmus`."""
    motor = folder / "fmus" / "drag_motor"
    motor.mkdir(parents=True)
    (motor / "fmu.toml").write_text(block("toml", 'name = "drag_motor"'))
    (motor / "drag_motor.c").write_text(block("c"))
    return motor


@pytest.mark.parametrize("remembers", [False, True])
@pytest.mark.slow
def test_the_fmu_of_the_page_builds_and_checks(tmp_path, monkeypatch, capsys, remembers):
    folder = motor_of_the_page(tmp_path)
    if remembers:
        (folder / "own.h").write_text(re.search(r"`(typedef struct .*? Own;)`", PAGE).group(1))
    monkeypatch.setenv("SKILLFRAME_PATH", str(tmp_path))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    for command in (["build"], []):
        assert run(["fmu", *command, "drag_motor"]) == 0, capsys.readouterr()


def test_the_python_of_the_page_runs():
    names = {}
    exec(compile(block("python"), "own-fmu.md", "exec"), names)
    assert names["force"].shape == (32,)
    assert (names["force"] > 5e4).all()  # a command that extends adds to the force that is held


def arm_of_the_page(folder):
    """The page's motor in `fmus`, and a copy of panda with the page's entry in `robots`."""
    from skillframe.robot.spec import robot_names

    motor_of_the_page(folder)
    arm = folder / "robots" / "my_panda"
    shutil.copytree(robot_names()["panda"], arm)
    text = (arm / "robot.toml").read_text(encoding="utf-8")
    (arm / "robot.toml").write_text(text + "\n" + block("toml", 'kind = "servo"'), encoding="utf-8")


@pytest.mark.slow
def test_the_motor_of_the_page_drives_a_joint_of_an_arm_by_name_mapping_alone(tmp_path, monkeypatch, capsys):
    """What it gives is what it was told less its drag: 0.5 Nm s/rad, as robot.toml says, to the trace's rounding."""
    arm_of_the_page(tmp_path)
    monkeypatch.setenv("SKILLFRAME_PATH", str(tmp_path))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    assert run(["robots", "--check", "my_panda"]) == 0
    assert "not_mapped" not in capsys.readouterr().out
    setting = replace(setup("panda", point="tip"), robot=load_robot_model("my_panda"))
    aside = ScriptedSkill(lambda t: 0.2 * t[:, None] * np.array([0.0, 1.0, 0.0]))
    trace = simulate(aside, setting, {}, generators(2), duration_s=0.4, trace_hz=1000.0).traces[1]
    assert trace.meta["actuators"] == ["joint7"] and trace.meta["notes"] == []
    rate = np.gradient(trace.q[:, 6], trace.time)[100:-1]
    told, given = (trace.machine[name][100:-1, 0] for name in ("servo_command", "servo_force"))
    assert np.abs(rate).max() > 0.1
    np.testing.assert_allclose(given, told - 0.5 * rate, atol=2e-3)  # a rate is a difference of 1 ms

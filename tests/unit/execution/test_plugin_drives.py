"""A drive that a plug-in brings, named in robot.toml, drives the robot in a run and in a recording."""

import shutil
from types import SimpleNamespace

import numpy as np
import pytest
from skillframe_testkit.suites import HoldSkill

from skillframe.cli.main import run
from skillframe.errors import InputError
from skillframe.execution.drives import torque
from skillframe.execution.executor import Setup, simulate
from skillframe.execution.prepare import load_robot_model, load_world
from skillframe.extend.drives import drive_of
from skillframe.extend.registry import registry
from skillframe.robot.spec import robot_folder

CODE = """
from skillframe import hookimpl
from skillframe.extend import DriveType

skillframe_contract = "0.2"


def make(setup, draws, rngs):
    from skillframe.execution.drives.torque import OneArm, TorqueDrive

    return TorqueDrive(setup, OneArm(setup, draws, rngs))


@hookimpl
def skillframe_drives():
    yield DriveType(name="bus", summary="torques over a bus", contract="0.2", make=make)
"""


@pytest.fixture
def robot(tmp_path, install):
    """A panda whose robot.toml names the drive of a plug-in."""
    install("bus_plugin", CODE)
    registry.cache_clear()
    folder = tmp_path / "panda_on_a_bus"
    shutil.copytree(robot_folder("panda"), folder)
    text = (folder / "robot.toml").read_text(encoding="utf-8")
    (folder / "robot.toml").write_text(text + '\n[drive]\nkind = "bus"\n', encoding="utf-8")
    yield folder
    registry.cache_clear()


def test_the_drive_of_a_plugin_gives_the_same_run_as_the_one_that_it_wraps(robot):
    def held(model):
        setup = Setup(robot=model, scene=load_world("free", {}))
        return simulate(HoldSkill(duration=0.05), setup, {}, [np.random.default_rng(0)], trace_hz=1000.0)

    own, other = held(load_robot_model("panda")), held(load_robot_model(str(robot)))
    np.testing.assert_array_equal(own.traces[0].position, other.traces[0].position)


def test_an_unknown_drive_is_named_when_the_robot_is_loaded(robot):
    text = (robot / "robot.toml").read_text(encoding="utf-8")
    (robot / "robot.toml").write_text(text.replace('kind = "bus"', 'kind = "buss"'), encoding="utf-8")
    with pytest.raises(InputError, match="'buss'; did you mean 'bus'"):
        load_robot_model(str(robot))


def test_a_robot_that_names_none_of_two_drives_for_its_actuators_is_refused(install, tmp_path):
    for name in ("one", "other"):
        install(f"{name}_plugin", CODE.replace('name="bus"', f'name="{name}", actuated=True'))
    registry.cache_clear()
    with pytest.raises(InputError, match=r"drive\.kind: is not given, and one and other take \[\[actuation\]\]"):
        drive_of(SimpleNamespace(own_law=True, drive=None, folder=tmp_path))
    registry.cache_clear()


@pytest.mark.needs_plugins
@pytest.mark.slow
def test_a_recording_is_driven_by_it(robot, tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("SKILLFRAME_PLUGINS", "worlds,teaching,bus_plugin")
    registry.cache_clear()
    made, own = [], torque.OneArm
    monkeypatch.setattr(torque, "OneArm", lambda *given: made.append(1) or own(*given))
    words = ["record", "--world", "free", "--robot", str(robot), "--out", str(tmp_path / "demo.npz")]
    assert run(words) == 0, capsys.readouterr().err
    assert made

"""Robots that plug-ins ship are found wherever a robot can be named."""

import json
import shutil

import pytest

from skillframe.cli.main import run
from skillframe.errors import UnknownName
from skillframe.extend.registry import PluginConflict
from skillframe.robot import load_robot, robot_names
from skillframe.robot.spec import robot_folder

CODE = """
from pathlib import Path
from skillframe import hookimpl
from skillframe.extend import RobotType
@hookimpl
def skillframe_robots():
    yield RobotType(name="{name}", summary="a robot", folder=Path({folder!r}))
"""


@pytest.fixture
def robot(tmp_path, install, fresh_registry):
    """A plug-in with a copy of the free tool under another name; its folder."""
    folder = tmp_path / "elsewhere" / "flier"
    shutil.copytree(load_robot("free_tool").folder, folder)
    install("one", CODE.format(name="flier", folder=str(folder)))
    return folder


def test_a_robot_of_a_plugin_is_loaded_listed_and_completed_by_its_name(robot, capsys):
    assert load_robot("flier").folder == robot
    assert robot_names()["flier"] == robot
    assert run(["robots", "--json"]) == 0
    rows = {row["name"]: row for row in json.loads(capsys.readouterr().out)}
    assert rows["flier"]["path"] == str(robot) and rows["flier"]["error"] is None
    assert rows["panda"]["error"] is None


def test_a_user_s_own_robot_comes_before_a_plugin_s_and_a_shipped_one(robot, tmp_path, monkeypatch):
    for name in ("flier", "panda"):
        shutil.copytree(robot, tmp_path / "robots" / name)
    monkeypatch.setenv("SKILLFRAME_PATH", str(tmp_path))
    for name in ("flier", "panda"):
        assert load_robot(name).folder == robot_names()[name] == tmp_path / "robots" / name


def test_a_robot_of_a_plugin_is_copied_into_a_campaign_s_folder(robot, tmp_path):
    from skillframe.campaign.folder import _copy_robot
    from skillframe.campaign.spec import CampaignSpec

    spec = CampaignSpec(name="x", seed=1, trials=1, robot="flier", world="free", skills=(), folder=tmp_path)
    assert _copy_robot(spec, tmp_path / "out") == "robots/flier/robot.toml"
    assert load_robot(tmp_path / "out" / "robots" / "flier").name == "flier"


def test_a_misspelt_robot_of_a_plugin_is_suggested_beside_shipped_ones(robot):
    with pytest.raises(UnknownName, match=r"did you mean 'flier'\?.*free_tool"):
        load_robot("fliers")
    with pytest.raises(UnknownName, match="give a path"):
        robot_folder("fliers", "give a path")


def test_two_plugins_with_one_robot_are_refused_by_name(robot, install, tmp_path):
    install("two", CODE.format(name="flier", folder=str(robot)))
    with pytest.raises(PluginConflict, match=r"dist-one 1\.0 and dist-two 1\.0"):
        load_robot("flier")


def test_a_shipped_robot_stays_what_it_is_where_a_plugin_takes_its_name(robot, install, capsys):
    install("two", CODE.format(name="panda", folder=str(robot)))
    assert load_robot("panda").folder != robot
    assert run(["plugins"]) == 0
    assert "robot 'panda' is provided by both skillframe" in capsys.readouterr().out


def test_a_robot_that_a_plugin_lacks_is_named_with_the_plugins_that_failed(install, fresh_registry):
    install("one", "import no_such_module")
    with pytest.raises(UnknownName, match=r"failed to load: dist-one"):
        load_robot("flier")

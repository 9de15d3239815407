"""`worlds`, `skills`, `robots`: what there is, in words and as JSON; and what a shell completes."""

import ast
import json
import os
import re
import subprocess
import sys
from dataclasses import fields

import numpy as np
import pytest
from click.shell_completion import BashComplete

from skillframe.cli.main import cli, run
from skillframe.cli.options import ROBOT
from skillframe.cli.plugins import distribution_rows
from skillframe.config.units import UNITS as WORDS
from skillframe.errors import InputError, UnknownName
from skillframe.execution.prepare import split_settings
from skillframe.extend.drives import check_quantities, quantities
from skillframe.extend.homes import homes, where_to_get
from skillframe.extend.registry import Registry, registry
from skillframe.robot.interface import Control
from skillframe.robot.spec import Limits, RobotFile
from skillframe.robot.tables import Obstacle
from tests.house import library


def listed(capsys, *words):
    capsys.readouterr()
    assert run([*words, "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_every_world_is_listed_with_its_summary_and_distribution(capsys):
    rows = {row["name"]: row for row in listed(capsys, "worlds")}
    assert list(rows) == registry().names("world")
    assert rows["valley"]["distribution"] == "skillframe-worlds" and rows["valley"]["summary"]
    assert run(["worlds"]) == 0
    assert "peg_in_hole" in capsys.readouterr().out


def test_a_world_is_shown_with_units_defaults_and_how_deep_it_is(capsys):
    row = listed(capsys, "worlds", "peg_in_hole")
    depth = next(each for each in row["settings"] if each["name"] == "world.depth")
    assert (depth["unit"], depth["default"], row["depth_m"]) == ("m", 0.06, 0.06)
    assert run(["worlds", "peg_in_hole"]) == 0
    assert "inserted 60 mm is all the way" in capsys.readouterr().out


@pytest.mark.parametrize("world", registry().names("world"))
def test_every_world_can_be_shown(world, capsys):
    assert listed(capsys, "worlds", world)["name"] == world
    assert run(["worlds", world]) == 0


def test_an_unknown_world_is_answered_with_the_nearest(capsys):
    assert run(["worlds", "peg_in_hold"]) == 2
    assert "did you mean 'peg_in_hole'?" in capsys.readouterr().err


@pytest.mark.needs_plugins
def test_skills_and_coordinators_are_listed(capsys):
    rows = {row["name"]: row for row in listed(capsys, "skills")}
    baselines = {"replay", "dmp", "gmr", "seds", "acp"}
    assert {"lmc", "policy", "search", "dual_arm"} | baselines <= set(rows)
    assert rows["lmc"]["learns"] is True and rows["dual_arm"]["kind"] == "coordinator"


def test_every_setting_that_a_run_takes_is_listed_with_a_line_about_it(capsys):
    rows = listed(capsys, "worlds", "--settings")
    of_runs = {row["name"]: row["option"] for row in rows if "option" in row}
    assert of_runs == {"duration_s": "--duration", "rate_hz": "--rate", "coc": "--coc"}
    assert {row["name"] for row in rows if row["world"] is None} == set(quantities()) | set(of_runs)
    worlds = {row["world"] for row in rows} - {None}
    assert worlds == set(registry().names("world"))
    assert all(row["about"] and "unit" in row and "default" in row for row in rows)
    only = listed(capsys, "worlds", "valley", "--settings")
    assert {row["world"] for row in only} == {None, "valley"}
    assert next(row for row in only if row["name"] == "world.slope")["unit"] == "rad"


def test_every_key_of_a_robot_file_is_listed_with_a_line_about_it(capsys):
    rows = {row["name"]: row for row in listed(capsys, "robots", "--keys")}
    assert all(row["about"] for row in rows.values())
    groups = {name.partition(".")[0].removesuffix("[]") for name in rows}
    drives = [drive for drive in registry().records("drive") if drive.tables is not None]
    of_drives = {name.partition(".")[0] for drive in drives for name in drive.tables()}
    assert groups == {field.name for field in fields(RobotFile)} | of_drives
    for record, group in ((Control, "control."), (Limits, "limits."), (Obstacle, "obstacle[].")):
        assert {name for name in rows if name.startswith(group)} == {group + field.name for field in fields(record)}
    assert {"home.NAME", "inertia.NAME.mass", "dynamics.joint.NAME.friction", "actuation[].force_gain"} <= set(rows)
    assert (rows["control.rate_hz"]["unit"], rows["control.rate_hz"]["range"]) == ("Hz", [1.0, 1e5])
    assert rows["limits.force_n"]["default"] == Limits().force_n
    assert run(["robots", "panda", "--keys"]) == 2
    assert "give it alone" in capsys.readouterr().err


@pytest.mark.parametrize(
    "words",
    ["worlds --settings", "robots --keys", "skills", "worlds", "worlds peg_in_hole", "export"],
)
def test_a_listing_in_a_pipe_is_no_wider_than_a_terminal(words, capsys):
    assert run(words.split()) == 0
    assert max(map(len, capsys.readouterr().out.splitlines())) <= 80


def test_every_number_that_a_run_or_campaign_accepts_is_listed_with_a_unit_and_a_range_around_its_default(capsys):
    rows, checked = listed(capsys, "worlds", "--settings"), 0
    for row in rows:
        of_one_kind = row["default"] if isinstance(row["default"], list) else [row["default"]]
        if any(isinstance(value, bool | str) for value in of_one_kind):
            continue  # no quantity
        assert row["unit"] in {unit for unit, _ in WORDS.values()} | {""}, row
        assert row["range"] is not None, row
        least, most = row["range"]
        assert least < most and all(least <= value <= most for value in of_one_kind if value is not None), row
        checked += 1
    accepted = {f"world.{field.name}" for world in registry().records("world") for field in fields(world.params)}
    assert {row["name"] for row in rows} >= set(quantities()) | accepted and checked > 80


@pytest.mark.parametrize("each", quantities().values(), ids=lambda each: each.name)
def test_every_range_of_a_trial_has_its_reason_and_is_kept_by_a_run(each):
    least, most, why = each.range
    assert why
    for value in (least, most):
        split_settings("free", {each.name: value})
    for value in (np.nextafter(least, -np.inf), np.nextafter(most, np.inf)):
        with pytest.raises(InputError, match=f"--set {each.name}: .* is beyond"):
            split_settings("free", {each.name: float(value)})


@pytest.mark.needs_plugins
@pytest.mark.slow
def test_every_quantity_that_the_library_names_is_declared():
    named = re.compile(r"(start|fixture|grasp|robot|sensor|actuator|fault)\.[a-z_]+[a-z]")
    texts = (node.value for file in library() for node in ast.walk(file.tree) if isinstance(node, ast.Constant))
    found = {text for text in texts if isinstance(text, str) and named.fullmatch(text)}
    assert {"robot.mass_scale", "sensor.force_noise", "actuator.delay", "fault.time"} <= found
    assert found - {"robot.toml", "fixture.toml"} <= set(quantities())


def test_every_nominal_value_is_one_that_a_run_accepts():
    for each in quantities().values():
        if each.nominal is not None:
            check_quantities({each.name: [each.nominal]})


def test_plugins_show_says_units(capsys):
    assert run(["plugins", "peg_in_hole"]) == 0
    assert "--set world.clearance=0.00025 [m]\n" in capsys.readouterr().out


def test_a_name_of_a_plugin_that_is_not_installed_comes_with_the_line_that_installs_it(
    capsys, fresh_registry, monkeypatch
):
    monkeypatch.setattr(sys.modules[Registry.__module__], "installed", list)
    for words, line in (
        (
            ["learn", "x.npz", "--out", "x.json"],
            "type: pip install -e plugins/lmc",
        ),
        (["segment", "x.npz", "--out", "x.json"], "type: pip install -e plugins/segmenter"),
        (["run", "x.json", "--world", "dual_peg"], "type: pip install -e plugins/dualarm"),
        (["learn", "x.npz", "--skill", "nothing", "--out", "x.json"], "no plug-in with a skill is installed"),
    ):
        assert run(words) == 2
        assert line in capsys.readouterr().err
    assert run(["skills"]) == 0
    assert "type: make install" in capsys.readouterr().out


def test_a_plugin_that_is_installed_is_not_to_be_installed_again():
    """It is left out by SKILLFRAME_PLUGINS, or does not load: other notes say so."""
    assert "pip install -e plugins/lmc" in where_to_get("skill", "lmc", ["dmp"], ["baselines"])
    assert where_to_get("skill", "lmc", ["dmp"], ["baselines", "lmc"]) == ""


def test_where_there_is_no_checkout_a_plugin_is_installed_by_its_name(monkeypatch):
    monkeypatch.setattr("skillframe.extend.homes.checkout", lambda: None)
    assert where_to_get("skill", "lmc", ["dmp"], []).endswith("type: pip install skillframe-lmc")
    assert where_to_get("skill", "mine", [], []).endswith("type: pip install skillframe-lmc")


@pytest.mark.needs_plugins
def test_every_name_that_a_plugin_of_ours_provides_has_its_home():
    ours = {
        each: row["name"] for row in distribution_rows(registry()) for each in row["provides"]
        if row["distribution"].startswith("skillframe-")
    }  # fmt: skip
    assert ours == {each: home for each, home in homes().items() if each != "skill:dual_arm"}


def test_a_published_row_that_is_missing_is_named_with_the_plugin_that_has_it():
    with pytest.raises(UnknownName, match=r"unknown row '13'.*13 is in skillframe-papers, which is not installed"):
        Registry().row("13")


def test_every_command_that_takes_a_robot_to_run_has_the_same_default():
    for name in ("run", "demo", "record"):
        command = cli.get_command(None, name)
        assert next(p for p in command.params if p.name == "robot").default == ROBOT == "panda"


def completed(*words):
    """What a shell is told to complete the last of some words to."""
    complete = BashComplete(cli, {}, "skillframe", "_SKILLFRAME_COMPLETE")
    return [found.value for found in complete.get_completions(list(words[:-1]), words[-1])]


def test_bash_is_answered_by_the_program_itself():
    environment = {
        **os.environ, "_SKILLFRAME_COMPLETE": "bash_complete", "COMP_WORDS": "skillframe plu", "COMP_CWORD": "1"
    }  # fmt: skip
    code = "from skillframe.cli.main import main; main([])"
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=False)
    assert done.stdout == "plain,plugins\n"


@pytest.mark.parametrize(
    ("words", "names"),
    [
        (["run", "x.json", "--robot", "pan"], ["panda", "panda_encoders", "panda_position", "panda_servo"]),
        (["run", "x.json", "--world", "peg"], ["peg_in_hole"]),
        (["robots", "hiab"], ["hiab_xs031"]),
        (["worlds", "val"], ["valley"]),
        (["export", "x.json", "--to", "cri"], ["crisp"]),
        (["fmu", "bu"], ["build"]),
    ],
)
def test_a_shell_completes_commands_and_names(words, names):
    assert completed(*words) == names


@pytest.mark.needs_plugins
def test_a_shell_completes_what_plugins_provide():
    assert completed("learn", "x.npz", "--skill", "dm") == ["dmp"]
    assert completed("segment", "x.npz", "--segmenter", "wr") == ["wrench_hmm"]

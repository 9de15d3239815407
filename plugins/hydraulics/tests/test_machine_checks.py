"""What `robots --check` says of a machine with loops, and that `robots` closes them."""

import json
import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from skillframe_hydraulics.checks.figures import BELOW, NEEDED, NOT_NEGATIVE, POSITIVE, unfit_figures
from skillframe_hydraulics.cylinder import bank
from skillframe_hydraulics.law.vdc_actuator import cylinders

from skillframe.cli.main import run
from skillframe.errors import InputError
from skillframe.execution.prepare import load_robot_model
from skillframe.extend.drives import audit
from skillframe.robot.chain import ClosedChain
from skillframe.robot.describe import as_json, describe
from skillframe.robot.model import load_model
from skillframe.robot.spec import load_robot, robot_names
from skillframe.robot.tables import Actuation


@pytest.fixture
def changed(tmp_path):
    """The shipped crane with robot.toml changed: (old, new), each old text occurs."""

    def change(*pairs):
        folder = tmp_path / "crane"
        shutil.copytree(robot_names()["hiab_xs031"], folder, dirs_exist_ok=True)
        text = (folder / "robot.toml").read_text(encoding="utf-8")
        for old, new in pairs:
            assert old in text
            text = text.replace(old, new)
        (folder / "robot.toml").write_text(text, encoding="utf-8")
        return load_model(load_robot(folder))

    return change


def warnings(robot):
    result = audit(robot)
    assert result.usable == all(problem.code != "cannot_run" for problem in result.problems)
    return {problem.code: problem.message for problem in result.problems if problem.severity != "info"}


def test_nothing_is_wrong_with_the_shipped_crane(changed):
    assert warnings(changed()) == {}


def test_static_friction_that_is_not_given_is_the_coulomb_friction_and_check_says_so(changed, monkeypatch):
    """As the FMUs are opened and each trial's are set; the FMU's own default is 4000 N, the shipped crane's."""
    monkeypatch.setattr(bank, "open_cylinders", lambda specs, trials, folder: specs)
    monkeypatch.setattr("skillframe.fmu.opening._KEPT", {})
    robot = changed(("coulomb_friction = 4000.0", "coulomb_friction = 1500.0"), ("static_friction = 4000.0, ", ""))
    assert "static_friction" not in warnings(robot)  # own-crane.md allows it
    text = next(problem.message for problem in audit(robot).problems if problem.code == "static_friction")
    assert text.startswith("no static_friction is given for lift_piston, tilt_piston, extension")
    for scale in (1.0, 0.7):
        draws = {} if scale == 1.0 else {"actuator.friction_scale": np.array([scale])}
        rows = bank.instance_parameters(robot.spec, draws, np.zeros((1, 3)))
        own = [{**one.parameters, **row} for one, row in zip(bank.banks(robot.spec, 1), rows, strict=True)]
        assert own[0]["coulomb_friction"] == pytest.approx(1500.0 * scale)
        assert [row.get("static_friction", 4000.0) for row in own] == [row["coulomb_friction"] for row in own]


def test_a_loop_that_cannot_be_closed_is_named_with_its_gap(changed):
    robot = changed(('frame_b = "tilt_rod_eye"', 'frame_b = "lift_rod_eye"'))
    found = warnings(robot)["cannot_run"]
    assert re.match(
        r"the loop tilt_eye - lift_rod_eye, open by 1\.\d+e\+03 mm at .* mm in base, cannot be closed near \[home\]",
        found,
    )
    assert "loop: tilt_eye meets lift_rod_eye" in describe(robot)


def test_a_home_that_the_supply_cannot_hold_is_named_with_both_forces(changed):
    found = warnings(changed(("supply_pressure = 190e5", "supply_pressure = 60e5")))
    assert "piston would have to push" in found["impossible_home"]


def test_the_limits_of_an_arm_are_named_on_a_machine(changed):
    found = warnings(changed(("force_n = 15000.0", ""), ("torque_rate_nm_s = 1e7", "")))
    assert set(found) == {"arm_limits"}


def test_show_closes_the_loops_whatever_home_says_of_their_rods(changed):
    given = changed()
    robot = changed(
        ("lift_piston = 0.33", "lift_piston = 0.03"), ("tilt_barrel_pivot = -0.27", "tilt_barrel_pivot = 0.27")
    )
    homes = [joint["home"] for joint in as_json(robot)["joints"]]
    assert np.abs(ClosedChain(robot).gaps(np.array(homes))).max() < 1e-12  # as closed as `configuration` makes them
    np.testing.assert_allclose(homes, given.home, atol=1e-9)
    assert "payload 475 kg in 'end_object', rated for 475 kg" in describe(robot)


LIFT = load_robot("hiab_xs031").actuation[0]


def with_figure(name, value):
    return replace(LIFT, parameters={**LIFT.parameters, name: value})


def test_check_and_the_controller_need_the_same_figures():
    for name in NEEDED:
        rest = {key: value for key, value in LIFT.parameters.items() if key != name}
        bare = [Actuation(joint="lift_piston", fmu=LIFT.fmu, parameters=rest)]
        with pytest.raises(InputError) as refused:
            cylinders(bare)
        assert [unfit.problem for unfit in unfit_figures(bare[0])] == [refused.value.problem]
    only = {name: LIFT.parameters[name] for name in NEEDED}
    one = Actuation(joint="lift_piston", fmu=LIFT.fmu, parameters=only)
    assert unfit_figures(one) == []
    cylinders([one])


@pytest.mark.parametrize("name", NEEDED)
@pytest.mark.parametrize("value", [float("nan"), float("inf"), -1.0, "0.08", [1.0], True, 0.0])
def test_a_figure_that_cannot_be_is_named_with_its_actuator(name, value):
    found = unfit_figures(with_figure(name, value))
    if value == 0.0 and name in NOT_NEGATIVE:
        assert found == []
        return
    assert len(found) == 1
    assert found[0].problem.startswith(f"parameters.{name} of the cylinder on lift_piston is {value!r}; it must be ")


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("rod", 0.08, "has rod 0.08, not below its bore 0.08"),
        ("return_pressure", 191e5, "has return_pressure 1.91e+07, not below its supply_pressure 1.9e+07"),
        ("rated_drop_is_per_edge", "false", "must be true or false"),
        ("deadband", 1.0, "must be below 1"),
        ("spool_frequency", 0.0, "must be greater than zero"),
        ("presliding_length", -1e-4, "must be greater than zero"),
        ("deadvolume_a", 3e-3, "unknown figure 'deadvolume_a'; did you mean 'dead_volume_a'?"),
    ],
)
def test_figures_that_contradict_each_other_or_are_misspelled_are_named(name, value, words):
    assert [words in unfit.problem for unfit in unfit_figures(with_figure(name, value))] == [True]


def test_another_makers_parameters_are_its_own_and_only_what_stands_for_ours_is_judged():
    theirs = replace(LIFT, fmu="winch.fmu", parameters={"stroke": -590, "d": "x"}, nominal=dict(LIFT.parameters))
    assert unfit_figures(theirs) == []
    wrong = replace(theirs, nominal={**LIFT.parameters, "bore": 0})
    assert [unfit.problem[:33] for unfit in unfit_figures(wrong)] == ["nominal.bore of the cylinder on l"]


def test_the_ranges_are_those_that_the_fmu_itself_refuses_outside():
    source = (Path(__file__).parents[3] / "fmus" / "hydraulic_cylinder" / "checks.h").read_text(encoding="utf-8")
    positive, not_negative = (
        {word.lower() for word in re.findall(r"[A-Z_]+", body)} for body in re.findall(r"\[\] = \{([^}]*)\}", source)
    )
    assert POSITIVE - {"supply_pressure"} == positive  # that one is above return_pressure in the source
    assert NOT_NEGATIVE - {"return_pressure"} == not_negative  # ours, as the module says
    for name, limit in BELOW.items():
        assert f"v[{name.upper()}] < {limit}" in source


def test_check_finds_what_a_run_refuses_and_both_say_it_in_the_same_words(changed, tmp_path, capsys):
    robot = changed(("dead_volume_b = 4e-3, ", ""), ("leakage = 1e-16", "leakage = nan"))
    found = [problem for problem in audit(robot).problems if problem.code == "cannot_run"]
    assert "the cylinder on tilt_piston has no dead_volume_b" in [problem.message for problem in found]
    assert sum("parameters.leakage of the cylinder on" in problem.message for problem in found) == 3
    assert run(["robots", "--check", str(tmp_path / "crane"), "--json"]) == 1
    shown = json.loads(capsys.readouterr().out)
    assert [(one["code"], one["severity"]) for one in shown["problems"]] == [("cannot_run", "fatal")] * 4
    assert not shown["usable"]
    with pytest.raises(InputError) as refused:
        load_robot_model(str(tmp_path / "crane"))
    assert str(refused.value) == f"{tmp_path / 'crane' / 'robot.toml'}: {found[0].message}; {found[0].fix}"

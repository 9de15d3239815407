"""Counterbalance valves of described machines: their figures and checks, and a truck crane that presses with one."""

import math
import re

import numpy as np
import pytest
from skillframe_hydraulics.checks.load_holding import at_rest
from skillframe_hydraulics.law import vdc_actuator as act

from plugins.hydraulics.tests.test_working_range import MACHINES, changed, warnings
from skillframe.cli.main import run
from skillframe.errors import InputError
from skillframe.files import checkout
from skillframe.robot import ClosedChain, load_model, load_robot

__all__ = ["changed"]
NAME = "palfinger_pk15500"
WRITTEN = 'counterbalance = { port = "bottom", setting = "210 bar", pilot_ratio = 1.5, flow = "120 l/min at 10 bar" }'
LOAD = 69.2  # bar at home, of the boom's 146.5 kN on its bottom side with 8 bar on the other


def valve(**changes):
    own = {"port": '"bottom"', "setting": '"210 bar"', "pilot_ratio": "1.5", "flow": '"120 l/min at 10 bar"'} | changes
    return f"counterbalance = {{ {', '.join(f'{key} = {value}' for key, value in own.items() if value)} }}"


def test_a_data_sheets_words_are_the_cylinders_figures_in_si():
    boom = next(a for a in load_robot(MACHINES / NAME).actuation if a.joint == "boom_rod").parameters
    assert boom["counterbalance_a"] == pytest.approx(210e5) and boom["pilot_ratio"] == 1.5
    assert boom["counterbalance_flow"] == pytest.approx(2e-3) and boom["counterbalance_drop"] == pytest.approx(10e5)
    own = act.cylinders(load_robot(MACHINES / NAME).actuation).counterbalance
    np.testing.assert_array_equal(own.holds_a, [1.0, 0.0, 0.0, 0.0])
    assert own.counterbalance_edge[0] == pytest.approx(2e-3 / math.sqrt(10e5))


def test_the_rod_port_is_chamber_b_and_the_range_may_be_given(changed):
    folder = changed(NAME, (WRITTEN, valve(port='"rod"', range='"45 bar"')))
    boom = next(a for a in load_robot(folder).actuation if a.joint == "boom_rod").parameters
    assert boom["counterbalance_b"] == pytest.approx(210e5) and boom["counterbalance_range"] == pytest.approx(45e5)


def test_a_motor_has_a_valve_of_its_own_and_none_of_the_cylinders_defaults(changed):
    own = valve(port='"b"')
    folder = changed(
        NAME,
        ("gear = 40\n", f"gear = 40\n{own}\n"),
        ("[defaults.cylinder]", f"[defaults.cylinder]\n{valve()}"),
    )
    figures = {a.joint: a.parameters for a in load_robot(folder).actuation}
    assert figures["slew"]["counterbalance_b"] == figures["stage_1"]["counterbalance_a"] == pytest.approx(210e5)
    assert "counterbalance_a" not in figures["slew"]
    assert "the motor on slew is at the port that its load at home does not press on" in warnings(folder)["low_setting"]


REFUSED = [
    ({"port": '"top"'}, "boom.counterbalance.port: unknown port 'top'"),
    ({"pilot_ratio": "0"}, "boom.counterbalance.pilot_ratio: is 0; give a positive number"),
    ({"pilot_ratio": "-4"}, "boom.counterbalance.pilot_ratio: is -4"),
    ({"setting": '"0 bar"'}, "boom.counterbalance.setting: is 0"),
    ({"setting": '"210 l"'}, "boom.counterbalance.setting: expected a quantity in Pa, got 210 l"),
    ({"flow": '"120 l/min"'}, "boom.counterbalance.flow: is '120 l/min', without the pressure drop"),
    ({"flow": '"120 l/min at 10 l"'}, "boom.counterbalance.drop: expected a quantity in Pa, got 10 l"),
    ({"flow": ""}, "boom.counterbalance: has no flow; write counterbalance = { port"),
    ({"ratio": "3"}, "boom.counterbalance: unknown key 'ratio'; did you mean 'pilot_ratio'"),
]


@pytest.mark.parametrize(("changes", "said"), REFUSED, ids=[said[20:60] for _, said in REFUSED])
def test_a_wrong_valve_is_refused_in_a_sentence(changed, changes, said):
    with pytest.raises(InputError, match=re.escape(said)):
        load_robot(changed(NAME, (WRITTEN, valve(**changes))))


def test_a_valve_that_is_no_table_is_refused(changed):
    with pytest.raises(InputError, match=re.escape("boom.counterbalance: is '210 bar'; write counterbalance = {")):
        load_robot(changed(NAME, (WRITTEN, 'counterbalance = "210 bar"')))


def test_the_pressure_of_the_load_is_that_of_the_balance_of_forces():
    chain = ClosedChain(load_model(load_robot(MACHINES / NAME)))
    force = float(chain.at(chain.minimal(chain.home), np.zeros(4)).holding_force()[0])
    found = at_rest(chain.robot.spec.actuation[0], force)
    area_a, area_b = math.pi / 4 * 0.17**2, math.pi / 4 * (0.17**2 - 0.11**2)
    assert area_a * found.load - area_b * 8e5 == pytest.approx(force, rel=1e-12)
    assert found.load == pytest.approx(LOAD * 1e5, rel=1e-3)
    assert found.opening == pytest.approx(found.load + 1.5 * 8e5, rel=1e-12)


OWN = "the counterbalance valve of the cylinder on boom_rod is"
USUAL = "83.06 to 89.98 bar, 1.2 to 1.3 times the greatest load pressure, or more"
CHECKED = [
    (valve(setting='"80 bar"'), "impossible_home", f"at home {OWN} set to 80 bar, and its load of 69.21 bar opens it by"
     f" itself with the return line's pressure at its pilot: set it to {USUAL}"),
    (valve(setting='"82 bar"'), "low_setting", f"{OWN} set to 82 bar, 1.18 times its load at home; usual are {USUAL}"),
    (valve(port='"rod"'), "low_setting", f"{OWN} at the port that its load at home does not press on"),
    (valve(pilot_ratio="150"), "impossible_home", "opens it by itself"),
    (valve(pilot_ratio="0.2"), "unusual_figure", "pilot_ratio of the cylinder on boom_rod is 0.2 , where 0.5 to 20"),
]  # fmt: skip


@pytest.mark.parametrize(("line", "code", "said"), CHECKED, ids=[said[:40] for _, _, said in CHECKED])
def test_check_holds_the_setting_against_the_load(changed, line, code, said):
    assert said in warnings(changed(NAME, (WRITTEN, line)))[code]


def test_a_setting_in_bar_without_its_unit_is_refused(changed, capsys):
    assert run(["robots", str(changed(NAME, (WRITTEN, valve(setting="210")))), "--check"]) != 0
    printed = capsys.readouterr()
    assert 'did you mean "210 bar"' in printed.out + printed.err


def test_a_valve_at_either_port_is_refused(changed):
    found = warnings(changed(NAME, (WRITTEN, f"{WRITTEN}\ncounterbalance_b = 210e5")))
    assert any("has a counterbalance valve at either port" in message for message in found.values())


def test_a_machine_whose_load_opens_its_valve_does_not_run(changed, capsys):
    folder = changed(NAME, (WRITTEN, valve(setting='"75 bar"')))
    skill = str(checkout() / "docs" / "how-to" / "corner.skill.json")
    assert run(["run", skill, "--world", "pallets", "--robot", str(folder)]) == 2
    assert "opens it by itself" in capsys.readouterr().err


@pytest.mark.slow
def test_a_truck_crane_lowers_its_load_through_the_valve_and_presses_it_into_the_corner(capsys):
    skill = str(checkout() / "docs" / "how-to" / "corner.skill.json")
    assert run(["run", skill, "--world", "pallets", "--robot", str(MACHINES / NAME), "--duration", "40"]) == 0
    assert "success" in capsys.readouterr().out

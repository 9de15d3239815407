"""Figures off by a unit are named, with the unit that was probably meant, and sound machines are let alone."""

import math
import re

import pytest
from skillframe_hydraulics.checks.plausible import CYLINDER_RULES, doubts

from skillframe.errors import InputError
from skillframe.execution.prepare import load_robot_model
from skillframe.extend.drives import audit
from skillframe.robot.model import load_model
from skillframe.robot.spec import load_robot
from skillframe.robot.tables import units_of_figures
from tests.digger import COMMON, write_digger

OFF = [
    ("rated_flow = 5.0e-4", "rated_flow = 30", '"30 l/min"'),
    ("bore = 0.063", "bore = 63", '"63 mm"'),
    ("bore = 0.063", "bore = 6.3", '"6.3 cm"'),
    ("rod = 0.035", "rod = 35", '"35 mm"'),
    ("stroke = 0.5", "stroke = 500", '"500 mm"'),
    ("supply_pressure = 175e5", "supply_pressure = 175", '"175 bar"'),
    ("supply_pressure = 175e5", "supply_pressure = 17.5", '"17.5 MPa"'),
    ("return_pressure = 5e5", "return_pressure = 5", '"5 bar"'),
    ("rated_pressure_drop = 70e5", "rated_pressure_drop = 70", '"70 bar"'),
    ("bulk_modulus = 8e8", "bulk_modulus = 8000", '"8000 bar"'),
    ("bulk_modulus = 8e8", "bulk_modulus = 0.8", '"0.8 GPa"'),
    ("dead_volume_a = 3e-4", "dead_volume_a = 0.3", '"0.3 l"'),
    ("dead_volume_b = 3e-4", "dead_volume_b = 300", '"300 cm3"'),
    ("coulomb_friction = 1500.0", "coulomb_friction = 1.5", '"1.5 kN"'),
    ("viscous_friction = 5000.0", "viscous_friction = 5", '"5 kNs/m"'),
    ("leakage = 1e-16", "leakage = 1e-3", '"0.001 l/min/bar"'),
    ("leakage = 1e-16", "leakage = 1e-16, static_friction = 2", '"2 kN"'),
    ("leakage = 1e-16", "leakage = 1e-16, relief_pressure = 250", '"250 bar"'),
    ("leakage = 1e-16", "leakage = 1e-16, cushion_length = 30", '"30 mm"'),
    ("leakage = 1e-16", "leakage = 1e-16, cushion_flow = 6", '"6 l/min"'),
    ("leakage = 1e-16", "leakage = 1e-16, substep = 0.5", '"0.5 ms"'),
    ("leakage = 1e-16", "leakage = 1e-16, relief_conductance = 1.0", '"1 l/min/bar"'),
    ("leakage = 1e-16", "leakage = 1e-16, presliding_length = 0.5", '"0.5 mm"'),
    ("leakage = 1e-16", "leakage = 1e-16, stribeck_velocity = 10", '"10 mm/s"'),
    ("leakage = 1e-16", "leakage = 1e-16, endstop_stiffness = 1e4", '"10000 N/mm"'),
    ("leakage = 1e-16", "leakage = 1e-16, spool_frequency = 0.03", '"0.03 kHz"'),
    ("leakage = 1e-16", "leakage = 1e-16, laminar_pressure = 1", '"1 bar"'),
    ("leakage = 1e-16", "leakage = 1e-16, initial_pressure = 30", '"30 bar"'),
    ("mass = 60.0\n", "mass = 60000.0\n", '"60000 g"'),
    ("[[loop]]", "[sensors]\npressure = 0.22\n\n[[loop]]", '"0.22 bar"'),
]


@pytest.fixture
def digger(tmp_path):
    def change(*pairs):
        file = write_digger(tmp_path / "digger") / "robot.toml"
        text = file.read_text()
        for old, new in pairs:
            assert old in text, old
            text = text.replace(old, new, 1).replace("rating = 60.0", "rating = 6e4")
        file.write_text(text)
        return tmp_path / "digger"

    return change


@pytest.mark.parametrize(("old", "new", "likely"), OFF)
def test_a_figure_off_by_a_unit_is_refused_by_check_and_run_with_the_unit_that_was_meant(digger, old, new, likely):
    folder = digger((old, new))
    found = [p for p in audit(load_robot(folder)).problems if p.code == "cannot_run"]
    assert found and likely in found[0].fix
    name = re.findall(r"(\w+) = \S+$", new.strip(), re.MULTILINE)[0]
    assert name in found[0].message
    with pytest.raises(InputError, match=re.escape(likely)) as told:
        load_robot_model(folder)
    assert found[0].message in str(told.value)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("boom = 0.9599310885968813", "boom = 55", 'home.boom: 55 is outside .* did you mean "55 deg"?'),
        ("boom_piston = 0.32694513160635985", "boom_piston = 326.9", 'home.boom_piston: 326.9 is .* "326.9 mm"?'),
    ],
)
def test_a_home_in_degrees_or_millimetres_is_refused_with_that_unit(digger, old, new, words):
    with pytest.raises(InputError, match=words):
        load_model(load_robot(digger((old, new))))


def test_a_force_limit_in_kilonewtons_is_doubted_with_that_unit(digger):
    found = audit(load_robot(digger(("force_n = 12000.0", "force_n = 12"), ("1e7", "1e4")))).problems
    assert [(p.code, p.fix) for p in found if "limits." in p.message] == [
        ("unusual_figure", 'did you mean "12 kN"?'), ("unusual_figure", 'did you mean "10000 kNm/s"?')
    ]  # fmt: skip


def test_several_slips_are_all_named_at_once_each_reckoned_with_what_the_others_meant(digger):
    folder = digger(("bore = 0.063", "bore = 63"), ("rated_flow = 5.0e-4", "rated_flow = 30"), ("175e5", "175"))
    found = [p.fix for p in audit(load_robot(folder)).problems if p.code == "cannot_run"]
    assert found == [f"did you mean {likely}?" for likely in ('"63 mm"', '"175 bar"', '"30 l/min"')]


def test_the_sentence_says_what_the_figure_would_mean(digger):
    found = audit(load_robot(digger(("rated_flow = 5.0e-4", "rated_flow = 30")))).problems
    assert found[0].message == (
        "rated_flow of the cylinder on boom_piston is 30 m3/s, which moves a piston of 0.063 m at 9.62e+03 m/s, "
        "where 0.02m/s to 3m/s are usual"
    )


@pytest.mark.parametrize("name", ["hiab_xs031", "digger", "large"])
def test_sound_machines_are_let_alone(digger, name, tmp_path):
    """The crane that ships, a digger of 1.5 t, and cylinders of an excavator of 36 t."""
    big = {
        "bore": 0.311, "rod": 0.212, "stroke": 1.65, "dead_volume_a": 1e-2, "dead_volume_b": 1e-2,
        "rated_flow": 1.17e-2,
        "rated_pressure_drop": 70e5, "bulk_modulus": 1.2e9, "leakage": 1e-16, "coulomb_friction": 8000.0,
        "viscous_friction": 30000.0, "supply_pressure": 350e5, "return_pressure": 5e5,
    }  # fmt: skip
    if name == "large":
        assert list(doubts(CYLINDER_RULES, big)) == []
        return
    robot = load_robot(name) if name == "hiab_xs031" else load_robot(digger())
    assert {p.code for p in audit(robot).problems if p.severity != "info"} == set()


@pytest.mark.parametrize("bore", [0.016, 0.025, 0.1, 0.25, 0.45])
@pytest.mark.parametrize("speed", [0.03, 0.3, 2.5])
def test_cylinders_from_a_servo_to_a_press_are_let_alone(bore, speed):
    area = math.pi / 4 * bore**2
    figures = {
        "bore": bore, "rod": 0.6 * bore, "stroke": 8 * bore, "supply_pressure": 210e5, "return_pressure": 0.0,
        "rated_flow": speed * area, "rated_pressure_drop": 35e5, "bulk_modulus": 1.4e9, "leakage": 1e-13 * area,
        "dead_volume_a": 0.05 * area * bore, "dead_volume_b": 4 * area * bore, "coulomb_friction": 0.01 * area * 210e5,
        "viscous_friction": 0.02 * area * 210e5 / speed,
    }  # fmt: skip
    assert list(doubts(CYLINDER_RULES, figures)) == []


def test_an_exotic_figure_that_no_unit_puts_right_is_doubted_and_runs(digger):
    folder = digger(("rated_flow = 5.0e-4", "rated_flow = 2.0e-5"))
    found = [p for p in audit(load_robot(folder)).problems if p.code == "unusual_figure"]
    assert len(found) == 1 and "at 0.00642 m/s" in found[0].message
    load_robot_model(folder)


def test_each_rule_is_about_a_figure_of_the_cylinder_in_its_own_unit():
    units = units_of_figures("hydraulic_cylinder")
    assert {rule.name: rule.unit for rule in CYLINDER_RULES} == {rule.name: units[rule.name] for rule in CYLINDER_RULES}
    needed = {name.split(" =")[0] for name in COMMON.split(", ")}
    assert needed <= {rule.name for rule in CYLINDER_RULES}


def test_a_cylinder_on_a_joint_that_turns_is_refused_by_check_and_run(digger):
    folder = digger(('joint = "boom_piston"', 'joint = "boom_barrel_pivot"'))
    words = "the cylinder on boom_barrel_pivot drives a joint that is revolute, and a cylinder slides"
    assert words in [p.message for p in audit(load_robot(folder)).problems if p.code == "cannot_run"]
    with pytest.raises(InputError, match=words):
        load_robot_model(folder)

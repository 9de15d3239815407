"""Numbers with a unit wherever robot.toml has one: the file is read as if they were typed in SI."""

import math
import re

import pytest

from skillframe.config.units import parse, unit_of
from skillframe.errors import InputError
from skillframe.robot.spec import load_robot
from skillframe.robot.tables import units_of_figures
from tests.digger import write_digger

PLAIN = {
    "bore = 0.063": 'bore = "63 mm"',
    "rod = 0.035": 'rod = "3.5cm"',
    "dead_volume_a = 3e-4": 'dead_volume_a = "0.3 l"',
    "dead_volume_b = 3e-4": 'dead_volume_b = "300 cm3"',
    "rated_flow = 5.0e-4": 'rated_flow = "30 l/min"',
    "stroke = 0.5": 'stroke = "500mm"',
    "rated_pressure_drop = 70e5": 'rated_pressure_drop = "7 MPa"',
    "bulk_modulus = 8e8": 'bulk_modulus = "0.8 GPa"',
    "leakage = 1e-16": 'leakage = "6e-7 l/min/bar"',
    "coulomb_friction = 1500.0": 'coulomb_friction = "1.5 kN"',
    "viscous_friction = 5000.0": 'viscous_friction = "5 kN s/m"',
    "supply_pressure = 175e5": 'supply_pressure = "175 bar"',
    "return_pressure = 5e5": 'return_pressure = "5 bar"',
    "boom = 0.9599310885968813": 'boom = "55 deg"',
    "boom_piston = 0.32694513160635985": 'boom_piston = "326.94513160635985 mm"',
    "rate_hz = 1000": 'rate_hz = "1 kHz"',
    "force_n = 12000.0": 'force_n = "12 kN"',
    "torque_rate_nm_s = 1e7": 'torque_rate_nm_s = "1e4 kNm/s"',
    "fixture = [1.95, 0.0, 0.0]": 'fixture = ["1950 mm", 0.0, "0 cm"]',
    "mass = 60.0\n": 'mass = "0.06 t"\n',
}
MORE = """
[motor_inertia]
boom = 0.3
boom_piston = 2.0

[dynamics.joint]
boom = { friction = 3.0, damping = 2.0 }
boom_piston = { friction = 30.0, damping = 2000.0 }

[inertia]
stick = { mass = 60.0, com = [0.4, 0.0, 0.05], inertia = [0.35, 7.0, 7.0, 0.0, 0.0, 0.0] }
"""
TYPED = {
    "boom = 0.3": 'boom = "0.3 kg m^2"',
    "boom_piston = 2.0": 'boom_piston = "2000 g"',
    "friction = 3.0, damping = 2.0": 'friction = "3 Nm", damping = "2 N m s/rad"',
    "friction = 30.0, damping = 2000.0": 'friction = "0.03 kN", damping = "2 N.s/mm"',
    "mass = 60.0, com = [0.4,": 'mass = "60 kg", com = ["40 cm",',
    "inertia = [0.35,": 'inertia = ["0.35 kg m2",',
}


def edited(folder, *changes):
    file = write_digger(folder) / "robot.toml"
    text = file.read_text() + MORE
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new)
    file.write_text(text)
    return load_robot(folder)


def close(one, other, where=""):
    """Equal, numbers to 1e-12: the digits of a unit's factor."""
    if isinstance(one, dict):
        assert one.keys() == other.keys()
        for key in one:
            close(one[key], other[key], f"{where}.{key}")
    elif isinstance(one, list | tuple):
        for i, (a, b) in enumerate(zip(one, other, strict=True)):
            close(a, b, f"{where}[{i}]")
    elif isinstance(one, float):
        assert other == pytest.approx(one, rel=1e-12), where
    else:
        assert one == other, where


def test_a_machine_typed_with_units_is_the_machine_typed_in_si(tmp_path):
    from dataclasses import asdict

    plain = asdict(edited(tmp_path / "a" / "digger"))
    typed = asdict(edited(tmp_path / "b" / "digger", *PLAIN.items(), *TYPED.items()))
    for key in ("folder", "urdf"):
        plain.pop(key), typed.pop(key)
    close(plain, typed)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("bore = 0.063", 'bore = "63 bar"', r"actuation of boom_piston: parameters.bore: expected a quantity in m,"),
        ("rated_flow = 5.0e-4", 'rated_flow = "30 lpm"', r"got 30 lpm, and 'lpm' is no unit .* units m3/s, l/min"),
        ("supply_pressure = 175e5", 'supply_pressure = "175 m"', "expected a quantity in Pa, got 175 m"),
        ("boom = 0.9599310885968813", 'boom = "55 mm"', r"home.boom: expected a quantity in rad, got 55 mm"),
        ("boom_piston = 0.32694513160635985", 'boom_piston = "3deg"', r"home.boom_piston: expected a quantity in m"),
        ("boom = 0.3\n", 'boom = "3 kg"\n', r"motor_inertia.boom: expected a quantity in kg m\^2, got 3 kg"),
        ("friction = 3.0", 'friction = "3 N"', r"dynamics.joint.boom.friction: expected a quantity in N m, got 3 N"),
        ("force_n = 12000.0", 'force_n = "12 kg"', "limits.force_n: expected a quantity in N, got 12 kg"),
        ("force_n = 12000.0", 'force_n = "12 kNN"', "got 12 kNN, and 'kNN' is no unit that is known"),
        ("mass = 60.0\n", 'mass = "60 N"\n', "payload.mass: expected a quantity in kg"),
    ],
)  # fmt: skip
def test_a_unit_of_another_dimension_or_an_unknown_one_is_one_sentence(tmp_path, old, new, words):
    with pytest.raises(InputError, match=words) as told:
        edited(tmp_path / "digger", (old, new))
    assert "\n" not in str(told.value)


def test_nominal_figures_of_another_makers_cylinder_take_units_and_its_own_parameters_are_left_to_it(tmp_path):
    spec = edited(
        tmp_path / "digger",
        ('fmu = "hydraulic_cylinder"', 'fmu = "other.fmu"\nnominal = { bore = "63mm" }'),
        ("bore = 0.063", 'bore = "6.3 words"'),
    )
    assert spec.actuation[0].nominal == {"bore": pytest.approx(0.063)}
    assert spec.actuation[0].parameters["bore"] == "6.3 words"


def test_every_figure_of_the_cylinder_and_the_servo_has_a_unit_that_can_be_typed():
    """But for 1/s, and N m/A and A of the servo, which nobody writes otherwise."""
    for fmu in ("hydraulic_cylinder", "electric_servo"):
        assert units_of_figures(fmu)
    units = units_of_figures("hydraulic_cylinder")
    assert {units[k] for k in ("bore", "dead_volume_a", "rated_flow", "leakage", "viscous_friction")} == {
        "m", "m3", "m3/s", "m3/(s Pa)", "N s/m"
    }  # fmt: skip
    assert units_of_figures("electric_servo")["rotor_inertia"] == "kg m^2"


def test_a_unit_may_be_spelt_as_people_do():
    for text in ("3 N m", "3 N.m", "3Nm", "3 N\N{MIDDLE DOT}m"):
        assert parse(text) == (3.0, "N m")
    assert parse("40 cm^2") == parse("40 cm\N{SUPERSCRIPT TWO}") == parse("40cm2")
    assert parse("1500 rpm").value == pytest.approx(1500 * math.tau / 60)
    assert parse("90\N{DEGREE SIGN}").value == pytest.approx(math.pi / 2)
    assert unit_of("of a joint [N m or N]") == "N m or N"
    assert re.fullmatch("", unit_of("of a joint [N m or apples]"))

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from skillframe_worlds.peg_in_hole import PegParams

from skillframe.config import build, parse_setting
from skillframe.config.units import UNITS, doubt, parse, si, unit_of
from skillframe.errors import InputError
from skillframe.execution.prepare import split_settings


@pytest.mark.parametrize(
    ("text", "key", "value"),
    [
        ("start.offset_x=8mm", "start.offset_x", 0.008),
        ("start.offset_x=-.8cm", "start.offset_x", -0.008),
        ("start.tilt_y=5deg", "start.tilt_y", math.radians(5.0)),
        ("start.tilt_y=0.1", "start.tilt_y", 0.1),  # a bare number is SI
        ("sensor.force_noise=20N", "sensor.force_noise", 20.0),
        ("actuator.delay=20ms", "actuator.delay", 0.02),
        ("robot.joint_friction=0.5Nm", "robot.joint_friction", 0.5),
        ("robot.payload=1.5e2kg", "robot.payload", 150.0),
    ],
)
def test_a_quantity_of_a_trial_takes_the_unit_that_is_typed(text, key, value):
    _, draws = split_settings("peg_in_hole", dict([parse_setting(text)]))
    assert draws[key] == pytest.approx(value, rel=1e-15)


def test_a_parameter_of_a_world_takes_the_unit_that_is_typed():
    params, _ = split_settings("peg_in_hole", dict([parse_setting("world.clearance=0.3mm")]))
    assert build(PegParams, params, "peg").clearance == pytest.approx(0.0003, rel=1e-15)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("start.offset_x=5deg", "expected a quantity in m, got 5deg; give it with one of the units m, cm, mm, um"),
        ("start.tilt_x=8mm", "expected a quantity in rad, got 8mm"),
        ("robot.mass_scale=2kg", "expected a number without a unit, got 2kg; leave the unit out"),
        (
            "start.offset_x=8furlongs",
            "expected a quantity in m, got 8furlongs, and 'furlongs' is no unit that is known",
        ),
    ],
)
def test_a_wrong_dimension_is_refused_by_name(text, said):
    with pytest.raises(InputError) as caught:
        split_settings("peg_in_hole", dict([parse_setting(text)]))
    assert said in str(caught.value) and text.partition("=")[0] in str(caught.value)


def test_a_wrong_dimension_of_a_world_s_parameter_is_refused():
    with pytest.raises(InputError, match=r"clearance: expected a quantity in m, got 3N"):
        build(PegParams, {"clearance": "3N"}, "peg")
    with pytest.raises(InputError, match="expected a number without a unit, got 3mm"):
        build(PegParams, {"friction": "3mm"}, "peg")


@given(st.floats(-1e6, 1e6), st.sampled_from(sorted(UNITS)))
def test_a_number_with_any_unit_is_read_as_that_many_of_its_factor(number, word):
    unit, factor = UNITS[word]
    assert si(f"{number!r}{word}", unit, "x") == number * factor
    assert si(f" {number!r} {word} ", unit, "x") == number * factor


@pytest.mark.parametrize("text", ["mm", "8", "1e5", "nanmm", "styrofoam", "8,5 mm", ""])
def test_what_is_no_number_with_a_unit_stays_text(text):
    assert parse(text) is None
    assert si(text, "m", "x") == text


@pytest.mark.parametrize("text", ["8mmm", "8m m", "0x8mm", "8 k N", "8 furlongs"])
def test_a_number_with_a_unit_that_nobody_knows_is_refused(text):
    assert parse(text) is None
    with pytest.raises(InputError, match="is no unit that is known; give it with one of the units m, cm, mm, um"):
        si(text, "m", "x")


@pytest.mark.parametrize(
    ("about", "unit"),
    [("of the peg [m].", "m"), ("[1, 2] angle [rad]", "rad"), ("torque [Nm]", "N m"), ("a count", ""), ("of [6]", "")],
)
def test_a_text_states_its_unit_in_brackets(about, unit):
    assert unit_of(about) == unit


@pytest.mark.parametrize(
    ("key", "value", "unit", "default", "doubted"),
    [
        ("start.offset_x", 8, "m", 0.0, "type start.offset_x=8mm"),
        ("start.offset_x", 0.2, "m", 0.0, ""),
        ("world.clearance", 0.25, "m", 0.00025, "type world.clearance=0.25mm"),
        ("world.clearance", 0.002, "m", 0.00025, ""),
        ("world.clearance", 0.0251, "m", 0.00025, "type world.clearance=0.0251mm"),
        ("world.clearance", 0.0249, "m", 0.00025, ""),
        ("start.offset_x", 1.0, "m", 0.0, "type start.offset_x=1mm"),
        ("start.tilt_y", -5.0, "rad", 0.0, "type start.tilt_y=-5deg"),
        ("start.tilt_y", 0.35, "rad", 0.0, ""),
        ("world.slope", 1.3, "rad", 0.785, ""),
        ("start.offset_x", "8m", "m", 0.0, ""),  # the unit was typed
        ("robot.mass_scale", 100.0, "", 1.0, ""),
    ],
)
def test_bare_numbers_that_look_like_millimetres_or_degrees_are_doubted(key, value, unit, default, doubted):
    text = doubt(key, value, unit, default)
    assert doubted in text and bool(doubted) == bool(text)

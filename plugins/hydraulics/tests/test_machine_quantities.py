"""Quantities of a trial that a hydraulic machine has, and those that would do nothing on it."""

import numpy as np
import pytest

from skillframe.config import parse_setting
from skillframe.errors import InputError
from skillframe.execution.prepare import split_settings
from skillframe.extend.drives import check_quantities
from skillframe.robot.model import load_model
from skillframe.robot.spec import load_robot


def test_a_pressure_takes_the_unit_that_is_typed():
    _, draws = split_settings("peg_in_hole", dict([parse_setting("actuator.supply_pressure=180bar")]))
    assert draws["actuator.supply_pressure"] == pytest.approx(18e6, rel=1e-15)


@pytest.mark.parametrize(
    ("value", "message"),
    [
        (5.0, r"5 s is beyond 0s to 1s, .*; did you mean 5ms\?"),
        (-0.01, "-0.01 s is beyond 0s to 1s.*; give 0s to 1s$"),
        (1e7, "1e.07 s is beyond 0s to 1s.*; give 0s to 1s$"),
        (np.nan, "nan s is beyond"),
    ],
)
def test_a_delay_that_no_valve_has_is_refused_with_its_unit(value, message):
    crane = load_model(load_robot("hiab_xs031"))
    check_quantities({"actuator.delay": np.array([0.0, 1.0])}, crane)
    with pytest.raises(InputError, match=f"actuator.delay: {message}"):
        check_quantities({"actuator.delay": np.array([0.01, value])}, crane)


@pytest.mark.parametrize("key", ["sensor.force_noise", "sensor.torque_bias_x", "start.tilt_y"])
def test_what_would_do_nothing_on_a_hydraulic_machine_is_refused_there_and_taken_elsewhere(key):
    draws = {key: np.array([0.1])}
    check_quantities(draws, load_model(load_robot("panda")))
    with pytest.raises(InputError, match=f"{key}: hiab_xs031 (has no wrench sensor|does not turn its tool)"):
        check_quantities(draws, load_model(load_robot("hiab_xs031")))


@pytest.mark.parametrize("key", ["actuator.deadband", "actuator.supply_pressure", "robot.nominal_payload"])
@pytest.mark.parametrize("name", ["panda", "panda_servo"])
def test_quantities_of_hydraulic_machines_are_refused_elsewhere(name, key):
    with pytest.raises(InputError, match=f"{key}: {name} has no drive with such a quantity; leave it out"):
        check_quantities({key: np.array([0.01])}, load_model(load_robot(name)))

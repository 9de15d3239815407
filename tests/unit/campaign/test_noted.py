"""What a campaign writes down of the set-up its trials run with."""

import json

import pytest

from skillframe.campaign.evaluate import setup_notes
from skillframe.execution.drive import Setup
from skillframe.execution.prepare import load_robot_model, load_world
from skillframe.world.quantities import SensorSettings

pytestmark = pytest.mark.needs_plugins


def notes(robot):
    setup = Setup(
        robot=load_robot_model(robot), scene=load_world("free", {}), sensors=SensorSettings(force_noise=0.7)
    )  # fmt: skip
    return json.loads(json.dumps(setup_notes(setup)))


def test_an_arm_s_limits_sensors_and_quantities_are_written_down():
    found = notes("panda")
    assert (found["drive"], found["base"], found["limits"]["force_n"]) == ("", "fixed", 80.0)
    assert found["sensors"]["force_noise"] == 0.7
    assert found["nominal"]["robot.mass_scale"] == 1.0
    assert not any(name.startswith(("actuator.", "fault.")) for name in found["nominal"])
    assert found["encoders"] == ""
    assert notes("panda_encoders")["encoders"].startswith("17 bits a turn")


def test_a_machine_has_cylinders_their_quantities_and_no_wrist_sensor():
    found = notes("hiab_xs031")
    assert found["drive"] == "hydraulic"
    assert "pressure" in found["sensors"]
    assert found["nominal"]["actuator.delay"] == 0.0
    assert not any(name.startswith(("sensor.force", "sensor.torque")) for name in found["nominal"])
    assert found["nominal"]["fault.time"] == found["nominal"]["sensor.pressure_frozen"] == 0.0


def test_servos_are_no_ideal_torques():
    found = notes("panda_servo")
    assert found["drive"] == "servo"
    assert {n for n in found["nominal"] if n.startswith("actuator.")} == {"actuator.friction_scale", "actuator.delay"}

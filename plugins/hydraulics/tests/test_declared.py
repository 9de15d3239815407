"""[sensors], [gains] and gains of actuators in robot.toml: read with units, refused where no machine has them."""

import math
import shutil

import pytest
from skillframe_hydraulics.declared import Gains, MachineNoise, gains_of, noise_of, require_declared

from skillframe.errors import InputError
from skillframe.execution.prepare import load_robot_model
from skillframe.extend.drives import require_driven
from skillframe.robot.model import load_model
from skillframe.robot.spec import load_robot, robot_names
from tests.digger import write_digger

DRIVEN = '[[actuation]]\njoint = "j"\nfmu = "x"\n'


@pytest.mark.parametrize(
    ("toml", "sentence"),
    [
        ("[sensors]\nencoder = -1e-4", r"sensors\.encoder: is -0\.0001; give 0 to 0\.1 rad"),
        ("[sensors]\ncorner_hz = 0.0", r"sensors\.corner_hz: is 0; give 5 Hz or more"),
        ("[sensors]\nencoder = 4096.0", r"sensors\.encoder: is 4096; give 0 to 0\.1 rad"),
        ("[sensors]\npressure = 190e5", r"sensors\.pressure: is 1\.9e\+07; give 0 to 1e\+07 Pa"),
        ("[gains]\nforce_corner_hz = 1.0", r"gains\.force_corner_hz: is 1; give 5 Hz or more"),
        ("[sensors]\nnoise = 1.0", "noise"),
        ("[gains]\nbody = -5.0", r"gains\.body: is -5; give 0 N s/m or more"),
        ("[gains]\nbody = nan", r"gains\.body: is not a number"),
        ("velocity_gain = -1.0", r"actuation of j: velocity_gain: is -1; give a positive"),
    ],
)
def test_what_no_hydraulic_machine_has_is_refused_with_its_key(save, urdf, toml, sentence):
    spec = load_robot(save(urdf.tree(0, 2), DRIVEN + toml))
    with pytest.raises(InputError, match=sentence):
        require_declared(spec)


def test_a_run_refuses_what_is_declared_wrongly(tmp_path):
    machine = load_model(load_robot(write_digger(tmp_path, "[gains]\nbody = -5.0")))
    with pytest.raises(InputError, match=r"gains\.body: is -5; give 0 N s/m or more"):
        require_driven(machine)


def test_sensors_and_gains_take_units(tmp_path):
    typed = f"""[sensors]
encoder = "{math.degrees(0.0002)!r} deg"
pressure = "0.22 bar"
corner_hz = "0.024kHz"

[gains]
body = "1 kNs/m"
"""
    spec = load_robot(write_digger(tmp_path, typed))
    # the digits of a unit's factor
    assert noise_of(spec).encoder == pytest.approx(0.0002, rel=1e-12)
    assert noise_of(spec) == MachineNoise(encoder=noise_of(spec).encoder, pressure=22000.0, corner_hz=24.0)
    assert gains_of(spec) == Gains(body=1000.0)


def test_a_unit_of_another_dimension_is_refused(tmp_path):
    spec = load_robot(write_digger(tmp_path, '[sensors]\nencoder = "1 s"'))
    with pytest.raises(InputError, match=r"sensors\.encoder: expected a quantity in rad or m, got 1 s"):
        noise_of(spec)


def test_without_a_kind_actuators_are_cylinders_and_what_they_lack_names_the_cure(tmp_path):
    for name in ("panda", "panda_servo"):
        shutil.copytree(robot_names()[name], tmp_path / name)
    file = tmp_path / "panda_servo" / "robot.toml"
    file.write_text(file.read_text().replace('[drive]\nkind = "servo"\n', ""))
    with pytest.raises(InputError, match=r'write \[drive\] kind = "servo" if it is a servo'):
        load_robot_model(str(file))

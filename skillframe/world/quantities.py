"""What can differ between the trials of one batch, each with its unit, its nominal value and a line about it."""

from __future__ import annotations

from math import pi
from typing import NamedTuple

from skillframe.config.ranges import Range
from skillframe.signals.delay import LONGEST_DELAY


class Varied(NamedTuple):
    """A quantity of a trial.

    Attributes:
        name: as typed after --set and in `[vary]`.
        unit: SI; "" for a plain number.
        nominal: where it is not set; None where robot or world decide.
        about: one line.
        range: beyond it a number is a typing mistake, or one in another unit.
    """

    name: str
    unit: str
    nominal: float | None
    about: str
    range: Range | None = None


_MOVED = {
    "start": "where the tool's tip starts, from the nominal start, in the nominal fixture's axes",
    "fixture": "where the fixture truly stands, which nobody tells the robot",
    "grasp": "how the tool truly sits in the grip, which nobody tells the robot",
}
_NEAR = Range(-3.0, 3.0, "as no arm or crane works further from where it begins")
_FAR = {"start": _NEAR, "fixture": _NEAR, "grasp": Range(-0.5, 0.5, "as no tool is held further from its grip")}
_LEAN = Range(-pi / 2.0, pi / 2.0, "as what leans more lies upside down")
_TURN = Range(-pi, pi, "half a turn to either side")
_POSES = [
    Varied(f"{group}.offset_{axis}", "m", 0.0, f"{about}: along {axis}", _FAR[group])
    if kind == "offset"
    else Varied(f"{group}.tilt_{axis}", "rad", 0.0, f"{about}: turned about {axis}", _TURN if axis == "z" else _LEAN)
    for group, about in _MOVED.items()
    for kind in ("offset", "tilt")
    for axis in "xyz"
]
_FORCE = Range(-1000.0, 1000.0, "the full scale of large wrist sensors")
_TORQUE = Range(-100.0, 100.0, "the full scale of large wrist sensors")
_BIASES = [
    Varied(f"sensor.{kind}_bias_{axis}", unit, None, f"{kind} bias along {axis} before the tare; else drawn", limits)
    for kind, unit, limits in (("force", "N", _FORCE), ("torque", "N m", _TORQUE))
    for axis in "xyz"
]
_SWITCH = Range(0.0, 1.0, "1 where it is broken, else 0")
_HOLE = Range(0.0, 1e-2, "a hole of 11 cm, beyond all hoses")
FAULTS = (
    Varied("sensor.pressure_frozen", "", 0.0, "1: both pressures of the cylinder repeat their last reading", _SWITCH),
    Varied("sensor.pressure_zero", "", 0.0, "1: both pressures of the cylinder read zero", _SWITCH),
    Varied("sensor.encoder_step", "rad", 0.0,
           "jump of the encoder of the joint that the cylinder moves; m if it slides", _TURN),
    Varied("sensor.encoder_frozen", "", 0.0, "1: that encoder repeats its last reading", _SWITCH),
    Varied("actuator.stuck", "", 0.0, "1: the valve's spool stays where it then is, whatever it is told", _SWITCH),
    Varied("actuator.runaway", "", 0.0,
           "where the valve's spool goes whatever it is told, -1 to 1 (extends); 0: nowhere",
           Range(-1.0, 1.0, "the spool's travel")),
    Varied("actuator.burst_a", "m2", 0.0, "hole in the hose of the piston side; 1.3e-4 is half an inch wide", _HOLE),
    Varied("actuator.burst_b", "m2", 0.0, "hole in the hose of the rod side", _HOLE),
    Varied("actuator.supply_loss", "", 0.0, "share of the supply pressure above the return line's that fails, for all",
           Range(0.0, 1.0, "a share")),
)  # fmt: skip
"""Faults of a hydraulic machine: what breaks at `fault.time`, at the cylinder `fault.cylinder`."""
_SCALED = {
    "friction_scale": (
        "true friction of a machine's cylinders over what its controller knows",
        Range(0.0, 100.0, "as no guess of it is a hundredfold off"),
    ),
    "valve_scale": (
        "true rated flow of a hydraulic machine's valves over what its controller knows",
        Range(0.01, 100.0, "as no data sheet is a hundredfold off"),
    ),
    "bulk_scale": (
        "true bulk modulus of a hydraulic machine's oil over what its controller knows",
        Range(0.01, 100.0, "as no oil is a hundredfold off"),
    ),
}
CYLINDERS = 3
"""Of a machine in a plane at most; each has factors of its own."""
_CYLINDERS = [
    Varied(f"actuator.{name}_{i}", "", 1.0, f"{about}: of cylinder {i} in robot.toml alone, besides actuator.{name}",
           limits)
    for name, (about, limits) in _SCALED.items()
    for i in range(1, CYLINDERS + 1)
]  # fmt: skip
_LOAD = Range(0.0, 20_000.0, "what the largest machines lift")
VARIED = (
    *_POSES,
    *_BIASES,
    Varied("sensor.force_noise", "N", 0.3, "standard deviation of each force reading, at 1 kHz",
           Range(0.0, 100.0, "a tenth of the full scale of large wrist sensors")),
    Varied("sensor.torque_noise", "N m", 0.02, "standard deviation of each torque reading, at 1 kHz",
           Range(0.0, 10.0, "a tenth of the full scale of large wrist sensors")),
    Varied("robot.mass_scale", "", 1.0, "true masses of the robot over those that its controller knows",
           Range(1e-6, 100.0, "as a robot has mass, and no guess of it is a hundredfold off")),
    Varied("robot.joint_friction", "N m", 0.0, "friction in each joint, which the controller does not know",
           Range(0.0, 1000.0, "more than the joints of large arms are driven with")),
    Varied("robot.payload", "kg", None, "mass that the robot truly carries, where its robot.toml has a [payload]",
           _LOAD),
    Varied("robot.nominal_payload", "kg", None, "mass that a machine's controller is told it carries", _LOAD),
    Varied("actuator.supply_pressure", "Pa", None, "supply pressure of a hydraulic machine",
           Range(1e5, 1e8, "from the air's own pressure to twice what pumps of cranes give")),
    Varied("actuator.deadband", "", None, "dead band of a hydraulic machine's valves, of their full stroke",
           Range(0.0, 0.99, "as a valve without a stroke left moves nothing")),
    *(Varied(f"actuator.{name}", "", 1.0, about, limits) for name, (about, limits) in _SCALED.items()),
    *_CYLINDERS,
    Varied("actuator.delay", "s", 0.0, "delay between command and valve of a hydraulic machine, or servo of an arm",
           Range(0.0, LONGEST_DELAY, "as buses and valves take milliseconds")),
    *FAULTS,
    Varied("fault.time", "s", 0.0,
           "when a machine's fault occurs, from the skill's start; negative in the swing before it",
           Range(-60.0, 3600.0, "from the swing on, and within an hour")),
    Varied("fault.cylinder", "", 1.0, "which cylinder it strikes, counted from 1 in robot.toml's order",
           Range(1.0, 100.0, "one of the machine's cylinders")),
    Varied("world.friction", "", None, "Coulomb coefficient of every contact; the world's own otherwise",
           Range(0.0, 5.0, "several times that of rubber on dry concrete")),
)  # fmt: skip
QUANTITIES = frozenset(each.name for each in VARIED)
"""What can differ between the trials of one batch; other `world.*` parameters need a scene of their own."""
UNITS = {each.name: each.unit for each in VARIED}
RANGES = {each.name: each.range for each in VARIED}

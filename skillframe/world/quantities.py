"""What can differ between the trials of one batch, each with its unit, its nominal value and a line about it."""

from __future__ import annotations

from typing import NamedTuple


class Varied(NamedTuple):
    """A quantity of a trial.

    Attributes:
        name: as typed after --set and in `[vary]`.
        unit: SI; "" for a plain number.
        nominal: where it is not set; None where robot or world decide.
        about: one line.
    """

    name: str
    unit: str
    nominal: float | None
    about: str


_MOVED = {
    "start": "where the tool's tip starts, from the nominal start, in the nominal fixture's axes",
    "fixture": "where the fixture truly stands, which nobody tells the robot",
    "grasp": "how the tool truly sits in the grip, which nobody tells the robot",
}
_POSES = [
    Varied(f"{group}.{kind}_{axis}", unit, 0.0, f"{about}: {what} {axis}")
    for group, about in _MOVED.items()
    for kind, unit, what in (("offset", "m", "along"), ("tilt", "rad", "turned about"))
    for axis in "xyz"
]
_BIASES = [
    Varied(f"sensor.{kind}_bias_{axis}", unit, None, f"{kind} bias along {axis} before the tare; else drawn")
    for kind, unit in (("force", "N"), ("torque", "N m"))
    for axis in "xyz"
]
FAULTS = (
    Varied("sensor.pressure_frozen", "", 0.0, "1: both pressures of the cylinder repeat their last reading"),
    Varied("sensor.pressure_zero", "", 0.0, "1: both pressures of the cylinder read zero"),
    Varied(
        "sensor.encoder_step", "rad", 0.0, "jump of the encoder of the joint that the cylinder moves; m if it slides"
    ),
    Varied("sensor.encoder_frozen", "", 0.0, "1: that encoder repeats its last reading"),
    Varied("actuator.stuck", "", 0.0, "1: the valve's spool stays where it then is, whatever it is told"),
    Varied(
        "actuator.runaway", "", 0.0, "where the valve's spool goes whatever it is told, -1 to 1 (extends); 0: nowhere"
    ),
    Varied("actuator.burst_a", "m2", 0.0, "hole in the hose of the piston side; 1.3e-4 is half an inch wide"),
    Varied("actuator.burst_b", "m2", 0.0, "hole in the hose of the rod side"),
    Varied("actuator.supply_loss", "", 0.0, "share of the supply pressure above the return line's that fails, for all"),
)
"""Faults of a hydraulic machine: what breaks at `fault.time`, at the cylinder `fault.cylinder`."""
VARIED = (
    *_POSES,
    *_BIASES,
    Varied("sensor.force_noise", "N", 0.3, "standard deviation of each force reading, at 1 kHz"),
    Varied("sensor.torque_noise", "N m", 0.02, "standard deviation of each torque reading, at 1 kHz"),
    Varied("robot.mass_scale", "", 1.0, "true masses of the robot over those that its controller knows"),
    Varied("robot.joint_friction", "N m", 0.0, "friction in each joint, which the controller does not know"),
    Varied("robot.payload", "kg", None, "mass that the robot truly carries, where its robot.toml has a [payload]"),
    Varied("robot.nominal_payload", "kg", None, "mass that a machine's controller is told it carries"),
    Varied("actuator.supply_pressure", "Pa", None, "supply pressure of a hydraulic machine"),
    Varied("actuator.deadband", "", None, "dead band of a hydraulic machine's valves, of their full stroke"),
    Varied("actuator.friction_scale", "", 1.0, "true friction of a machine's cylinders over what its controller knows"),
    Varied("actuator.delay", "s", 0.0, "delay between command and valve of a hydraulic machine"),
    *FAULTS,
    Varied(
        "fault.time", "s", 0.0, "when a machine's fault occurs, from the skill's start; negative in the swing before it"
    ),
    Varied("fault.cylinder", "", 1.0, "which cylinder it strikes, counted from 1 in robot.toml's order"),
    Varied("world.friction", "", None, "Coulomb coefficient of every contact; the world's own otherwise"),
)
QUANTITIES = frozenset(each.name for each in VARIED)
"""What can differ between the trials of one batch; other `world.*` parameters need a scene of their own."""
UNITS = {each.name: each.unit for each in VARIED}

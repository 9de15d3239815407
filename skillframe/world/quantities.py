"""Quantities of a trial that `placement`, `plant`, `sensors` and drives read, declared where no simulator is needed."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi
from typing import TYPE_CHECKING

from skillframe.config.units import Quantity, Range
from skillframe.errors import InputError
from skillframe.frames import Float
from skillframe.signals import LONGEST_DELAY

if TYPE_CHECKING:
    from skillframe.robot.model import RobotModel

_NEAR = Range(-3.0, 3.0, "as no arm or crane works further from where it begins")
_LEAN = Range(-pi / 2.0, pi / 2.0, "as what leans more lies upside down")
_TURN = Range(-pi, pi, "half a turn to either side")
_FULL_SCALE = "the full scale of large wrist sensors"


def unfit_payload(masses: Float, robot: RobotModel | None) -> tuple[str, str] | None:
    """What is wrong with payloads (N,) [kg] of a robot, and the fix, or None."""
    if robot is not None:
        from skillframe.robot.payload import with_payload

        try:
            for mass in (min(masses), max(masses)):
                with_payload(robot.spec, mass)
        except InputError as error:
            return error.problem, error.fix
    return None


def _pose(group: str, about: str, far: Range) -> list[Quantity]:
    turns = {"x": _LEAN, "y": _LEAN, "z": _TURN}
    return [
        *(Quantity(f"{group}.offset_{axis}", "m", 0.0, f"{about}: along {axis}", far) for axis in turns),
        *(Quantity(f"{group}.tilt_{a}", "rad", 0.0, f"{about}: turned about {a}", turn) for a, turn in turns.items()),
    ]


def _biases(kind: str, unit: str, limits: Range) -> list[Quantity]:
    about = f"{kind} bias along {{}} before the tare; else drawn"
    return [Quantity(f"sensor.{kind}_bias_{axis}", unit, None, about.format(axis), limits) for axis in "xyz"]


QUANTITIES = (
    *_pose("start", "where the tool's tip starts, from the nominal start, in the nominal fixture's axes", _NEAR),
    *_pose("fixture", "where the fixture truly stands, unknown to the robot", _NEAR),
    *_pose(
        "grasp", "how the tool truly sits in the grip, unknown to the robot",
        Range(-0.5, 0.5, "as no tool is held further from its grip"),
    ),
    *_biases("force", "N", Range(-1000.0, 1000.0, _FULL_SCALE)),
    *_biases("torque", "N m", Range(-100.0, 100.0, _FULL_SCALE)),
    Quantity("sensor.force_noise", "N", 0.3, "standard deviation of each force reading, at 1 kHz",
             Range(0.0, 100.0, f"a tenth of {_FULL_SCALE}")),
    Quantity("sensor.torque_noise", "N m", 0.02, "standard deviation of each torque reading, at 1 kHz",
             Range(0.0, 10.0, f"a tenth of {_FULL_SCALE}")),
    Quantity("robot.mass_scale", "", 1.0, "true masses of the robot over those that its controller knows",
             Range(1e-6, 100.0, "as a robot has mass, and no guess of it is a hundredfold off")),
    Quantity("robot.joint_friction", "N m", 0.0, "friction in each joint, which the controller does not know",
             Range(0.0, 1000.0, "more than the joints of large arms are driven with")),
    Quantity("robot.payload", "kg", None, "mass that the robot truly carries, where its robot.toml has a table payload",
             Range(0.0, 20_000.0, "what the largest machines lift"), unfit=unfit_payload),
    Quantity("world.friction", "", None, "Coulomb coefficient of every contact; the world's own otherwise",
             Range(0.0, 5.0, "several times that of rubber on dry concrete")),
)  # fmt: skip
"""Of every world and robot."""
OF_ACTUATORS = (
    Quantity("actuator.friction_scale", "", 1.0, "true friction of the actuators over what the controller knows",
             Range(0.0, 100.0, "as no guess of it is a hundredfold off")),
    Quantity("actuator.delay", "s", 0.0, "delay between command and actuator",
             Range(0.0, LONGEST_DELAY, "as buses and actuators take milliseconds")),
)  # fmt: skip
"""Of a robot with actuators, whichever drive they have."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorSettings:
    """Standard deviations of sensor noise per 1 kHz sample.

    Attributes:
        force_noise: [N]; moving robots have 0.2 to 0.65 N.
        torque_noise: [Nm].
        force_bias: of the bias sampled per trial [N]; torque_bias: [Nm].
        position_noise: of the tool point from encoders [m]; rotation_noise: [rad].
    """

    force_noise: float = 0.3
    torque_noise: float = 0.02
    force_bias: float = 1.0
    torque_bias: float = 0.05
    position_noise: float = 5e-5
    rotation_noise: float = 3.5e-4


def of_actuators() -> tuple[Quantity, ...]:
    """Return `OF_ACTUATORS`, for the records of drives."""
    return OF_ACTUATORS

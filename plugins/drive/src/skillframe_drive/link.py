"""`Link`: what a plug-in writes to connect a real robot, and the state that the robot reports each period."""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

from skillframe.frames import Float, Pose

SILENT_S = 0.1
"""Time without a state [s] after which a link sets its fault."""
INTERFACES = {"position": "position", "torque": "torque", "impedance": "torque"}
"""Interface of robot.toml that a robot has, by what its link takes: impedance is controlled by joint torques."""


class RobotState(NamedTuple):
    """A robot's report.

    Attributes:
        time: of the robot's own clock [s].
        position: (n,) joint positions [rad], from base to tool.
        velocity: (n,) joint velocities [rad/s].
        wrench: (6,) force [N] and torque [N m] of the environment on the tool at the tool frame's origin, base axes,
            without the payload's weight.
    """

    time: float
    position: Float
    velocity: Float
    wrench: Float


class Spring(NamedTuple):
    """What a robot that takes impedances is sent: equation (1) of `skillframe.skill` at the centre of compliance.

    Attributes:
        desired: pose (1,) in base.
        measured: pose (1,) in base, at which the controller's wrench was computed.
        twist: (6,) measured, base axes.
        stiffness: (6, 6) base axes.
        damping: (6, 6) base axes.
        wrench: (6,) of the controller on the tool, base axes: all of equation (1).
    """

    desired: Pose
    measured: Pose
    twist: Float
    stiffness: Float
    damping: Float
    wrench: Float


class Link(Protocol):
    """A connected robot. After a fault no method but `close` calls the client library.

    Attributes:
        period: [s] between two states.
        takes: "position", "torque" or "impedance", as `skillframe.extend.records.LinkType`.
        fault: the first fault in words, or "".
        missed: states that were never received.
        longest: longest time between two received states [s] of the robot's clock.
    """

    period: float
    takes: str
    fault: str
    missed: int
    longest: float

    def read(self) -> RobotState:
        """Wait for the next state. Without one for 100 ms, set `fault` and return the last."""

    def tare(self) -> None:
        """Zero the robot's own force sensor, where it can."""

    def arm(self) -> None:
        """Begin to take commands. From here on the robot stops by itself when commands fail to come."""

    def send(self, command: Any) -> None:
        """Send joint positions or torques (n,), or a `Spring`, for the next period."""

    def halt(self) -> None:
        """Stop, and hold the position."""

    def close(self) -> None:
        """End the connection."""


class ImpedanceLink(Link, Protocol):
    """A link that takes impedances."""

    def refused(self, command: Spring) -> str:
        """Why the robot cannot take a command, in a sentence, or ""."""

"""A link to a fake arm in the same process, without sockets: time passes when a command is sent or a state is read."""

from __future__ import annotations

import numpy as np
from skillframe_drive.fake import FakeArm
from skillframe_drive.link import RobotState, Spring

from skillframe.frames import Float, pose_error, skew
from skillframe.world.quantities import SensorSettings


def arm(
    robot: str, world: str = "valley", seed: int = 0, noise: float = 0.3, bias: float = 1.0, **settings: float
) -> FakeArm:
    """A fake arm with the quantities `settings`, with "__" for "."."""
    sensors = SensorSettings(force_noise=noise, torque_noise=noise / 15.0, force_bias=bias, torque_bias=bias / 20.0)
    return FakeArm(robot, world, {k.replace("__", "."): v for k, v in settings.items()}, seed, sensors)


class DirectLink:
    """Each `read` advances the arm by one period under the last command.

    Attributes:
        sent: number of commands; log: names of the other calls.
        push: (n,) velocity that the arm is dragged at while it is read [rad/s], for tares that have to be refused.
    """

    missed, longest = 0, 0.0

    def __init__(self, arm: FakeArm, takes: str, period: float) -> None:
        self.arm_, self.takes, self.period, self.fault = arm, takes, period, ""
        self.sent, self.log, self.time = 0, [], 0.0
        self._torque = np.zeros(len(arm.position))
        self.push: Float | None = None
        self.fault_after: float | None = None

    def read(self) -> RobotState:
        for _ in range(round(self.period / self.arm_.dt)):
            if self.push is not None:
                self.arm_.target = self.arm_.target + self.arm_.dt * self.push
            self.arm_.step(self._torque if self.takes == "torque" else None)
        self.time += self.period
        if self.fault_after is not None and self.time > self.fault_after:
            self.fault = self.fault or "planted"
        return RobotState(self.time, self.arm_.position.copy(), self.arm_.velocity.copy(), self.arm_.wrench.copy())

    def tare(self) -> None:
        self.log.append("tare")

    def arm(self) -> None:
        self.log.append("arm")

    def send(self, command: Float) -> None:
        self.sent += 1
        if self.takes == "torque":
            self._torque = command.copy()
        else:
            self.arm_.target = command[None].copy()

    def halt(self) -> None:
        self.log.append("halt")

    def close(self) -> None:
        self.log.append("close")


class ImpedanceDirectLink(DirectLink):
    """A robot that has the impedance controller itself, at the tip, and renders `share` of the stiffness.

    Attributes:
        late: periods by which the feed-forward is late.
    """

    def __init__(self, arm: FakeArm, share: float = 1.0, late: int = 0) -> None:
        super().__init__(arm, "impedance", 0.002)
        self.share, self._spring = share, None
        self._feedforward = [np.zeros(6)] * (late + 1)

    def read(self) -> RobotState:
        for _ in range(2):
            self.arm_.step(self._law())
        self.time += self.period
        return RobotState(self.time, self.arm_.position.copy(), self.arm_.velocity.copy(), self.arm_.wrench.copy())

    def _law(self) -> Float:
        """Torques (n,) above gravity."""
        arm, spring = self.arm_, self._spring
        if spring is None:
            return arm.holding(arm.target[0], 1e4, 200.0)
        jacobian = arm.jacobian.copy()
        jacobian[:3] -= skew((arm.pose.rotation[0] @ arm.tip)[None])[0] @ jacobian[3:]
        error = pose_error(spring.desired, arm.pose.at(arm.tip))[0]
        twist = jacobian @ arm.velocity
        wrench = self.share * spring.stiffness @ error - spring.damping @ twist + self._feedforward[0]
        pull = -2.0 * arm.velocity
        mobility = np.linalg.solve(arm.mass_matrix(), jacobian.T)
        null = pull - jacobian.T @ np.linalg.solve(jacobian @ mobility, mobility.T @ pull)
        return jacobian.T @ wrench + null

    def send(self, command: Spring) -> None:
        self.sent += 1
        error = pose_error(command.desired, command.measured)[0]
        rest = command.wrench - command.stiffness @ error + command.damping @ command.twist
        self._spring, self._feedforward = command, [*self._feedforward[1:], rest]

    def refused(self, command: Spring) -> str:
        return ""

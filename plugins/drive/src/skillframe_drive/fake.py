"""The simulated arm behind a fake robot: the truth that the runner does not see.

A fake is a `FakeController` that speaks a maker's protocol and has a `FakeArm` in place of motors. It shares
skillframe's physics, so that a run through it tests protocol, frames, clock and guards, and says nothing about a real
robot's dynamics.
"""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from skillframe.control import InnerLoop, Motors, joint_limits
from skillframe.execution import OneArm, Setup, load_robot_model, load_world, split_settings
from skillframe.frames import Float, Pose
from skillframe.world import SensorSettings
from skillframe_drive.link import SILENT_S

FAULTS = {
    "protective_stop": "[s] after the first command the robot goes into a protective stop",
    "cut": "[s] after the first command all connections are closed",
    "stall": "[s] after the first command the robot is silent for 200 ms",
    "drift": "[N] the force sensor drifts by in base x as soon as the robot moves",
    "payload": "[kg] mass at the tool's tip that the robot's payload setting lacks",
    "sign": "-1 turns the sign of the measured wrench",
    "tool_axes": "1 reports the wrench in the tool's axes",
    "at_tip": "1 reports the torque at the tool's tip",
    "press": "[N] an operator presses the tip, from 5 s after a client came: down, then along base x and y, 2 s each",
}
"""What can be planted in a fake, and the values."""
PRESSES = ((5.0, 7.0, 2, -1.0), (10.0, 12.0, 0, 1.0), (15.0, 17.0, 1, 1.0))
"""Begin and end [s] after a client came, base axis and sign of the force of each press."""


class Ground(NamedTuple):
    """What became of a fake's task."""

    goal: bool
    error_m: float
    error_rad: float


class FakeArm:
    """One simulated arm in a world, stepped at 1 kHz.

    Attributes:
        urdf: text of the robot's URDF.
        target: (1, n) joint positions that the arm's own position loop goes to [rad].
        wrench: (6,) on the tool at the tool frame's origin, base axes, with noise and bias.
        pressed: (3,) force of an operator on the tip, base axes [N].
        tip: (3,) the tip in the tool frame [m].
    """

    def __init__(self, robot: str, world: str, settings: Mapping[str, Any], seed: int, sensors: SensorSettings) -> None:
        model = load_robot_model(robot)
        params, draws = split_settings(world, settings)
        self._scene = load_world(world, params)
        setup = Setup(robot=model, scene=self._scene, sensors=sensors)
        self.limb = OneArm(setup, {k: np.array([v]) for k, v in draws.items()}, [np.random.default_rng(seed)])
        self.dt = self.limb.dt
        self._motors = Motors(joint_limits(model, self.limb.plant.model), None, 1, self.dt)
        self._control = model.spec.control
        self._all, self._arm = np.arange(1), self.limb.plant.dofs
        self.tip: Float = np.array(self._scene.tool.frames["tip"])
        self.pressed = np.zeros(3)
        self.urdf = model.spec.urdf.read_text(encoding="utf-8")
        self.hold()
        if self._control.interface != "torque":
            self._loop = InnerLoop(self._control.admittance, self.target, self.limb.mass_matrix, self.dt)
        self._read()

    def hold(self) -> None:
        """Hold the present position."""
        self.target = self.limb.joint_positions().copy()

    def holding(self, place: Float, stiffness: float, damping: float) -> Float:
        """Torques (n,) above gravity that hold joint positions (n,), with a stiffness and damping per inertia."""
        error = stiffness * (place - self.position) - damping * self.velocity
        result: Float = self.mass_matrix() @ error
        return result

    def step(self, torque: Float | None = None) -> None:
        """Advance by 1 ms, under the position loop or under joint torques (n,) above gravity [N m]."""
        at = self._kinematics
        if torque is None:
            asked = self._loop.torque(self.target, self.limb.joint_positions(), at.velocity, at.bias)
        else:
            asked = at.bias.copy()
            asked[:, self._arm] += torque
        held = self._motors.held(asked, at.velocity, self.limb.joint_positions())
        self.limb.push(held + self._by_hand() @ at.jacobian[0], self._all)
        self._read()

    def _read(self) -> None:
        self._kinematics = self.limb.kinematics(self._all)
        _, wrench = self.limb.sensors.sample(self._kinematics.pose)
        self.wrench: Float = wrench[0] + self._by_hand()

    def _by_hand(self) -> Float:
        """Wrench (6,) of the operator at the tool frame's origin, base axes."""
        return self.at_origin(self.pressed)

    def at_origin(self, force: Float) -> Float:
        """Wrench (6,) at the tool frame's origin of a force (3,) on the tip, base axes."""
        if not force.any():  # in nearly every millisecond, and numpy's cross takes longer than the simulator's step
            return np.zeros(6)
        return np.concatenate([force, np.cross(self.pose.rotation[0] @ self.tip, force)])

    @property
    def position(self) -> Float:
        """(n,) joint positions [rad]."""
        result: Float = self.limb.joint_positions()[0, self._arm]
        return result

    @property
    def velocity(self) -> Float:
        """(n,) joint velocities [rad/s]."""
        result: Float = self._kinematics.velocity[0, self._arm]
        return result

    @property
    def pose(self) -> Pose:
        """Pose (1,) of the tool frame in base."""
        return self._kinematics.pose

    @property
    def twist(self) -> Float:
        """(6,) twist of the tool frame's origin, base axes."""
        result: Float = (self._kinematics.jacobian @ self._kinematics.velocity[..., None])[0, :, 0]
        return result

    @property
    def jacobian(self) -> Float:
        """(6, n) of the tool frame's origin, base axes."""
        result: Float = self._kinematics.jacobian[0][:, self._arm]
        return result

    def mass_matrix(self) -> Float:
        """(n, n) mass matrix of the arm's joints [kg m^2]."""
        result: Float = self.limb.mass_matrix()[0][np.ix_(self._arm, self._arm)]
        return result

    @property
    def contact_n(self) -> float:
        """True contact force [N]."""
        return float(self.limb.plant.contact_force()[0])

    def ground(self) -> Ground:
        """Whether the task's goal holds, and its errors."""
        state = self.limb.plant.tip_state()
        far, turned = self._scene.goal_error(state)
        return Ground(bool(self._scene.goal(state)[0]), float(far[0]), float(turned[0]))


class FakeController(ABC):
    """The clock of a fake controller and its planted faults, to which a maker's protocol adds the rest.

    Args:
        arm: the simulated robot behind it.
        period: of the controller [s].
        lockstep: wait for a command in each period, so that results do not depend on the machine's speed.
        faults: by the names of `FAULTS`.
        say: receives a line for each event.

    Attributes:
        commands: number of commands taken; missing: number of periods without one, while moving.
        first: time of the first command [s].
    """

    def __init__(
        self, arm: FakeArm, period: float, *, lockstep: bool, faults: Mapping[str, float] | None,
        say: Callable[[str], None],
    ) -> None:  # fmt: skip
        self.arm, self.period, self.lockstep, self.faults, self._say = arm, period, lockstep, dict(faults or {}), say
        self.commands = self.missing = self._cycle = 0
        self.first = np.inf
        self._came: float | None = None

    @property
    def time(self) -> float:
        """Of the controller's clock [s]."""
        return self._cycle * self.period

    def say(self, event: str) -> None:
        """Log an event, with its time."""
        self._say(f"{self.time:.3f} s: {event}")

    def run(self, until: Callable[[], bool]) -> None:
        """Serve until `until` holds."""
        due = time.perf_counter()
        while not until():
            self.serve()
            if self._due("protective_stop"):
                self.protect("planted")
            if self._due("stall"):
                time.sleep(2.0 * SILENT_S)
            if self._due("cut"):
                self.cut()
            self._press()
            self.step()
            self._cycle += 1
            self.publish()
            due += self.period
            if self.lockstep and self.moving:
                due = time.perf_counter()
            elif (left := due - time.perf_counter()) > 0.0:
                time.sleep(left)
            elif left < -0.05:  # too late: begin a new schedule
                due = time.perf_counter()

    def taken(self) -> None:
        """Count a command."""
        if not self.commands:
            self.say("the first command")
        self.commands += 1
        self.first = min(self.first, self.time)

    def loaded(self) -> Float:
        """The wrench (6,) at the sensor, with the weight of a payload that the robot does not know."""
        weight = np.array([0.0, 0.0, -9.81 * self.faults.get("payload", 0.0)])
        loaded: Float = self.arm.wrench + self.arm.at_origin(weight)
        return loaded

    def felt(self, zero: Float) -> Float:
        """The wrench (6,) that the controller reports, less the `zero` of its sensor, with the planted errors."""
        rotation = self.arm.pose.rotation[0]
        force, torque = np.split(self.faults.get("sign", 1.0) * (self.loaded() - zero), 2)
        if self.moving:
            force[0] += self.faults.get("drift", 0.0)
        if self.faults.get("at_tip"):
            torque = torque - np.cross(rotation @ self.arm.tip, force)
        if self.faults.get("tool_axes"):
            force, torque = force @ rotation, torque @ rotation
        return np.concatenate([force, torque])

    def _due(self, fault: str) -> bool:
        """Whether a fault happens now. It happens once."""
        due = self.time - self.first >= self.faults.get(fault, np.inf)
        if due:
            del self.faults[fault]
        return bool(due)

    def _press(self) -> None:
        if "press" not in self.faults or not self.had_clients():
            return
        self._came = self.time if self._came is None else self._came
        self.arm.pressed[:] = 0.0
        for begin, end, axis, sign in PRESSES:
            if begin <= self.time - self._came < end:
                self.arm.pressed[axis] = sign * self.faults["press"]

    @property
    @abstractmethod
    def moving(self) -> bool:
        """Whether commands are expected."""

    @abstractmethod
    def had_clients(self) -> bool:
        """Whether a client is connected."""

    @abstractmethod
    def serve(self) -> None:
        """Answer requests and take a command."""

    @abstractmethod
    def step(self) -> None:
        """Advance the arm by a period."""

    @abstractmethod
    def publish(self) -> None:
        """Send the state to the clients."""

    @abstractmethod
    def protect(self, why: str) -> None:
        """Go into a protective stop."""

    @abstractmethod
    def cut(self) -> None:
        """Close all connections and listen no more."""

    @abstractmethod
    def close(self) -> None:
        """Close all ports."""

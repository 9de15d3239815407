"""Drive with ideal joint torques: sensors, filter, impedance controller, motors and limits.

    encoders, force sensor -> filter -> Observation -> skill -> Command -> impedance -> motors -> torque -> plant

The controller knows only the nominal robot: where masses or grasp vary, a second, nominal batch provides kinematics and
dynamics. It controls a `Limb`: one arm, or the rows of several.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from skillframe.control.controller import ImpedanceController, Reading
from skillframe.control.limits import LimitGuard
from skillframe.control.motors import FrictionCompensation, Motors, joint_limits, unstated
from skillframe.control.ticks import compiled_filter
from skillframe.execution.drive import Setup, Shares, Trials
from skillframe.execution.recorder import Recorder
from skillframe.execution.result import Result
from skillframe.frames import Float, Pose, move_wrench, norm, rotate
from skillframe.signals import CommandDelay, WrenchFilter
from skillframe.skill import Broken, Command, Ended, Impedance, Observation, no_reasons
from skillframe.world.placement import fixture_poses, start_configurations
from skillframe.world.plant import Draws, Kinematics, Plant
from skillframe.world.sensors import TARE_TICKS, JointEncoders, Sensors

HOLD = Impedance(np.diag([2000.0] * 3 + [100.0] * 3))  #: stiffness while a skill does not run [N/m, Nm/rad]
TARED_IN_CONTACT = 0.5
"""Mean true contact force [N] during taring that is reported: the admittance controller's contact threshold.

A sensor alone cannot separate contact from bias.
"""


class Gauge(Protocol):
    """Pose and force-torque sensor of a limb."""

    def sample(self, pose: Pose) -> tuple[Pose, Float]:
        """Measured pose, and the wrench (rows, 6) without weight and bias."""

    def set_tare(self, mean: Float, rotation: Float) -> None:
        """Set the mean wrench (rows, 6) at rest as the bias."""


class Limb(Protocol):
    """What a torque controller senses and moves.

    Attributes:
        plant: the simulated robots.
        rows: one per trial, or per trial and arm.
        dt: [s] between two readings.
        point: centre of compliance in the tool frame, (3,) or (rows, 3).
        sensors: of the tool.
        dofs: generalised velocities of each arm's rows; None where a row has them all.
    """

    plant: Plant
    rows: int
    dt: float
    point: Float
    sensors: Gauge
    dofs: Sequence[NDArray[np.int64]] | None

    def kinematics(self, active: Trials) -> Kinematics:
        """Kinematics of the nominal robots."""

    def mass_matrix(self) -> Float:
        """Mass matrices (rows, nv, nv) of the nominal robots."""

    def joint_positions(self) -> Float:
        """Joint positions (rows, nv)."""

    def push(self, torque: Float, active: Trials) -> list[Broken]:
        """Step the plant under joint torques (rows, nv). Returns trials whose actuators failed."""


class TorqueDrive:
    """A limb with an impedance controller."""

    actuators: tuple[str, ...] = ()

    def __init__(self, setup: Setup, limb: Limb) -> None:
        self.limb, self.plant, self.rows = limb, limb.plant, limb.rows
        self.dt = limb.dt
        self.filter = WrenchFilter(dt=self.dt).steady() if setup.filter_wrench else None
        self._compiled = compiled_filter(self.rows, self.filter)
        self.controller = ImpedanceController(self.rows)
        limits = joint_limits(setup.robot, self.plant.model, limb.dofs)
        rate = setup.limits.torque_rate_nm_s
        self.motors = Motors(limits, rate, self.rows, self.dt) if limits else None
        known = setup.robot.spec.dynamics.compensate
        self._friction = FrictionCompensation(self.plant.model, limb.dofs, self.rows) if known else None
        self._late = round(setup.robot.spec.control.late_s / self.dt)
        self._delay: CommandDelay | None = None
        self._unstated = unstated(setup.robot) if limits else []
        self.guard = LimitGuard(setup.limits, self.rows, self.dt, self.motors)
        self.contact_at_tare = np.zeros(self.plant.count)
        """Mean contact force on the tool during taring (N,) [N], an error of all later forces."""

    def prepare(self) -> list[Broken]:
        """Hold still until the readings settle, and take their mean as the sensor's bias."""
        active = np.arange(self.plant.count)
        kinematics = self.limb.kinematics(active)
        if self._late:
            self._delay = CommandDelay(np.full(self.rows, self._late), kinematics.bias.shape[-1])
            self._delay.start(kinematics.bias)
        hold = Pose(kinematics.pose.position.copy(), kinematics.pose.rotation.copy()).at(self.limb.point)
        still = np.zeros((self.rows, 6))
        command = Command(hold, still, HOLD, still, np.zeros(self.rows, dtype=np.int64), no_reasons(self.rows))
        total, touch = still.copy(), np.zeros(self.plant.count)
        broken: list[Broken] = []
        for _ in range(TARE_TICKS):
            kinematics = self.limb.kinematics(active)
            pose, wrench = self.limb.sensors.sample(kinematics.pose)
            total += wrench
            touch += self.plant.contact_force()
            self._reading = self._read(kinematics, pose.at(self.limb.point))
            self.act(command, 1.0)
            broken += self.limb.push(self._torque, active)
            active = np.setdiff1d(active, [one.row for one in broken]) if broken else active
        self.contact_at_tare = touch / TARE_TICKS
        self.limb.sensors.set_tare(total / TARE_TICKS, self.limb.kinematics(active).pose.rotation)
        return broken

    def sense(self, tick: int, active: Trials) -> Observation:
        """Pose and twist of the centre of compliance, and the filtered wrench there."""
        kinematics = self.limb.kinematics(active)
        tool, raw = self.limb.sensors.sample(kinematics.pose)
        self._position, lever = tool.position, rotate(tool.rotation, self.limb.point)
        if self.filter is None:
            self._wrench = move_wrench(raw, lever)
        else:
            filter_ = self._compiled or self.filter
            if tick == 0:
                filter_.start(raw * 0.0)
            if self._compiled is not None:
                self._wrench = self._compiled.step(raw, lever)
            else:
                self._wrench = move_wrench(self.filter.step(raw), lever)
        self._reading = self._read(kinematics, Pose(tool.position + lever, tool.rotation))
        time = np.full(self.rows, tick * self.dt)
        return Observation(time, self.dt, self._reading.pose, self._reading.twist, self._wrench)

    def act(self, command: Command, ramp: float) -> Float:
        """Compute the motors' torques, and return the controller's wrench (rows, 6)."""
        self._torque, self._law = self.controller.torque(command, self._reading, ramp)
        if self._friction is not None:
            self._torque = self._torque + self._friction.torque(self._reading.velocity)
        if self._delay is not None:
            self._torque = self._delay.step(self._torque)
        if self.motors is not None:
            self._torque = self.motors.held(self._torque, self._reading.velocity, self.limb.joint_positions())
        return self._law

    def violations(self, tick: int, active: Trials) -> list[Broken]:
        """Rows among `active` that broke a limit."""
        return self.guard.violations(self._position, self._reading.twist, self._wrench, self._law, active)

    def advance(self, active: Trials) -> list[Broken]:
        """Step the plant."""
        return self.limb.push(self._torque, active)

    def end(self, rows: Trials) -> None:
        """Do nothing."""

    def contact_torque(self) -> Float:
        """Contact torque (N,) [Nm]."""
        return norm(self.plant.contact_wrench(self.limb.point)[:, 3:])

    def shares(self) -> Shares:
        """Actuator use (rows,)."""
        if self.motors is None:
            unknown = np.full(self.rows, np.nan)
            return Shares(self.guard.energy, unknown, unknown, unknown)
        (torque, speed, place), joints = self.motors.shares()
        return Shares(self.guard.energy, torque, speed, place, joints)

    def notes(self, i: int) -> list[str]:
        """Unlimited motors, and taring in contact."""
        force = self.contact_at_tare[i]
        if not force >= TARED_IN_CONTACT:
            return list(self._unstated)
        wrong = f"the tool touched something while its force sensor was tared: all forces are {force:.1f} N wrong"
        return [*self._unstated, f"{wrong}; start higher"]

    def recording(self, every: int) -> Recorder:
        """A plain recorder."""
        return Recorder(self.plant, every, self.limb.point)

    def outcome(self, result: Result) -> Result:
        """The result, with taring in contact added to failures."""
        started = result.ended_by != Ended.START.value
        for i in np.flatnonzero((self.contact_at_tare >= TARED_IN_CONTACT) & ~result.success & started):
            result.failure[i] = f"{result.failure[i]}, after a tare in contact"
        return result

    def _read(self, kinematics: Kinematics, measured: Pose) -> Reading:
        twist = (kinematics.jacobian @ kinematics.velocity[..., None])[..., 0]
        velocity = kinematics.velocity
        return Reading(measured, twist, kinematics.jacobian, kinematics.bias, velocity, self.limb.mass_matrix)


class OneArm:
    """A robot's own arm, or a free-flying tool, with ideal torques: a `Limb`."""

    dofs: Sequence[NDArray[np.int64]] | None = None

    def __init__(self, setup: Setup, draws: Draws, rngs: Sequence[np.random.Generator]) -> None:
        self.rows, self.dt = len(rngs), 1.0 / setup.robot.spec.control.tick_hz
        self.plant, self.nominal = varied_plants(setup, draws, self.rows)
        self._encoders = encoders_of(setup, self.plant)
        self.point = np.asarray(setup.center_of_compliance, dtype=float)
        self._stiff = setup.robot.spec.mount is None
        self.sensors: Gauge = Sensors(setup.sensors, self.plant, rngs, draws)

    def kinematics(self, active: Trials) -> Kinematics:
        """Kinematics of the nominal robots at the measured joints."""
        if self.nominal is not self.plant:
            qpos, qvel = self.plant.state if self._encoders is None else self._encoders.state
            self.nominal.set_state(*self.nominal.without_mount(qpos, qvel), active)
        return self.nominal.kinematics(self.point)

    def read_encoders(self) -> None:
        """Sample the encoders after a tick."""
        if self._encoders is not None:
            self._encoders.sample(*self.plant.state)

    def mass_matrix(self) -> Float:
        """Mass matrices (N, nv, nv) of the nominal robots."""
        return self.nominal.mass_matrix()

    def joint_positions(self) -> Float:
        """Joint positions (N, nv)."""
        return self.plant.joint_positions if self._stiff else self.plant.positions_without_mount()

    def push(self, torque: Float, active: Trials) -> list[Broken]:
        """Step the plant under generalised forces (N, nv)."""
        self.plant.step(torque, active)
        self.read_encoders()
        return []


def make(setup: Setup, draws: Draws, rngs: Sequence[np.random.Generator]) -> TorqueDrive:
    """The drive of one arm."""
    return TorqueDrive(setup, OneArm(setup, draws, rngs))


def varied_plants(setup: Setup, draws: Draws, count: int) -> tuple[Plant, Plant]:
    """The plant at its starts, and the nominal one: the same object if the robots are nominal.

    Raises:
        UnreachablePose: the robot cannot reach a start.
    """
    robot, scene, dt = setup.robot, setup.scene, 1.0 / setup.robot.spec.control.tick_hz
    fixture = fixture_poses(robot, draws, count)
    plant = Plant(robot, scene, count, fixture, draws, timestep=dt)
    differs = any(key.startswith("grasp.") or key in ("robot.mass_scale", "robot.payload") for key in draws)
    differs = differs or robot.spec.encoders is not None  # measured and true states differ
    differs = differs or robot.spec.mount is not None
    nominal = Plant(robot, scene, count, fixture, {}, timestep=dt, rigid=True) if differs else plant
    plant.reset(start_configurations(robot, scene, draws, count))
    return plant, nominal


def encoders_of(setup: Setup, plant: Plant) -> JointEncoders | None:
    """The encoders of a plant at its starts, or None where the state is known exactly."""
    declared, dt = setup.robot.spec.encoders, 1.0 / setup.robot.spec.control.tick_hz
    return None if declared is None else JointEncoders(declared, plant.model, plant.state[0], dt)

"""Ideal joint torques: sensors, filter, impedance law, motors and limits of arms, and a plant that takes their torques.

    encoders, force sensor -> filter -> Observation -> skill -> Command -> impedance -> motors -> torque -> plant

The law knows the nominal robot only: where masses or the grasp differ from trial to trial, its kinematics and dynamics
come from a second, nominal batch. What it steers is a `Limb`: one arm, or the rows of several.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from skillframe.control.controller import ImpedanceController, Reading
from skillframe.control.endings import Broken
from skillframe.control.joint_friction import FrictionCompensation
from skillframe.control.limits import LimitGuard
from skillframe.control.motors import Motors, joint_limits, unstated
from skillframe.control.ticks import compiled_filter
from skillframe.execution.drive import Shares, Trials
from skillframe.execution.drives.plants import encoders_of, varied_plants
from skillframe.execution.recorder import Recorder
from skillframe.execution.result import Result
from skillframe.execution.setup import Setup
from skillframe.frames import Float, Pose, move_wrench, norm, rotate
from skillframe.signals.delay import CommandDelay
from skillframe.signals.kalman import WrenchFilter
from skillframe.skill import Command, Impedance, Observation, no_reasons
from skillframe.world.plant import Draws, Kinematics, Plant
from skillframe.world.sensors import TARE_TICKS, Sensors

HOLD = Impedance(np.diag([2000.0] * 3 + [100.0] * 3))
TARED_IN_CONTACT = 0.5
"""[N] of true contact, the mean while the sensor is tared, from which a trial says so.

It is what the admittance law takes for no contact. A sensor alone cannot tell contact from its bias, and the simulator
knows the contact (our choice)."""


class Gauge(Protocol):
    """Pose and force-torque sensor of a limb, as `skillframe.world.sensors.Sensors`."""

    def sample(self, pose: Pose) -> tuple[Pose, Float]:
        """Measured pose, and the wrench (rows, 6) without weight and tare."""

    def set_tare(self, mean: Float, rotation: Float) -> None:
        """Take the mean wrench (rows, 6) of a still moment as the bias."""


class Limb(Protocol):
    """What a torque law senses and moves.

    Attributes:
        plant: the simulated robots.
        rows: number of rows: a trial's, or a trial's and arm's.
        point: centre of compliance in the tool frame, (3,) or (rows, 3).
        sensors: of the tool.
        dofs: generalised velocities of each arm's rows; None where a row has them all.
    """

    plant: Plant
    rows: int
    point: Float
    sensors: Gauge
    dofs: Sequence[NDArray[np.int64]] | None

    def kinematics(self, active: Trials) -> Kinematics:
        """Of the nominal robots where the plant's are now."""

    def mass_matrix(self) -> Float:
        """(rows, nv, nv) of the nominal robots."""

    def joint_positions(self) -> Float:
        """(rows, nv)."""

    def push(self, torque: Float, active: Trials) -> list[Broken]:
        """Move the plant by a tick under joint torques (rows, nv). Trials whose actuators failed."""


class TorqueDrive:
    """A limb under an impedance law. Its observations, commands and wrenches have the limb's rows.

    Args:
        setup: robot, scene and settings.
        limb: what is steered.
    """

    actuators: tuple[str, ...] = ()

    def __init__(self, setup: Setup, limb: Limb) -> None:
        self.limb, self.plant, self.rows = limb, limb.plant, limb.rows
        self.dt = 1.0 / setup.robot.spec.control.tick_hz
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
        """(N,) mean force that something put on the tool while its sensor was tared [N]: so far off all forces are."""

    def prepare(self) -> list[Broken]:
        """Hold still, let the readings settle, and take their mean as the sensor's bias."""
        active = np.arange(self.plant.count)
        kinematics = self.limb.kinematics(active)
        self._start_late(kinematics.bias)
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

    def _start_late(self, holding: Float) -> None:
        """Torques that are under way at the start are those (rows, nv) that hold the robots still."""
        if self._late:
            self._delay = CommandDelay(np.full(self.rows, self._late), holding.shape[-1])
            self._delay.start(holding)

    def sense(self, tick: int, active: Trials) -> Observation:
        """Pose and twist of the centre of compliance, and the filtered wrench there."""
        kinematics = self.limb.kinematics(active)
        tool, raw = self.limb.sensors.sample(kinematics.pose)
        self._position, lever = tool.position, rotate(tool.rotation, self.limb.point)
        self._wrench = self._filtered(raw, tick, lever)
        self._reading = self._read(kinematics, Pose(tool.position + lever, tool.rotation))
        time = np.full(self.rows, tick * self.dt)
        return Observation(time, self.dt, self._reading.pose, self._reading.twist, self._wrench)

    def act(self, command: Command, ramp: float) -> Float:
        """Joint torques that the motors give, and the law's wrench (rows, 6), returned."""
        self._torque, self._law = self.controller.torque(command, self._reading, ramp)
        if self._friction is not None:
            self._torque = self._torque + self._friction.torque(self._reading.velocity)
        if self._delay is not None:
            self._torque = self._delay.step(self._torque)
        if self.motors is not None:
            self._torque = self.motors.held(self._torque, self._reading.velocity, self.limb.joint_positions())
        return self._law

    def violations(self, tick: int, active: Trials) -> list[Broken]:
        """Rows among `active` that broke one of the robot's limits."""
        return self.guard.violations(self._position, self._reading.twist, self._wrench, self._law, active)

    def advance(self, active: Trials) -> list[Broken]:
        """The plant moves under the torques. Ideal motors do not fail."""
        return self.limb.push(self._torque, active)

    def end(self, rows: Trials) -> None:
        """Nothing is kept of how a trial ends."""

    def contact_torque(self) -> Float:
        """(N,) [Nm]."""
        return norm(self.plant.contact_wrench(self.limb.point)[:, 3:])

    def shares(self) -> Shares:
        """(rows,) each."""
        if self.motors is None:
            unknown = np.full(self.rows, np.nan)
            return Shares(self.guard.energy, unknown, unknown, unknown)
        (torque, speed, place), joints = self.motors.shares()
        return Shares(self.guard.energy, torque, speed, place, joints)

    def notes(self, i: int) -> list[str]:
        """Whose motors and ranges count as unlimited, and a sensor that was tared in contact."""
        force = self.contact_at_tare[i]
        if not force >= TARED_IN_CONTACT:
            return list(self._unstated)
        wrong = f"the tool touched something while its force sensor was tared: all forces are {force:.1f} N wrong"
        return [*self._unstated, f"{wrong}; start higher"]

    def recording(self, every: int) -> Recorder:
        """A plain recorder."""
        return Recorder(self.plant, every, self.limb.point)

    def outcome(self, result: Result) -> Result:
        """As it is, the failures of trials that were tared in contact with that beside them."""
        for i in np.flatnonzero((self.contact_at_tare >= TARED_IN_CONTACT) & ~result.success):
            result.failure[i] = f"{result.failure[i]}, after a tare in contact"
        return result

    def _filtered(self, raw: Float, tick: int, lever: Float) -> Float:
        """Wrench (rows, 6) at the centre of compliance, which lies `lever` (rows, 3) from the tool frame."""
        if self.filter is None:
            return move_wrench(raw, lever)
        filter_ = self._compiled or self.filter
        if tick == 0:
            filter_.start(raw * 0.0)
        if self._compiled is not None:
            return self._compiled.step(raw, lever)
        return move_wrench(self.filter.step(raw), lever)

    def _read(self, kinematics: Kinematics, measured: Pose) -> Reading:
        twist = (kinematics.jacobian @ kinematics.velocity[..., None])[..., 0]
        velocity = kinematics.velocity
        return Reading(measured, twist, kinematics.jacobian, kinematics.bias, velocity, self.limb.mass_matrix)


class OneArm:
    """A robot's own arm, or a free-flying tool, whose joints take any torque at once: a `Limb`.

    Args:
        setup: robot, scene and settings.
        draws: quantities per trial.
        rngs: one generator per trial, for the sensors.
    """

    dofs: Sequence[NDArray[np.int64]] | None = None

    def __init__(self, setup: Setup, draws: Draws, rngs: Sequence[np.random.Generator]) -> None:
        self.rows = len(rngs)
        self.plant, self.nominal = varied_plants(setup, draws, self.rows)
        self._encoders = encoders_of(setup, self.plant)
        self.point = np.asarray(setup.center_of_compliance, dtype=float)
        self._stiff = setup.robot.spec.mount is None
        self.sensors: Gauge = Sensors(setup.sensors, self.plant, rngs, draws)

    def kinematics(self, active: Trials) -> Kinematics:
        """Of the nominal robots where the encoders say that the plant's are now."""
        if self.nominal is not self.plant:
            qpos, qvel = self.plant.state if self._encoders is None else self._encoders.state
            self.nominal.set_state(*self.nominal.without_mount(qpos, qvel), active)
        return self.nominal.kinematics(self.point)

    def read_encoders(self) -> None:
        """A tick of the plant is over."""
        if self._encoders is not None:
            self._encoders.sample(*self.plant.state)

    def mass_matrix(self) -> Float:
        """(N, nv, nv) of the nominal robots."""
        return self.nominal.mass_matrix()

    def joint_positions(self) -> Float:
        """(N, nv)."""
        return self.plant.joint_positions if self._stiff else self.plant.positions_without_mount()

    def push(self, torque: Float, active: Trials) -> list[Broken]:
        """Move the plant by a tick under generalised forces (N, nv). Nothing fails."""
        self.plant.step(torque, active)
        self.read_encoders()
        return []

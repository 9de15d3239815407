"""Drive of an arm with velocity or position commands, through an admittance controller.

    encoders, force sensor -> filter -> Observation -> skill -> Command -> admittance -> joint steps
        -> (at the rate of commands) -> the arm's inner loop -> motors -> torque -> plant

Sensors, limits and records are those of `skillframe.execution.drives.torque`. The controller uses the nominal robot at
the commanded joints.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from skillframe.control.admittance import AdmittanceLaw, Bounds, RingWatch
from skillframe.control.controller import Reading
from skillframe.control.joint_steps import JointRange, JointSteps
from skillframe.control.motors import InnerLoop, joint_limits
from skillframe.execution.drive import PacedSkill, Setup
from skillframe.execution.drives.torque import Limb, OneArm, TorqueDrive
from skillframe.frames import Float, Pose, norm, skew
from skillframe.skill import Broken, Command, Skill
from skillframe.world.plant import Draws, Kinematics

SKEW = skew(np.eye(3)).reshape(3, 9)
"""Skew matrices of the unit vectors; their sums are exact in any order."""


class AdmittanceDrive(TorqueDrive):
    """One arm with velocity or position commands."""

    def __init__(self, setup: Setup, limb: Limb) -> None:
        super().__init__(setup, limb)
        self._by_hand = TorqueDrive(setup, limb)
        self.arm, self._pace = setup.robot.spec.control.admittance, setup.pace
        limits = joint_limits(setup.robot, self.plant.model)
        if not limits:
            free = np.full(len(self.plant.dofs), np.inf)
            self._limits = JointRange(free, -free, free)
        else:
            whole = limits[0].velocity, limits[0].lower, limits[0].upper
            self._limits = JointRange(*(np.asarray(part)[self.plant.dofs] for part in whole))
        self._dofs, self._dt_command = self.plant.dofs, 1.0 / self.arm.rate
        self._ticks = round(self._dt_command / self.dt)  # between two commands
        self._all = np.array_equal(self._dofs, np.arange(self.limb.joint_positions().shape[1]))
        self._lever = float(norm(np.array(setup.scene.tool.frames["tip"]) - limb.point))
        self._begin()

    def _begin(self) -> None:
        start = self.limb.joint_positions().copy()
        self._joints, self._sent = start, start if self.arm.kind == "position" else np.zeros_like(start)
        floor = (self.arm.damping, self.arm.turning_damping(self._lever))
        bounds = Bounds(floor, self.arm.push, self.arm.stiffness)
        watch = RingWatch(self.rows, self._dt_command, self.arm.total_delay, self.arm.push[0])
        self.admittance = AdmittanceLaw(self.rows, self._dt_command, bounds, watch)
        self._steps = JointSteps(start.take(self._dofs, axis=1), self._limits, self.arm.total_delay, self._dt_command)
        self._inner = InnerLoop(self.arm, start, self.limb.mass_matrix, self.dt)
        self._tick, self._law = 0, np.zeros((self.rows, 6))

    def prepare(self) -> list[Broken]:
        """Tare with ideal torques, which comply if a trial starts in contact."""
        broken = self._by_hand.prepare()
        self.contact_at_tare = self._by_hand.contact_at_tare
        self._begin()
        return broken

    def act(self, command: Command, ramp: float) -> Float:
        """Send a command if one is due, compute the inner loop's torques, and return the controller's wrench (N, 6)."""
        if self._tick % self._ticks == 0:
            law, dofs = self.admittance, self._dofs
            measured = self.limb.joint_positions().take(dofs, axis=1)  # in C order, or rounding would depend on N
            joints, jacobian = self._joints, self._reading.jacobian
            if not self._all:
                joints, jacobian = joints.take(dofs, axis=1), jacobian.take(dofs, axis=-1)
            wanted, twist, impedance, feedforward, status, reason = command
            paced = Command(wanted, twist / self._pace, impedance, feedforward, status, reason)
            pose = moved(self._tool.at(self.limb.point), jacobian, joints - measured)
            self._law = law.step(paced, pose, self._wrench, ramp)
            speed, law.twist = self._steps.velocities(law.twist, jacobian, joints, measured)
            step = self._dt_command * speed
            if self.arm.kind == "velocity":
                step += self._dt_command * (measured - joints)  # at 1/s, or loop errors would add up
                self._sent = self._spread(np.zeros_like(self._joints), speed)
            self._joints = self._spread(self._joints, joints + step)
            if self.arm.kind == "position":
                self._sent = self._joints
        self._tick += 1
        reading, position = self._reading, self.limb.joint_positions()  # now the arm's own loop and motors
        self._torque = self._inner.torque(self._sent, position, reading.velocity, reading.bias)
        if self.motors is not None:
            self._torque = self.motors.held(self._torque, reading.velocity, position)
        return self._law

    def notes(self, i: int) -> list[str]:
        """The arm's interface and the pace of the skill's clock."""
        clock = f"; the skill's clock ran {self._pace:.1f} times slower" if self._pace > 1.0 else ""
        return [*super().notes(i), f"the arm {self.arm.told(self._lever)}{clock}"]

    def _spread(self, whole: Float, part: Float) -> Float:
        if self._all:
            return part
        whole = whole.copy()
        whole[:, self._dofs] = part
        return whole

    def _read(self, kinematics: Kinematics, measured: Pose) -> Reading:
        self._tool = kinematics.pose
        return super()._read(kinematics, measured)


def moved(pose: Pose, jacobian: Float, step: Float) -> Pose:
    """A pose after small joint steps (N, n), by the Jacobian: the error for 1 mrad is below 1 um."""
    way = (jacobian @ step[..., None])[..., 0]
    turn = (way[:, 3:] @ SKEW).reshape(-1, 3, 3)  # 1 + K + K^2 / 2: exact to 1e-10 for milliradians
    rotation = pose.rotation + turn @ (pose.rotation + 0.5 * (turn @ pose.rotation))
    return Pose(pose.position + way[:, :3], rotation)


def make(setup: Setup, draws: Draws, rngs: Sequence[np.random.Generator]) -> AdmittanceDrive:
    """The drive of one simulated arm."""
    return AdmittanceDrive(setup, OneArm(setup, draws, rngs))


def adapted(skill: Skill, setup: Setup) -> Skill:
    """The skill at the pace of the robot's interface."""
    return PacedSkill(skill, setup.robot.spec.control.admittance.ticks, setup.pace)

"""An arm that takes velocities or positions: an admittance law makes its commands, its own loop the torques.

    encoders, force sensor -> filter -> Observation -> skill -> Command -> admittance -> joint steps
        -> (at the rate of commands) -> the arm's inner loop -> motors -> torque -> plant

Sensors, limits and records are those of ideal torques (`skillframe.execution.drives.torque`). The law goes by the
nominal robot at the joints as commanded: where they are, and on from there by what they lag behind.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from skillframe.control.admittance import AdmittanceLaw, Bounds
from skillframe.control.controller import Reading
from skillframe.control.endings import Broken
from skillframe.control.inner_loop import InnerLoop
from skillframe.control.joint_steps import JointRange, JointSteps
from skillframe.control.motors import joint_limits
from skillframe.control.ringing import RingWatch
from skillframe.execution.drives.torque import OneArm, TorqueDrive
from skillframe.execution.setup import Setup
from skillframe.frames import Float, Pose, norm, skew
from skillframe.skill import Command
from skillframe.world.plant import Draws, Kinematics, Plant

BLEED = 1.0
"""[1/s] at which a velocity's integral follows the measured joints: errors of the arm's loop do not pile up (ours)."""

SKEW = skew(np.eye(3)).reshape(3, 9)
"""Of the unit vectors: a sum of them is exact in any order."""


class AdmittanceDrive(TorqueDrive):
    """One arm told velocities or positions.

    Args:
        setup: robot, scene and settings.
        draws: quantities per trial.
        rngs: one generator per trial, for the sensors.
    """

    def __init__(self, setup: Setup, draws: Draws, rngs: Sequence[np.random.Generator]) -> None:
        limb = OneArm(setup, draws, rngs)
        super().__init__(setup, limb)
        self._by_hand = TorqueDrive(setup, limb)
        self.arm, self._pace = setup.robot.spec.control.admittance, setup.pace
        self._limits = _range(setup, self.plant)
        self._dofs, self._dt_command = self.plant.dofs, self.arm.ticks * self.dt
        self._all = np.array_equal(self._dofs, np.arange(self.limb.joint_positions().shape[1]))
        self._lever = float(norm(np.array(setup.scene.tool.frames["tip"]) - limb.point))
        self._begin()

    def _begin(self) -> None:
        """Law, joint steps and inner loop where the joints are now."""
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
        """Tare as an arm of ideal torques does, which yields where a trial was drawn to begin in contact."""
        broken = self._by_hand.prepare()
        self.contact_at_tare = self._by_hand.contact_at_tare
        self._begin()
        return broken

    def act(self, command: Command, ramp: float) -> Float:
        """The arm's next command where one is due, and the torques of its own loop. The law's wrench (N, 6)."""
        if self._tick % self.arm.ticks == 0:
            self._tell(command, ramp)
        self._tick += 1
        self._drive()
        return self._law

    def notes(self, i: int) -> list[str]:
        """What the arm takes, and by which clock the skill ran."""
        clock = f"; the skill's clock ran {self._pace:.1f} times slower" if self._pace > 1.0 else ""
        return [*super().notes(i), f"the arm {self.arm.told(self._lever)}{clock}"]

    def _tell(self, command: Command, ramp: float) -> None:
        """A step of the law, and the joints on by what it makes."""
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
            step += (self._dt_command * BLEED) * (measured - joints)
            self._sent = self._spread(np.zeros_like(self._joints), speed)
        self._joints = self._spread(self._joints, joints + step)
        if self.arm.kind == "position":
            self._sent = self._joints

    def _spread(self, whole: Float, part: Float) -> Float:
        """Joints (N, nv), those of the arm replaced by (N, n)."""
        if self._all:
            return part
        whole = whole.copy()
        whole[:, self._dofs] = part
        return whole

    def _read(self, kinematics: Kinematics, measured: Pose) -> Reading:
        self._tool = kinematics.pose
        return super()._read(kinematics, measured)

    def _drive(self) -> None:
        """Torques of the arm's own loop, held to its motors."""
        reading, position = self._reading, self.limb.joint_positions()
        self._torque = self._inner.torque(self._sent, position, reading.velocity, reading.bias)
        if self.motors is not None:
            self._torque = self.motors.held(self._torque, reading.velocity, position)


def moved(pose: Pose, jacobian: Float, step: Float) -> Pose:
    """A pose after small steps (N, n) of the joints, by their Jacobian: a lag of 1 mrad bends it by less than 1 um."""
    way = (jacobian @ step[..., None])[..., 0]
    turn = (way[:, 3:] @ SKEW).reshape(-1, 3, 3)  # 1 + K + K^2 / 2: exact to 1e-10 for milliradians
    rotation = pose.rotation + turn @ (pose.rotation + 0.5 * (turn @ pose.rotation))
    return Pose(pose.position + way[:, :3], rotation)


def _range(setup: Setup, plant: Plant) -> JointRange:
    """Of the joints that move the tool."""
    limits = joint_limits(setup.robot, plant.model)
    if not limits:
        free = np.full(len(plant.dofs), np.inf)
        return JointRange(free, -free, free)
    whole = limits[0].velocity, limits[0].lower, limits[0].upper
    return JointRange(*(np.asarray(part)[plant.dofs] for part in whole))

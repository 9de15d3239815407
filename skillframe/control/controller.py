"""From a skill's command to generalised forces: equation (1), gravity and Coriolis forces, and a quiet null space.

    tau = J^T F + h + tau_null,    F from equation (1)

Damping that the skill leaves open is designed from the task-space inertia whenever a row's stiffness changes.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from skillframe.control.impedance import critical_damping, impedance_wrench, null_space_damping, task_inertia
from skillframe.control.ticks import compiled_impedance
from skillframe.frames import Float, Pose
from skillframe.skill import Command, Impedance

NULL_SPACE_DAMPING = 10.0  # 1/s; ours: settles the elbow within half a second
REFRESH = 40  # ticks between two null-space projectors; the posture hardly changes in 40 ms


class Reading(NamedTuple):
    """What the controller reads of N robots at a tick, at the centre of compliance.

    Attributes:
        pose: measured.
        twist: (N, 6) base axes.
        jacobian: (N, 6, nv) base axes.
        bias: (N, nv) gravity, Coriolis and centrifugal generalised forces of the nominal model.
        velocity: (N, nv).
        mass_matrix: gives (N, nv, nv) of the nominal model; called only when it is needed.
    """

    pose: Pose
    twist: Float
    jacobian: Float
    bias: Float
    velocity: Float
    mass_matrix: Callable[[], Float]


class ImpedanceController:
    """The control law of N trials. Rows are independent of each other."""

    def __init__(self, count: int) -> None:
        self._count, self._compiled = count, compiled_impedance(count)
        self._designed_for: Float | None = None
        self._damping: Float = np.zeros((count, 6, 6))
        self._projector: Float = np.zeros(0)
        self._tick = 0

    def torque(self, command: Command, reading: Reading, ramp: float = 1.0) -> tuple[Float, Float]:
        """Generalised forces (N, nv), and the law's wrench (N, 6) on the tool.

        Args:
            command: what the skill wants.
            reading: what the robots do.
            ramp: 0 ... 1 fades desired twist and feed-forward in, so that a start is bumpless.
        """
        law = self._wrench(command, reading, ramp)
        torque: Float = (reading.jacobian.mT @ law[..., None])[..., 0]
        torque += reading.bias
        if reading.velocity.shape[-1] > 6:
            torque += self._null_space(reading)
        return torque, law

    def _wrench(self, command: Command, reading: Reading, ramp: float) -> Float:
        """Equation (1)."""
        damping = self._damping_for(command.impedance, reading)
        if (law := self._compiled) is not None:
            wrench = law.wrench(command, reading.pose, reading.twist, damping, ramp)
            if wrench is not None:
                return wrench
        return impedance_wrench(
            command.pose, reading.pose, ramp * command.twist - reading.twist, command.impedance.stiffness, damping,
            ramp * command.feedforward,
        )  # fmt: skip

    def _damping_for(self, impedance: Impedance, reading: Reading) -> Float:
        """The skill's damping, or critical damping designed again for the rows whose stiffness has changed."""
        if impedance.damping is not None:
            return impedance.damping
        stiffness = impedance.stiffness
        last = np.full((6, 6), np.nan) if self._designed_for is None else self._designed_for
        differs = stiffness != last
        if not np.count_nonzero(differs):
            return self._damping
        shape = (self._count, 6, 6)
        changed = np.broadcast_to(differs, shape).any(axis=(-1, -2))
        inertia = task_inertia(reading.jacobian[changed], reading.mass_matrix()[changed])
        self._damping = self._damping.copy()
        self._damping[changed] = critical_damping(np.broadcast_to(stiffness, shape)[changed], inertia)
        self._designed_for = np.array(stiffness)
        return self._damping

    def _null_space(self, reading: Reading) -> Float:
        if self._tick % REFRESH == 0:
            self._projector = null_space_damping(reading.jacobian, reading.mass_matrix(), NULL_SPACE_DAMPING)
        self._tick += 1
        result: Float = (self._projector @ reading.velocity[..., None])[..., 0]
        return result

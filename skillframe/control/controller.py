"""Impedance controller: generalised forces for a skill's command.

    tau = J^T F + h + tau_null,    F from equation (1)

h is gravity and Coriolis forces, tau_null damps the null space. Where the skill gives no damping, critical damping is
designed from the task-space inertia whenever the stiffness changes.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from skillframe.control.impedance import critical_damping, impedance_wrench, null_space_damping, task_inertia
from skillframe.control.ticks import compiled_impedance
from skillframe.frames import Float, Pose
from skillframe.skill import Command, Impedance

NULL_SPACE_DAMPING = 10.0  # 1/s; settles the elbow within half a second
REFRESH = 40  # ticks between two null-space projectors; the posture hardly changes in 40 ms


class Reading(NamedTuple):
    """State of N robots at a tick, at the centre of compliance.

    Attributes:
        pose: measured.
        twist: (N, 6) base axes.
        jacobian: (N, 6, nv) base axes.
        bias: (N, nv) gravity, Coriolis and centrifugal generalised forces of the nominal model.
        velocity: (N, nv).
        mass_matrix: returns (N, nv, nv) of the nominal model; called only when needed.
    """

    pose: Pose
    twist: Float
    jacobian: Float
    bias: Float
    velocity: Float
    mass_matrix: Callable[[], Float]


class ImpedanceController:
    """The controller of N independent trials."""

    def __init__(self, count: int) -> None:
        self._count, self._compiled = count, compiled_impedance(count)
        self._designed_for: Float | None = None
        self._damping: Float = np.zeros((count, 6, 6))
        self._projector: Float = np.zeros(0)
        self._tick = 0

    def torque(self, command: Command, reading: Reading, ramp: float = 1.0) -> tuple[Float, Float]:
        """Return generalised forces (N, nv), and the controller's wrench (N, 6) on the tool.

        `ramp`, 0 to 1, scales desired twist and feed-forward for a smooth start.
        """
        damping = self.damping_for(command.impedance, reading)
        law = None
        if self._compiled is not None:
            law = self._compiled.wrench(command, reading.pose, reading.twist, damping, ramp)
        if law is None:
            law = impedance_wrench(
                command.pose, reading.pose, ramp * command.twist - reading.twist, command.impedance.stiffness, damping,
                ramp * command.feedforward,
            )  # fmt: skip
        torque: Float = (reading.jacobian.mT @ law[..., None])[..., 0]
        torque += reading.bias
        if reading.velocity.shape[-1] > 6:
            if self._tick % REFRESH == 0:
                self._projector = null_space_damping(reading.jacobian, reading.mass_matrix(), NULL_SPACE_DAMPING)
            self._tick += 1
            torque += (self._projector @ reading.velocity[..., None])[..., 0]
        return torque, law

    def damping_for(self, impedance: Impedance, reading: Reading) -> Float:
        """The impedance's damping (N, 6, 6), or the one that is designed for its stiffness."""
        if impedance.damping is not None:
            return impedance.damping
        stiffness = impedance.stiffness
        differs = stiffness != (np.nan if self._designed_for is None else self._designed_for)
        if not np.count_nonzero(differs):
            return self._damping
        shape = (self._count, 6, 6)
        changed = np.broadcast_to(differs, shape).any(axis=(-1, -2))
        inertia = task_inertia(reading.jacobian[changed], reading.mass_matrix()[changed])
        self._damping = self._damping.copy()
        self._damping[changed] = critical_damping(np.broadcast_to(stiffness, shape)[changed], inertia)
        self._designed_for = np.array(stiffness)
        return self._damping

"""From a skill's command to what the law of a hydraulic machine follows, and from the machine to what a skill sees.

Both are that part of a command and of an observation that lies in the machine's plane. They are written once as casadi
expressions and run as C (`skillframe.machine.law.generated`), wired to the arrays of sensors, estimate and law, because
a machine's tick has no time for thirty calls of numpy on three numbers each.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import casadi as ca
import numpy as np

from skillframe.control.limits import Glance, LimitGuard
from skillframe.frames import Float, Pose
from skillframe.machine.force.compiled import CompiledEstimator
from skillframe.machine.law.generated import Batch
from skillframe.machine.law.hydraulic_compiled import CompiledLaw
from skillframe.machine.sensors import MachineSensors
from skillframe.skill import Command, Observation

IMPEDANCE_RATE, LEAST_DAMPING = 2.0, 5e4  # 1/s and N s/m; D where a skill leaves it open, from teleoperation trials


class _Told(NamedTuple):
    """What of commands is copied for `aim_function`: (N, 3), (N, 6), (N, 6) and (1,)."""

    position: Float
    twist: Float
    push: Float
    ramp: Float


class PlaneTask:
    """The plane's part of observations and commands of N machines.

    Args:
        gauges, estimator, law: the machine's, whose arrays are read and written where they are.
        guard: of its limits, whose values and energy are written too.
        axes: the two of base that the machine moves its tool along.
        tool: (N, 3) position of the tool in base, a live view.
        dt: [s] of a tick.
    """

    def __init__(
        self, gauges: MachineSensors, estimator: CompiledEstimator, law: CompiledLaw, guard: LimitGuard,
        axes: Sequence[int], tool: Float, dt: float,
    ) -> None:  # fmt: skip
        count, self._dt = len(tool), dt
        self._plane = slice(axes[0], axes[1] + 1, axes[1] - axes[0])
        self._everyone, self._law, self.time = np.arange(count), law, np.zeros(count)
        self.position, self.twist, self.wrench, self.law_wrench = guard.parts
        """What the skill sees, and equation (1)'s wrench, for limits and trace."""
        force = estimator.estimate
        n, k = gauges.z.shape[1], gauges.pressure_a.shape[1]
        self._see = Batch(
            see_function(axes, gauges.lag), [law.at.tip, law.at.tip_rate, force.feedback, tool],
            [self.position, self.twist, self.wrench],
        )  # fmt: skip
        self._told = _Told(np.zeros((count, 3)), np.zeros((count, 6)), np.zeros((count, 6)), np.zeros(1))
        measured, reference = law.given
        self._fine: Float = np.zeros(count)
        self._aim = Batch(
            aim_function(axes, gauges.lag, n, k, guard.glance, dt),
            [
                gauges.z, gauges.rate, gauges.pressure_a, gauges.pressure_b, force.answered, force.sigma,
                *self._told, reference.stiffness, reference.damping, self.position, self.twist, self.wrench,
                guard.energy,
            ],
            [
                *measured, reference.position, reference.velocity, reference.push, self.law_wrench,
                np.zeros(count), self._fine,
            ],
            (9,), carried={10: 15},
        )  # fmt: skip

    def seen(self, time: float, rotation: Float) -> Observation:
        """Pose and twist as the encoders say, wrench as the pressures say. Its wrench alone is no live array.

        Args:
            time: [s].
            rotation: (N, 3, 3) of the tool in base.
        """
        self._see.run(self._everyone)
        self.time.fill(time)
        return Observation(self.time, self._dt, Pose(self.position, rotation), self.twist, self.wrench.copy())

    def hold(self, joint: Float) -> None:
        """Say where the joints (N, n - 2) are held that the plane leaves open."""
        reference = self._law.given[1]
        reference.joint[...], reference.joint_rate[...] = joint, 0.0
        if reference.acceleration is not None:
            reference.acceleration[...] = 0.0

    @property
    def fine(self) -> bool:
        """Are all trials well inside all limits, as of the last command?"""
        return bool(np.count_nonzero(self._fine) == len(self._fine))

    def aim(self, command: Command, ramp: float) -> None:
        """Write what the law follows, and what it goes by, into its arrays. A ramp of 0 ... 1 fades a command in."""
        told, reference = self._told, self._law.given[1]
        told.position[...], told.twist[...], told.push[...] = command.pose.position, command.twist, command.feedforward
        told.ramp[0] = ramp
        stiffness, damping = command.impedance
        reference.stiffness[...] = stiffness[..., self._plane, self._plane]
        reference.damping[...] = (
            _own_damping(reference.stiffness) if damping is None else damping[..., self._plane, self._plane]
        )
        self._aim.run(self._everyone)


def _own_damping(stiffness: Float) -> Float:
    """(N, 2, 2) where a skill leaves it open."""
    largest = np.linalg.eigvalsh(stiffness)[..., -1]
    result: Float = np.maximum(largest / IMPEDANCE_RATE, LEAST_DAMPING)[..., None, None] * np.eye(2)
    return result


def see_function(axes: Sequence[int], lag: float) -> ca.Function:
    """(tip, tip_rate, feedback, tool) -> position (3,), twist (6,), wrench (6,), without the sensors' lag [s]."""
    tip, rate, feedback = (ca.SX.sym(name, 2) for name in ("tip", "rate", "feedback"))
    tool, twist, wrench = ca.SX.sym("tool", 3), ca.SX.zeros(6), ca.SX.zeros(6)
    position = ca.SX(tool)
    for i, axis in enumerate(axes):
        position[axis] = tip[i] + lag * rate[i]
        twist[axis], wrench[axis] = rate[i], feedback[i]
    return ca.Function("see", [tip, rate, feedback, tool], [position, twist, wrench])


def aim_function(axes: Sequence[int], lag: float, n: int, k: int, limits: Glance, dt: float) -> ca.Function:
    """What the law goes by and follows, and whether that is well inside all limits.

    Inputs: z, rate, pressure_a, pressure_b, force, sigma; a command's position (3,), twist (6,), feed-forward (6,);
    ramp; stiffness and damping in the plane (4,); position (3,), twist (6,) and wrench (6,) that the skill saw; energy.
    Outputs: z + lag z', rate, pressures, force, sigma; position, velocity, push in the plane; F (6,) of equation (1);
    energy after the tick [J]; 1 where all is well inside the limits, else 0.
    """
    sizes = (n, n, k, k, 2, 2, 3, 6, 6, 1, 4, 4, 3, 6, 6, 1)
    given = [ca.SX.sym(f"given{i}", size) for i, size in enumerate(sizes)]
    z, rate, p_a, p_b, force, sigma, position, twist, push, ramp, stiffness, damping, at, moving, felt, energy = given
    chosen = list(axes)
    velocity, push = ramp * twist[chosen], ramp * push[chosen]
    error, lead = (position - at)[chosen], velocity - moving[chosen]
    wrench = ca.SX.zeros(6)
    wrench[chosen] = push + _times(stiffness, error) + _times(damping, lead)
    measured = [z + lag * rate, rate, p_a, p_b, force, sigma]
    energy = energy + ca.dot(wrench, moving) * dt
    from_centre = ca.vertcat(at, moving, felt, wrench) - limits.centre
    sums = ca.DM(limits.squares).T @ (from_centre * from_centre)
    within = [sums <= limits.bounds, energy <= limits.energy]
    fine = ca.if_else(ca.sum1(ca.vertcat(*within)) >= len(limits.bounds) + 1, 1.0, 0.0)
    return ca.Function("aim", given, [*measured, position[chosen], velocity, push, wrench, energy, fine])


def _times(rows: ca.SX, vector: ca.SX) -> ca.SX:
    """A matrix (2, 2), row by row, times a vector."""
    return ca.vertcat(rows[0] * vector[0] + rows[1] * vector[1], rows[2] * vector[0] + rows[3] * vector[1])

"""Conversion between a skill's commands and observations and the task's axes of a hydraulic machine.

It is written as casadi expressions and runs as C (`skillframe_hydraulics.law.generated`) on the arrays of sensors,
estimate and controller, because a tick has no time for many numpy calls.
"""

from __future__ import annotations

from typing import NamedTuple

import casadi as ca
import numpy as np

from skillframe.control import Glance, LimitGuard
from skillframe.frames import Float, Pose
from skillframe.skill import Command, Observation
from skillframe_hydraulics.force.compiled import CompiledEstimator
from skillframe_hydraulics.law.generated import Batch
from skillframe_hydraulics.law.hydraulic_compiled import CompiledLaw
from skillframe_hydraulics.law.symbolic_chain import constant
from skillframe_hydraulics.sensors import MachineSensors

IMPEDANCE_RATE, LEAST_DAMPING = 2.0, 5e4  # 1/s and N s/m; damping for skills that give none


class _Told(NamedTuple):
    """Inputs of `aim_function` copied from commands: (N, 3), (N, 6), (N, 6), (1,) and twice (N, 6, 6)."""

    position: Float
    twist: Float
    push: Float
    ramp: Float
    stiffness: Float
    damping: Float


class ToolReference:
    """Observations and commands of N machines along the task's axes.

    The arrays of sensors, estimator, controller and guard are shared. `axes` (m, 3) are in base, `tool` (N, 3) is a
    live view of the tool's position in base.
    """

    def __init__(
        self, gauges: MachineSensors, estimator: CompiledEstimator, law: CompiledLaw, guard: LimitGuard,
        axes: Float, tool: Float, dt: float,
    ) -> None:  # fmt: skip
        count, self._dt = len(tool), dt
        self._axes = axes
        self._everyone, self._law, self.time = np.arange(count), law, np.zeros(count)
        self.position, self.twist, self.wrench, self.law_wrench = guard.parts
        """State for the skill, and equation (1)'s wrench, for limits and trace."""
        force = estimator.estimate
        n, k = gauges.z.shape[1], gauges.pressure_a.shape[1]
        self._see = Batch(
            see_function(axes, gauges.lag), [law.at.tip, law.at.tip_rate, force.feedback, tool],
            [self.position, self.twist, self.wrench],
        )  # fmt: skip
        self._told = _Told(
            np.zeros((count, 3)), np.zeros((count, 6)), np.zeros((count, 6)), np.zeros(1), np.zeros((count, 6, 6)),
            np.zeros((count, 6, 6)),
        )  # fmt: skip
        measured, reference = law.given
        self._fine: Float = np.zeros(count)
        self._aim = Batch(
            aim_function(axes, gauges.lag, n, k, guard.glance, dt),
            [
                gauges.z, gauges.rate, gauges.pressure_a, gauges.pressure_b, force.answered, force.sigma,
                *self._told, self.position, self.twist, self.wrench, guard.energy,
            ],
            [
                *measured, reference.position, reference.velocity, reference.push, self.law_wrench,
                np.zeros(count), self._fine, reference.stiffness, reference.damping,
            ],
            (9,), carried={10: 15},
        )  # fmt: skip

    def seen(self, time: float, rotation: Float) -> Observation:
        """Pose and twist from the encoders, and a copy of the wrench from the pressures.

        `rotation` (N, 3, 3) is of the tool in base.
        """
        self._see.run(self._everyone)
        self.time.fill(time)
        return Observation(self.time, self._dt, Pose(self.position, rotation), self.twist, self.wrench.copy())

    def hold(self, joint: Float) -> None:
        """Set the reference of the joints (N, n - m) that the tool's axes leave free."""
        reference = self._law.given[1]
        reference.joint[...], reference.joint_rate[...] = joint, 0.0
        if reference.acceleration is not None:
            reference.acceleration[...] = 0.0

    @property
    def fine(self) -> bool:
        """Whether all trials are well inside all limits, as of the last command."""
        return bool(np.count_nonzero(self._fine) == len(self._fine))

    def aim(self, command: Command, ramp: float) -> None:
        """Write reference and measurements into the controller's arrays. `ramp`, 0 to 1, fades a command in."""
        told = self._told
        told.position[...], told.twist[...], told.push[...] = command.pose.position, command.twist, command.feedforward
        told.ramp[0] = ramp
        told.stiffness[...], damping = command.impedance
        if damping is None:
            largest = np.linalg.eigvalsh(self._axes @ told.stiffness[:, :3, :3] @ self._axes.T)[:, -1]
            told.damping[:, :3, :3] = np.maximum(largest / IMPEDANCE_RATE, LEAST_DAMPING)[:, None, None] * np.eye(3)
        else:
            told.damping[...] = damping
        self._aim.run(self._everyone)


def see_function(axes: Float, lag: float) -> ca.Function:
    """(tip, tip_rate, feedback, tool) -> position (3,), twist (6,), wrench (6,), corrected for the sensors' lag [s]."""
    tip, rate, feedback = (ca.SX.sym(name, len(axes)) for name in ("tip", "rate", "feedback"))
    tool, back = ca.SX.sym("tool", 3), constant(axes.T)
    beside = constant(np.eye(3) - axes.T @ axes) @ tool
    twist, wrench = (ca.vertcat(back @ part, ca.SX.zeros(3)) for part in (rate, feedback))
    given = [tip, rate, feedback, tool]
    return ca.Function("see", given, [ca.densify(x) for x in (beside + back @ (tip + lag * rate), twist, wrench)])


def aim_function(axes: Float, lag: float, n: int, k: int, limits: Glance, dt: float) -> ca.Function:
    """The controller's measurements and reference, and whether all is well inside the limits.

    Inputs: z, rate, pressure_a, pressure_b, force, sigma; a command's position (3,), twist (6,), feed-forward (6,);
    ramp; stiffness and damping (6 6,); observed position (3,), twist (6,) and wrench (6,); energy.
    Outputs: z + lag z', rate, pressures, force, sigma; position, velocity, push along the axes; F (6,) of equation (1);
    energy after the tick [J]; 1 if well inside the limits, else 0; stiffness and damping along the axes (m m,).
    """
    m = len(axes)
    sizes = (n, n, k, k, m, m, 3, 6, 6, 1, 36, 36, 3, 6, 6, 1)
    given = [ca.SX.sym(f"given{i}", size) for i, size in enumerate(sizes)]
    z, rate, p_a, p_b, force, sigma, position, twist, push, ramp, stiffness, damping, at, moving, felt, energy = given
    along = constant(axes)
    velocity, push = ramp * (along @ twist[:3]), ramp * (along @ push[:3])
    error, lead = along @ (position - at), velocity - along @ moving[:3]
    gains = [along @ ca.reshape(rows, 6, 6).T[:3, :3] @ along.T for rows in (stiffness, damping)]
    pull = push + gains[0] @ error + gains[1] @ lead
    wrench = ca.densify(ca.vertcat(along.T @ pull, ca.SX.zeros(3)))
    measured = [z + lag * rate, rate, p_a, p_b, force, sigma]
    energy = energy + ca.dot(wrench, moving) * dt
    from_centre = ca.vertcat(at, moving, felt, wrench) - limits.centre
    sums = ca.DM(limits.squares).T @ (from_centre * from_centre)
    within = [sums <= limits.bounds, energy <= limits.energy]
    fine = ca.if_else(ca.sum1(ca.vertcat(*within)) >= len(limits.bounds) + 1, 1.0, 0.0)
    rows = [ca.densify(gain.T) for gain in gains]  # in numpy's order
    return ca.Function("aim", given, [*measured, along @ position, velocity, push, wrench, energy, fine, *rows])

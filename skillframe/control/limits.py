"""Safety limits that stop a trial, checked at every control tick.

- force: norm of the filtered contact force above `force_n`, or torque above `torque_n_m`;
- motors: torque rate, effort, speed and range of the joints (`skillframe.control.motors`);
- workspace: the tool point outside its box;
- energy: work of the controller on the tool at the centre of compliance since the start, above `energy_j`;
- divergence: a state, wrench or command that is not finite, a tool faster than `SPEED_CEILING` [m/s], or a controller
  wrench above `WRENCH_CEILING` [N, Nm].

`skillframe.control.contact` checks the true contact force.
"""

from __future__ import annotations

import itertools
import sys
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.control.motors import Motors
from skillframe.control.ticks import compiled
from skillframe.frames import Float, dot, norm
from skillframe.robot.spec import Limits
from skillframe.skill import Broken, Ended

SPEED_CEILING, WRENCH_CEILING = 20.0, 1e6


class LimitGuard:
    """Checks the limits of N independent trials."""

    def __init__(self, limits: Limits, count: int, dt: float, motors: Motors | None = None) -> None:
        self._limits, self._dt, self._motors = limits, dt, motors
        self.energy = np.zeros(count)
        """Work of the controller on the tool so far (N,) [J]."""
        self.glance = glance(limits)
        self.values: Float = np.zeros((count, len(self.glance.centre)))
        """Position, twist, wrench and command (N, 21) of the last check."""
        ends = (0, 3, 9, 15, 21)
        self.parts = [self.values[:, begin:end] for begin, end in itertools.pairwise(ends)]
        """Views of its four parts."""
        energy = sys.float_info.max if limits.energy_j is None else self.glance.energy
        self._look = compiled("fine", {
            "values": self.values, "energy": self.energy, "centre": self.glance.centre, "bounds": self.glance.bounds,
            "most_energy": energy, "count": count,
        })  # fmt: skip

    def violations(
        self, position: Float, twist: Float, wrench: Float, command: Float, rows: NDArray[np.int64]
    ) -> list[Broken]:
        """Return the trials among `rows` that broke a limit.

        Args:
            position: (N, 3) tool point in base.
            twist: (N, 6) of the centre of compliance.
            wrench: (N, 6) filtered, environment on tool.
            command: (N, 6) the controller's wrench on the tool.
            rows: indices of the running trials.
        """
        self.energy += dot(command, twist) * self._dt
        for part, given in zip(self.parts, (position, twist, wrench, command), strict=True):
            part[...] = given
        return [] if self._surely_fine(self.values) else self.named(rows)

    def named(self, rows: NDArray[np.int64]) -> list[Broken]:
        """Return the trials among `rows` that broke a limit, from the current `values` and energy."""
        values, (position, twist, wrench, command) = self.values, self.parts
        force, torque, speed = norm(wrench[:, :3]), norm(wrench[:, 3:]), norm(twist[:, :3])
        limits = self._limits
        fine: NDArray[np.bool_] = speed <= SPEED_CEILING
        if limits.workspace_m is not None:
            low, high = limits.workspace_m
            fine &= np.all((position >= low) & (position <= high), axis=-1)
        if self._motors is not None:
            fine &= self._motors.fine()
        fine &= (force <= _or_largest(limits.force_n)) & (torque <= _or_largest(limits.torque_n_m))
        fine &= (self.energy <= _or_largest(limits.energy_j)) & (norm(command) <= WRENCH_CEILING)
        if fine.all():
            return []
        return [
            self._broken(int(i), values[i], float(force[i]), float(torque[i]), float(speed[i]))
            for i in rows[~fine[rows]]
        ]

    def _surely_fine(self, values: Float) -> bool:
        if self._look is not None:
            return bool(self._look()) and (self._motors is None or not self._motors.counting)
        from_centre = values - self.glance.centre
        from_centre *= from_centre
        sums = from_centre @ self.glance.squares
        if self._limits.energy_j is not None and not (self.energy <= self.glance.energy).all():
            return False
        if self._motors is not None and self._motors.counting:
            return False
        return bool(np.count_nonzero(sums <= self.glance.bounds) == sums.size)

    def _broken(self, i: int, values: Float, force: float, torque: float, speed: float) -> Broken:
        limits = self._limits
        if not np.isfinite(values).all():
            return Broken(i, Ended.DIVERGED, "diverged: state or command is not a finite number")
        if speed > SPEED_CEILING:
            return Broken(i, Ended.DIVERGED, f"diverged: the tool moves at {speed:.1f} m/s")
        if norm(values[-6:]) > WRENCH_CEILING:
            return Broken(i, Ended.DIVERGED, f"diverged: the controller commands {norm(values[-6:]):.1e} N")
        if force > _or_largest(limits.force_n):
            return Broken(i, Ended.FORCE, f"force limit: {force:.1f} N is above {limits.force_n:g} N")
        if torque > _or_largest(limits.torque_n_m):
            return Broken(i, Ended.TORQUE, f"torque limit: {torque:.2f} Nm is above {limits.torque_n_m:g} Nm")
        if self._motors is not None and (motor := self._motors.broken(i)) is not None:
            return motor
        if self.energy[i] > _or_largest(limits.energy_j):
            text = f"energy limit: {self.energy[i]:.2f} J put into the tool, above {limits.energy_j:g} J"
            return Broken(i, Ended.ENERGY, text)
        return Broken(i, Ended.WORKSPACE, f"workspace limit: tool point at {np.round(values[:3], 3).tolist()} m")


def _or_largest(limit: float | None) -> float:
    """A limit, or the largest finite number, which infinity and NaN exceed."""
    return sys.float_info.max if limit is None else limit


class Glance(NamedTuple):
    """A quick test of position, twist, wrench and command (21,) against sums of squares.

    `centre` is subtracted, `squares` (21, 7) selects the sums, whose `bounds` are below the limits by more than
    rounding errors; NaN fails all of them. `energy` is the bound on energy [J].
    """

    centre: Float
    squares: Float
    bounds: Float
    energy: float


def glance(limits: Limits) -> Glance:
    """Return the quick test for some limits."""
    low, high = (np.array(corner) for corner in limits.workspace_m or ((-1e100,) * 3, (1e100,) * 3))
    centre, squares = np.zeros(21), np.zeros((21, 7))
    centre[:3] = 0.5 * (low + high)
    half = 0.5 * (high - low)
    squares[[0, 1, 2], [0, 1, 2]] = 1.0
    for sum_, values in enumerate((slice(3, 6), slice(9, 12), slice(12, 15), slice(15, 21)), start=3):
        squares[values, sum_] = 1.0
    most = (SPEED_CEILING, limits.force_n, limits.torque_n_m, WRENCH_CEILING)
    bounds = np.array([*half, *(1e100 if limit is None else limit for limit in most)])
    inside = bounds * (1.0 - 1e-9) - 1e-9 * np.abs(np.append(centre[:3], np.zeros(4)))
    return Glance(centre, squares, np.square(np.maximum(inside, 0.0)), _or_largest(limits.energy_j))

"""Safety limits that stop a trial, with the reason in words; each is checked at every control tick.

- force: norm of the filtered contact force above `force_n` (and torque above `torque_n_m`);
- torque rate: the commanded joint torques are held to `torque_rate_nm_s`; a command that asks for more for
  `RATE_PERSISTENCE` ticks running is stopped (one tick of saturation is what the limiter is for);
- workspace: the tool point outside its box;
- energy: work the controller has done on the tool at the centre of compliance since the start, above `energy_j`;
- divergence: a pose or velocity that is not finite, or a tool faster than `SPEED_CEILING`.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float, norm
from skillframe.robot.spec import Limits
from skillframe.skill import Reasons

RATE_PERSISTENCE = 5
SPEED_CEILING = 20.0


class LimitGuard:
    """Keeps the limits of N trials; rows are independent of each other."""

    def __init__(self, limits: Limits, count: int, dt: float) -> None:
        self._limits, self._dt = limits, dt
        self._torque: Float | None = None
        self._saturated = np.zeros(count, dtype=np.int64)
        self.energy = np.zeros(count)
        """(N,) work of the controller on the tool so far [J]."""

    def rate_limited(self, torque: Float) -> Float:
        """Joint torques (N, nv) held to the torque rate of the limits."""
        if self._limits.torque_rate_nm_s is None:
            return torque
        step = self._limits.torque_rate_nm_s * self._dt
        if self._torque is None:
            self._torque = torque.copy()
            return torque
        change = torque - self._torque
        over = np.abs(change).max(axis=-1) > step
        self._saturated = np.where(over, self._saturated + 1, 0)
        self._torque = self._torque + np.clip(change, -step, step)
        return self._torque

    def violations(
        self, time: Float, position: Float, twist: Float, wrench: Float, command: Float, reasons: Reasons
    ) -> None:
        """Write the reason of each trial that broke a limit into `reasons` where it is still empty.

        Args:
            time: (N,) [s].
            position: (N, 3) tool point in base.
            twist: (N, 6) of the centre of compliance.
            wrench: (N, 6) filtered, environment on tool.
            command: (N, 6) the law's wrench on the tool at the centre of compliance.
            reasons: (N,) texts.
        """
        limits = self._limits
        self.energy += (command * twist).sum(-1) * self._dt
        force, torque = norm(wrench[:, :3]), norm(wrench[:, 3:])
        finite = np.isfinite(position).all(-1) & np.isfinite(twist).all(-1)
        _write(reasons, ~finite, time, lambda i: "diverged: the state is not a finite number")
        speed = norm(twist[:, :3])
        fast = finite & (speed > SPEED_CEILING)
        _write(reasons, fast, time, lambda i: f"diverged: the tool moves at {speed[i]:.1f} m/s")
        if limits.force_n is not None:
            largest = limits.force_n
            _write(reasons, force > largest, time, lambda i: f"force limit: {force[i]:.1f} N is above {largest:g} N")
        if limits.torque_n_m is not None:
            most = limits.torque_n_m
            _write(reasons, torque > most, time, lambda i: f"torque limit: {torque[i]:.2f} Nm is above {most:g} Nm")
        _write(
            reasons, self._saturated >= RATE_PERSISTENCE, time,
            lambda i: f"torque rate limit: above {limits.torque_rate_nm_s:g} Nm/s for {RATE_PERSISTENCE} ticks",
        )  # fmt: skip
        if limits.workspace_m is not None:
            low, high = np.array(limits.workspace_m)
            outside = ((position < low) | (position > high)).any(-1)
            _write(
                reasons, outside, time,
                lambda i: f"workspace limit: tool point at {np.round(position[i], 3).tolist()} m",
            )  # fmt: skip
        if limits.energy_j is not None:
            ceiling = limits.energy_j
            _write(
                reasons, self.energy > ceiling, time,
                lambda i: f"energy limit: {self.energy[i]:.2f} J put into the tool, above {ceiling:g} J",
            )  # fmt: skip


def _write(reasons: Reasons, broken: NDArray[np.bool_], time: Float, text: Callable[[int], str]) -> None:
    if not broken.any():
        return
    for i in np.flatnonzero(broken):
        if not reasons[i]:
            reasons[i] = f"{text(int(i))} (at {time[i]:.3f} s)"

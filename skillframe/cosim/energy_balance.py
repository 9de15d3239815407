r"""Power bonds of a co-simulation, force in and motion out, and the energy over them.

For a force linear from F0 to F1 over a step and cubic motion,

    \(W = F_0\,\Delta x + (F_1 - F_0)\,(\Delta x / 2 + H (v_1 - v_0) / 12)\).

The difference to the actuator's work is an error of the coupling, which falls with the square of the step (after
Sadjina et al., Engineering with Computers 33, 2017).
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.float64]


class Motion(NamedTuple):
    """Motion of the driven joints, each (count,): position [m], velocity [m/s], acceleration [m/s^2]."""

    position: Float
    velocity: Float
    acceleration: Float


class Mechanics(Protocol):
    """Mechanics with `count` bonds, ordered by trial like the bank.

    An optional `where() -> (position, velocity)` at the end of a step saves evaluating accelerations.
    """

    count: int

    def motion(self, force: Float) -> Motion:
        """Motion under the bonds' forces (count,) [N]."""

    def advance(self, begin: Float, end: Float, step: float) -> None:
        """Advance by `step` [s] under forces linear from `begin` to `end`, (count,) each [N]."""

    def effective_mass(self) -> Float:
        """Effective mass (count,) [kg]: inverse of a bond's acceleration per newton."""

    def save(self) -> None:
        """Save the state."""

    def restore(self) -> None:
        """Restore the saved state."""


BLOCK = 100
"""Steps per summation."""


def bond_work(begin: Float, end: Float, path: Float, v0: Float, v1: Float, step: Float | float) -> Float:
    """Work [J] of a force linear from `begin` to `end` over a path [m] with end velocities v0, v1."""
    return begin * path + (end - begin) * (0.5 * path + step / 12.0 * (v1 - v0))


class BondLedger:
    """Sums over steps of the plant's work W, W minus the actuators' work, and |W|.

    Steps are stored and summed in blocks, in their order.

    Args:
        count: number of bonds.

    Attributes:
        rows: (8, BLOCK, count) values of `add` not yet summed.
    """

    def __init__(self, count: int) -> None:
        self.rows: Float = np.zeros((8, BLOCK, count))
        self._sums: Float = np.zeros((2, count))
        self._length = 0

    def start(self) -> None:
        """Reset the sums."""
        self._sums[:], self._length = 0.0, 0

    def add(
        self, force: tuple[Float, Float], position: tuple[Float, Float], velocity: tuple[Float, Float], given: Float,
        step: float,
    ) -> None:  # fmt: skip
        """Add a step: forces, positions and velocities (count,) at both ends, and the actuators' work (count,)."""
        row = self.claim()
        for rows, value in zip(self.rows, (*force, *position, *velocity, given, step), strict=True):
            rows[row] = value

    def claim(self) -> int:
        """Index in `rows` for the next step's values, to be written before `sums`."""
        if self._length == BLOCK:
            self.sums()
        self._length += 1
        return self._length - 1

    def sums(self) -> Float:
        """(2, count): energy error of the coupling and exchanged energy [J]."""
        if self._length:
            f0, f1, x0, x1, v0, v1, given, step = self.rows[:, : self._length]
            received = bond_work(f0, f1, x1 - x0, v0, v1, step)
            turns = np.stack([received, -given], axis=1).reshape(2 * self._length, -1)
            for total, more in zip(self._sums, (turns, np.abs(received)), strict=True):
                total[:] = np.add.accumulate(np.concatenate([total[None], more]), axis=0)[-1]
            self._length = 0
        return self._sums

    def restore(self, sums: Float) -> None:
        """Restore saved sums (2, count)."""
        self._sums[:], self._length = sums, 0


def relative_residual(difference: Float, exchanged: Float) -> Float:
    """Energy error over exchanged energy, (count,), or zero without exchange."""
    return np.abs(difference) / np.where(exchanged > 0.0, exchanged, 1.0)

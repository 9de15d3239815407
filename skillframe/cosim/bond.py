r"""Energy over a power bond: what the plant received against what the actuator gave.

Over a step the plant sees the force go linearly from F0 to F1. With the cubic Hermite interpolant of its motion,

\(W = F_0\,\Delta x + (F_1 - F_0)\,(\Delta x / 2 + H (v_1 - v_0) / 12)\),

exact for a cubic x(t) (integration by parts and the corrected trapezoidal rule). The difference to the actuator's own
work is energy that the coupling has made or lost: it falls with the square of the step in a coupling of second order,
which makes it a free monitor of convergence (after Sadjina et al., Engineering with Computers 33, 2017, who control the
step by it).
"""

from __future__ import annotations

import numpy as np

from skillframe.cosim.plant import Float

BLOCK = 100
"""Steps whose work is computed at once."""


def bond_work(begin: Float, end: Float, path: Float, v0: Float, v1: Float, step: Float | float) -> Float:
    """Work [J] of a force that goes linearly from `begin` to `end` over a path [m] with end velocities v0, v1."""
    return begin * path + (end - begin) * (0.5 * path + step / 12.0 * (v1 - v0))


class BondLedger:
    """Sums over steps of the plant's work W, of W less what the actuators gave, and of |W|.

    A step costs a few copies. Steps are summed one after the other, `BLOCK` of them at once, when they are asked for.

    Args:
        count: number of bonds.

    Attributes:
        rows: (8, BLOCK, count) what `add` is given, of the steps that are not summed yet.
    """

    def __init__(self, count: int) -> None:
        self.rows: Float = np.zeros((8, BLOCK, count))
        self._sums: Float = np.zeros((2, count))
        self._length = 0

    def start(self) -> None:
        """Nothing was exchanged so far."""
        self._sums[:], self._length = 0.0, 0

    def add(
        self, force: tuple[Float, Float], position: tuple[Float, Float], velocity: tuple[Float, Float], given: Float,
        step: float,
    ) -> None:  # fmt: skip
        """A step: forces, positions and velocities (count,) at its begin and end, and the actuators' work (count,)."""
        row = self.claim()
        for rows, value in zip(self.rows, (*force, *position, *velocity, given, step), strict=True):
            rows[row] = value

    def claim(self) -> int:
        """Which row of `rows` the next step's numbers are to be written to, before anyone asks for sums."""
        if self._length == BLOCK:
            self.sums()
        self._length += 1
        return self._length - 1

    def sums(self) -> Float:
        """(2, count): energy that the coupling has made or lost [J], and energy that was exchanged [J]."""
        if self._length:
            f0, f1, x0, x1, v0, v1, given, step = self.rows[:, : self._length]
            received = bond_work(f0, f1, x1 - x0, v0, v1, step)
            turns = np.stack([received, -given], axis=1).reshape(2 * self._length, -1)
            for total, more in zip(self._sums, (turns, np.abs(received)), strict=True):
                total[:] = np.add.accumulate(np.concatenate([total[None], more]), axis=0)[-1]
            self._length = 0
        return self._sums

    def restore(self, sums: Float) -> None:
        """Go back to sums (2, count) that were kept."""
        self._sums[:], self._length = sums, 0


def relative_residual(difference: Float, exchanged: Float) -> Float:
    """|energy made or lost| per energy exchanged, (count,), or zero where nothing was exchanged."""
    return np.abs(difference) / np.where(exchanged > 0.0, exchanged, 1.0)

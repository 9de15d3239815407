r"""Contact that rings, seen in the force: what it touches is stiffer than the law was designed for, so it damps more.

    f_s' = (f - f_s) / (2 T_tot),     up <- max(f - f_s, up exp(-h / (5 T_tot))),     down the same of f_s - f
    a = |min(up, down)|, axis by axis,     rings where a > share * push

A law that is too lightly damped for its contact rings at 1 / (4 T_tot) or somewhat faster: f_s is the force without
that, a the ringing's amplitude, remembered for a period. What goes one way alone, as the force at every touch, does
not ring: damped as if it did, each insertion of a peg took a second longer. Raising the damping of an admittance while
its force rings is Dimeas and Aspragathos, "Online stability in human-robot cooperation with admittance control", IEEE
Transactions on Haptics 9 (2016), who find it in the force's spectrum; this measure of it, and its figures, are ours.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skillframe.control.ticks import compiled
from skillframe.frames import Float, norm

SLOW, MEMORY = 2.0, 5.0
"""Time constants of f_s and of a, in T_tot: 0.5 and 1.25 periods of a ringing of 1 / (4 T_tot)."""
SHARE = 0.1
"""Of the push: the amplitude from which contact counts as ringing, 2 N of 20 N. A wrist sensor's noise is far below."""


class RingWatch:
    """The watch of N trials. Rows are independent of each other.

    Args:
        count: N.
        dt: h [s], between two looks.
        delay: T_tot of the arm [s].
        push: largest force of the law [N].
    """

    def __init__(self, count: int, dt: float, delay: float, push: float) -> None:
        self._follow = -float(np.expm1(-dt / (SLOW * delay)))
        self._fade = float(np.exp(-dt / (MEMORY * delay)))
        self._least = SHARE * push
        self._slow, self._up, self._down, self._both, self._force = np.zeros((5, count, 3))
        self._move = compiled("rung", {
            "slow": self._slow, "up": self._up, "down": self._down, "least": self._both, "force": self._force,
            "follow": self._follow, "fade": self._fade, "numbers": self._slow.size,
        }) or self._move_in_numpy  # fmt: skip
        self.amplitude = np.zeros(count)

    def look(self, force: Float) -> NDArray[np.bool_]:
        """Whose contact rings (N,), by the forces (N, 3) that are felt now."""
        self._force[:] = force
        self._move()
        self.amplitude = norm(self._both)
        result: NDArray[np.bool_] = self.amplitude > self._least
        return result

    def _move_in_numpy(self) -> int:
        """The slow part and both amplitudes a look on."""
        off = self._force - self._slow
        self._slow += self._follow * off
        self._up[:] = np.maximum(off, self._fade * self._up)
        self._down[:] = np.maximum(-off, self._fade * self._down)
        np.minimum(self._up, self._down, out=self._both)
        return 0

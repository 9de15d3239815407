r"""Which way, and how far, the friction of a piston's seals has turned, from its velocity alone.

Seals deflect before they slide (Dahl, Aerospace Corp. TOR-0158, 1968): with the deflection z = s z_s, z' = v - |v| s,

    s' = (sign v - s) |v| / z_s,     s_k+1 = sign v + (s_k - sign v) exp(-|v| dt / z_s)                     (1)

is exact for a velocity held over dt, does not depend on how fast the way is gone, and takes 1.5 mm to turn from -1 to
0.95 with z_s = 0.5 mm, published for this crane's cylinders. Friction is F_C s + F_v v. With z_s = 0 the usual
s = tanh(v / v_s) replaces it, which turns at once.
"""

from __future__ import annotations

import numpy as np

from skillframe.frames import Float


class Seals:
    """States s of any number of pistons.

    Args:
        length: z_s [m]; 0 for the tanh law.
        speed: v_s of the tanh law [m/s].
    """

    def __init__(self, length: float, speed: float) -> None:
        self._length, self._speed = length, speed
        self._shape: Float = np.zeros((0, 0))

    def start(self, trials: int, pistons: int) -> None:
        """Begin undeflected."""
        self._shape = np.zeros((trials, pistons))

    def step(self, velocity: Float, dt: float) -> Float:
        """S (N, k) after dt [s] at velocities (N, k) [m/s]."""
        if self._length <= 0.0:
            return np.asarray(np.tanh(velocity / self._speed))
        goal = np.sign(velocity)
        self._shape = goal + (self._shape - goal) * np.exp(np.abs(velocity) * (-dt / self._length))
        return self._shape

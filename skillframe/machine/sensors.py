"""What a hydraulic machine measures: its joints by encoders and its chambers by pressure transducers, behind filters.

White noise at every sample, then a critically damped filter of second order whose state is the rate; noise and corner
are those of robot.toml's `[sensors]`. What comes out is 2/w old; with the rate where it is now is known too (ours: at
0.2 m/s the lag of 24 Hz alone is 2.7 mm of the tool).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from skillframe.frames import Float
from skillframe.robot.driven import MachineNoise
from skillframe.signals.rates import RateFilter

BLOCK = 100
RECENT = 20


class MachineSensors:
    """The sensors of N machines with n coordinates and k cylinders. Each trial has one random generator.

    A fault, where there is one, changes what is read: (N, n + 2k) to the same, before the filters.

    Attributes:
        z, rate: (N, n) filtered minimal coordinates and their rates; lag: of all readings [s].
        chambers: (N, 2k) filtered pressures of all chambers a, then all chambers b [Pa].
        pressure_a, pressure_b: (N, k) those of either side. These arrays are written at every sample.
    """

    def __init__(self, settings: MachineNoise, rngs: Sequence[np.random.Generator], n: int, k: int, dt: float) -> None:
        self._rngs = list(rngs)
        self._scale: Float = np.repeat([settings.encoder, settings.pressure], [n, 2 * k])
        self._filter = RateFilter(settings.corner_hz, dt)
        self.lag = 1.0 / (np.pi * settings.corner_hz)
        self._noise: Float = np.zeros((BLOCK, len(self._rngs), n + 2 * k))
        self._next = BLOCK
        self._value, self._rate = (np.zeros((len(self._rngs), n + 2 * k)) for _ in range(2))
        self.z, self.rate, self.chambers = self._value[:, :n], self._rate[:, :n], self._value[:, n:]
        self.pressure_a, self.pressure_b = self.chambers[:, :k], self.chambers[:, k:]
        self.fault: Callable[[Float], Float] | None = None
        self.raw: Float = np.zeros((RECENT + 1, len(self._rngs), n + 2 * k))
        """The last `RECENT` + 1 readings before the filters, (N, n + 2k) each; what is read next goes to row `turn`."""
        self.turn = 0

    def start(self, z: Float, pressure_a: Float, pressure_b: Float) -> None:
        """Stand still at true values."""
        self._filter.start(np.concatenate([z, pressure_a, pressure_b], axis=-1))
        self.raw[:] = self._value[:] = self._filter.value
        self._rate[:] = 0.0

    def sample(self, z: Float, pressure_a: Float, pressure_b: Float) -> None:
        """Take in true values (N, n), (N, k) and (N, k)."""
        if self._next == BLOCK:
            for i, rng in enumerate(self._rngs):
                self._noise[:, i] = rng.standard_normal((BLOCK, len(self._scale)))
            self._noise *= self._scale
            self._next = 0
        raw = np.concatenate([z, pressure_a, pressure_b], axis=-1)
        raw += self._noise[self._next]
        self._next += 1
        if self.fault is not None:
            raw = self.fault(raw)
        self._rate[...] = self._filter.step(raw)
        self._value[...] = self._filter.value
        self.raw[self.turn] = raw
        self.turn = (self.turn + 1) % len(self.raw)

    @property
    def now(self) -> Float:
        """(N, n) minimal coordinates without the filters' lag, z + lag z'."""
        ahead: Float = self.z + self.lag * self.rate
        return ahead

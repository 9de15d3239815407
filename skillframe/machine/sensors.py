"""What a hydraulic machine measures: its joints by encoders and its chambers by pressure transducers, behind filters.

White noise at every sample, then a critically damped filter of second order whose state is the rate; noise and corner
are those of robot.toml's `[sensors]`. What comes out is 2/w old; with the rate where it is now is known too (ours: at
0.2 m/s the lag of 24 Hz alone is 2.7 mm of the tool).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import casadi as ca
import numpy as np

from skillframe.frames import Float
from skillframe.machine.law.generated import Batch
from skillframe.robot.driven import MachineNoise
from skillframe.signals.rates import rate_after

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
        self.lag = 1.0 / (np.pi * settings.corner_hz)
        count = len(self._rngs)
        self._noise: Float = np.zeros((BLOCK, count, n + 2 * k))
        self._next = BLOCK
        self._now, self._value, self._rate, *after = (np.zeros((count, n + 2 * k)) for _ in range(5))
        self.z, self.rate, self.chambers = self._value[:, :n], self._rate[:, :n], self._value[:, n:]
        self.pressure_a, self.pressure_b = self.chambers[:, :k], self.chambers[:, k:]
        self.fault: Callable[[Float], Float] | None = None
        self.raw: Float = np.zeros((RECENT + 1, count, n + 2 * k))
        """The last `RECENT` + 1 readings before the filters, (N, n + 2k) each; what is read next goes to row `turn`."""
        self.turn = 0
        given, everyone = [self._now, self._value, self._rate], np.arange(count)
        passed = Batch(filter_function(settings.corner_hz, n + 2 * k, dt), given, after, carried={0: 1, 1: 2})
        self._filter: Callable[[], None] = lambda: passed.run(everyone)
        self._true: Callable[[], None] | None = None

    def start(self, z: Float, pressure_a: Float, pressure_b: Float) -> None:
        """Stand still at true values."""
        self.raw[:] = self._value[:] = np.concatenate([z, pressure_a, pressure_b], axis=-1)
        self._rate[:] = 0.0

    def sample(self, z: Float, pressure_a: Float, pressure_b: Float) -> None:
        """Take in true values (N, n), (N, k) and (N, k)."""
        np.concatenate([z, pressure_a, pressure_b], axis=-1, out=self._now)
        self._take_in()

    def wire(self, states: Sequence[Float], where: Sequence[tuple[int, int]]) -> None:
        """Say where true values stand, so that `read` finds them.

        Args:
            states: arrays (N, m), each row contiguous.
            where: of each of the n + 2k readings which of the arrays it is in, and its column there.
        """
        function = gather_function([array.shape[1] for array in states], where)
        found, everyone = Batch(function, states, [self._now]), np.arange(len(self._now))
        self._true = lambda: found.run(everyone)

    def read(self) -> None:
        """Take in the true values that now stand where `wire` said."""
        assert self._true is not None
        self._true()
        self._take_in()

    def _take_in(self) -> None:
        if self._next == BLOCK:
            for i, rng in enumerate(self._rngs):
                self._noise[:, i] = rng.standard_normal((BLOCK, len(self._scale)))
            self._noise *= self._scale
            self._next = 0
        self._now += self._noise[self._next]
        self._next += 1
        if self.fault is not None:
            self._now[...] = self.fault(self._now)
        self._filter()
        self.raw[self.turn] = self._now
        self.turn = (self.turn + 1) % len(self.raw)

    @property
    def now(self) -> Float:
        """(N, n) minimal coordinates without the filters' lag, z + lag z'."""
        ahead: Float = self.z + self.lag * self.rate
        return ahead


def filter_function(corner: float, size: int, dt: float) -> ca.Function:
    """From a reading (size,), value and rate to value and rate: the filter of `rates` with a corner [Hz]."""
    shown, value, rate = (ca.SX.sym(name, size) for name in ("shown", "value", "rate"))
    return ca.Function("gauges", [shown, value, rate], list(rate_after(value, rate, shown, 2.0 * np.pi * corner, dt)))


def gather_function(sizes: Sequence[int], where: Sequence[tuple[int, int]]) -> ca.Function:
    """From arrays of these sizes to the numbers of them that are asked for, each by its array and its place there."""
    given = [ca.SX.sym(f"given{i}", size) for i, size in enumerate(sizes)]
    return ca.Function("gather", given, [ca.vertcat(*(given[array][column] for array, column in where))])

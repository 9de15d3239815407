"""Encoders and pressure transducers of a hydraulic machine, behind filters.

Each sample has white noise and passes a critically damped second-order filter whose state includes the rate, by
robot.toml's `[sensors]`. Readings are 2/w late, which the rate compensates: at 0.2 m/s and 24 Hz the lag is 2.7 mm at
the tool.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import casadi as ca
import numpy as np

from skillframe.frames import Float
from skillframe.signals import rate_after
from skillframe_hydraulics.declared import MachineNoise
from skillframe_hydraulics.force.damped import CriticallyDamped
from skillframe_hydraulics.law.generated import Batch

BLOCK = 100
RECENT = 20


class MachineSensors:
    """The sensors of N machines with n coordinates and k cylinders. Each trial has its own random generator.

    `fault` changes readings (N, n + 2k) before the filters. Arrays are updated in place.

    Attributes:
        z, rate: (N, n) filtered minimal coordinates and their rates; lag: of all readings [s].
        chambers: (N, 2k) filtered pressures of all chambers a, then all chambers b [Pa].
        pressure_a, pressure_b: (N, k) those of either side.
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
        """Ring buffer of the last `RECENT` + 1 unfiltered readings (N, n + 2k); row `turn` is next."""
        self.turn = 0
        given, everyone = [self._now, self._value, self._rate], np.arange(count)
        passed = Batch(filter_function(settings.corner_hz, n + 2 * k, dt), given, after, carried={0: 1, 1: 2})
        self._filter: Callable[[], None] = lambda: passed.run(everyone)
        self._true: Callable[[], None] | None = None

    def start(self, z: Float, pressure_a: Float, pressure_b: Float) -> None:
        """Reset at rest at true values."""
        self.raw[:] = self._value[:] = np.concatenate([z, pressure_a, pressure_b], axis=-1)
        self._rate[:] = 0.0

    def sample(self, z: Float, pressure_a: Float, pressure_b: Float) -> None:
        """Sample true values (N, n), (N, k) and (N, k)."""
        np.concatenate([z, pressure_a, pressure_b], axis=-1, out=self._now)
        self._take_in()

    def wire(self, states: Sequence[Float], where: Sequence[tuple[int, int]]) -> None:
        """Set the places of true values for `read`.

        Args:
            states: arrays (N, m), each row contiguous.
            where: array and column of each of the n + 2k readings.
        """
        function = gather_function([array.shape[1] for array in states], where)
        found, everyone = Batch(function, states, [self._now]), np.arange(len(self._now))
        self._true = lambda: found.run(everyone)

    def read(self) -> None:
        """Sample the true values at the places of `wire`."""
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
        """Minimal coordinates (N, n) without the filters' lag, z + lag z'."""
        ahead: Float = self.z + self.lag * self.rate
        return ahead


class LineGauges:
    """Pressure transducers of N machines' supply lines, with the noise and the filter of those in the chambers.

    Their noise is drawn apart, so that the other readings are those of a machine without them. `pressure` (N, L) [Pa]
    is filtered, and `deviation` of it that of noise and of the filter's lag in a pressure that changes steadily.
    """

    def __init__(self, settings: MachineNoise, rngs: Sequence[np.random.Generator], pressure: Float, dt: float) -> None:
        self._rngs, self._scale = [rng.spawn(1)[0] for rng in rngs], settings.pressure
        self._noise: Float = np.zeros((BLOCK, *pressure.shape))
        self._next, self._filter = BLOCK, CriticallyDamped(settings.corner_hz, dt)
        self.pressure = self._filter.step(pressure)
        self.deviation: Float = np.zeros_like(self.pressure)

    def read(self, pressure: Float) -> None:
        """Sample true pressures (N, L)."""
        if self._next == BLOCK:
            for i, rng in enumerate(self._rngs):
                self._noise[:, i] = rng.standard_normal((BLOCK, pressure.shape[1]))
            self._noise *= self._scale
            self._next = 0
        self.pressure = self._filter.step(pressure + self._noise[self._next])
        self.deviation = np.hypot(self._scale, 2.0 * self._filter.behind)
        self._next += 1


def filter_function(corner: float, size: int, dt: float) -> ca.Function:
    """A filter step with a corner [Hz]: reading (size,), value and rate to value and rate."""
    shown, value, rate = (ca.SX.sym(name, size) for name in ("shown", "value", "rate"))
    return ca.Function("gauges", [shown, value, rate], list(rate_after(value, rate, shown, 2.0 * np.pi * corner, dt)))


def gather_function(sizes: Sequence[int], where: Sequence[tuple[int, int]]) -> ca.Function:
    """A function that gathers elements of arrays, each by array and place."""
    given = [ca.SX.sym(f"given{i}", size) for i, size in enumerate(sizes)]
    return ca.Function("gather", given, [ca.vertcat(*(given[array][column] for array, column in where))])

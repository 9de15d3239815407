r"""Readings that cannot be: one that repeats to the bit, a jump of a joint, a pressure below the return line's.

Behind white noise no two readings are alike, so `STILL` equal ones are a sensor that has stopped. Where robot.toml says
that there is no noise, they count only while the piston moves. A joint at its velocity limit v goes v dt from reading
to reading, and the noise of two of them is sqrt(2) sigma; `SURE` of that, once in 1e15 readings, is beyond noise. The
return line's check valves hold a chamber at its pressure; `SUNKEN` below it, or below vacuum, a hose or the transducer
has failed. All figures are our choice.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float
from skillframe.robot.driven import MachineNoise

STILL, SURE, SUNKEN, VACUUM = 5, 8.0, 2e5, -1e5
"""Readings; standard deviations; [Pa] below the return line, whose check valve lets 1e-3 m3/s by at 1e5; [Pa]."""
MOVING = 5e-3
"""[m/s] from which on a piston moves, for sensors without noise (their filters' ripple is none)."""


class Suspicion(NamedTuple):
    """Of trial `row`: is it a sensor, and what is wrong in words."""

    row: int
    sensor: bool
    text: str


class ReadingWatch:
    """Judges the latest readings of N machines.

    Args:
        noise: of the sensors; speed: (n,) velocity limits of the coordinates, infinite where none is known.
        returns: (k,) pressures of the return line [Pa]; moved: (k,) which coordinate each cylinder moves.
        names: of the coordinates and of the cylinders.
        dt: [s] between readings.
    """

    def __init__(
        self, noise: MachineNoise, speed: Float, returns: Float, moved: NDArray[np.int64],
        names: tuple[tuple[str, ...], tuple[str, ...]], dt: float,
    ) -> None:  # fmt: skip
        self._joints, self._cylinders = names
        n, k = len(speed), len(returns)
        self._n, self._k = n, k
        self._jump: Float = speed * dt + SURE * np.sqrt(2.0) * noise.encoder
        self._lowest: Float = np.tile(np.maximum(returns - SUNKEN, VACUUM), 2)
        self._returns: Float = np.tile(returns, 2)
        self._quiet = np.repeat([noise.encoder == 0.0, noise.pressure == 0.0], [n, 2 * k])
        self._piston_of = np.concatenate([np.argsort(moved), np.tile(np.arange(k), 2)])

    def look(self, raw: Float, pressures: Float, piston_rate: Float) -> list[Suspicion]:
        """What is wrong with the last readings (m, N, n + 2k), filtered pressures (N, 2k) and pistons' rates (N, k)."""
        still = raw[-2] == raw[-1]
        if still.any():
            still = (raw[-STILL:] == raw[-1]).all(axis=0)
            still &= ~self._quiet | (np.abs(piston_rate) > MOVING)[:, self._piston_of]
        low = pressures < self._lowest
        joints = raw[..., : self._n]
        steps = np.abs(joints[1:] - joints[:-1]).max(axis=0)
        jumped = steps > self._jump
        if not (still.any() or low.any() or jumped.any()):
            return []
        found = [Suspicion(int(i), True, self._jumped(int(j), float(steps[i, j]))) for i, j in np.argwhere(jumped)]
        found += [Suspicion(int(i), True, self._frozen(int(j), float(raw[-1, i, j]))) for i, j in np.argwhere(still)]
        return [
            *found,
            *(Suspicion(int(i), True, self._sunken(int(j), float(pressures[i, j]))) for i, j in np.argwhere(low)),
        ]

    def _jumped(self, j: int, step: float) -> str:
        return (
            f"sensor: the encoder of {self._joints[j]} jumps by {step:.3g} within a tick, more than its speed limit "
            f"and noise allow ({self._jump[j]:.3g})"
        )

    def _frozen(self, j: int, value: float) -> str:
        if j < self._n:
            return f"sensor: the encoder of {self._joints[j]} repeats {value:.6g} to the bit"
        side, cylinder = divmod(j - self._n, self._k)
        return f"sensor: pressure_{'ab'[side]} of {self._cylinders[cylinder]} repeats {value / 1e5:.6g} bar to the bit"

    def _sunken(self, j: int, value: float) -> str:
        side, cylinder = divmod(j, self._k)
        return (
            f"sensor: pressure_{'ab'[side]} of {self._cylinders[cylinder]} reads {value / 1e5:.1f} bar, below the "
            f"return line's {self._returns[j] / 1e5:g}: the transducer has failed, or the hose has burst"
        )

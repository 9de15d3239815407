"""What the trace of a hydraulic machine holds besides a robot's, and its energy bill.

    E_supply = int p_S sum(max(q_a, 0) + max(q_b, 0)) dt,     E_pistons = int sum(F v) dt                          (1)

q flows into a chamber. The pump's line gives what flows in, at the pressure that its cylinder was given; the pistons
pass on F v, the trapezoidal rule; the rest heats oil in valves and seals, or is left in oil and moving masses.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from skillframe.frames import Float

if TYPE_CHECKING:
    from skillframe.fmu.actuator import Actuators

__all__ = ["EnergyBill", "columns", "supply_pressures"]

BLOCK = 100
"""Samples that are added up at once."""


def columns(k: int) -> dict[str, tuple[int, ...]]:
    """Names and shapes of one sample for k cylinders."""
    each = dict.fromkeys(("pressure_a", "pressure_b", "valve", "piston_force", "piston_force_true"), (k,))
    return {**each, "force_sigma": (2,), "force_valid": (), "energy_supply": (), "energy_pistons": ()}


class EnergyBill:
    """Equation (1) for N machines of k cylinders.

    Args:
        bank: their actuators; the supply's share is not known where they do not show `flow_a` and `flow_b`.
        supply: (N, k) pressures p_S [Pa].
        dt: sample time [s].
    """

    def __init__(self, bank: Actuators, supply: Float, dt: float) -> None:
        self._bank, self._dt = bank, dt
        names = bank.outputs
        self._flows = [names.index(f"flow_{side}") for side in "ab"] if "flow_a" in names and "flow_b" in names else []
        self._force = names.index("force")
        self._price: Float = dt * np.repeat(supply, 2, axis=-1)  # (N, 2k), side by side as the flows
        self._shown: Float = np.zeros((BLOCK, *bank.y.shape))
        self._speed: Float = np.zeros((BLOCK, *supply.shape))
        self.start()

    def start(self) -> None:
        """Begin a new bill."""
        count = len(self._price)
        self._sums: list[Float] = [np.full(count, 0.0 if self._flows else np.nan), np.zeros(count)]
        self._power: Float | None = None
        self._length = 0

    def step(self, velocity: Float) -> None:
        """Add a sample. The pistons' velocity is (N, k). It is only noted, and added when someone asks."""
        if self._length == BLOCK:
            self._add_up()
        self._shown[self._length], self._speed[self._length] = self._bank.y, velocity
        self._length += 1

    @property
    def supply(self) -> Float:
        """What (N,) the pump's line has given since `start` [J], NaN where it is not known."""
        return self._add_up()[0]

    @property
    def pistons(self) -> Float:
        """What (N,) the pistons have passed on since `start` [J]."""
        return self._add_up()[1]

    def _add_up(self) -> list[Float]:
        """The sums with all samples so far, one added after the other."""
        if not self._length:
            return self._sums
        y, speed = self._shown[: self._length], self._speed[: self._length]
        power: Float = np.vecdot(y[..., self._force].reshape(speed.shape), speed)
        before = np.concatenate([(power[0] if self._power is None else self._power)[None], power[:-1]])
        more = [None, (0.5 * self._dt) * (power + before)]
        if self._flows:
            flows = np.maximum(y.take(self._flows, axis=2), 0.0).reshape(len(y), *self._price.shape)
            more[0] = np.vecdot(self._price, flows)
        self._sums = [
            total if rows is None else np.add.accumulate(np.concatenate([total[None], rows]), axis=0)[-1]
            for total, rows in zip(self._sums, more, strict=True)
        ]
        self._power, self._length = power[-1], 0
        return self._sums


def supply_pressures(parameters: list[dict[str, float]], known: Float, count: int) -> Float:
    """(N, k) supply pressures of the instances: what a trial was given, else what is known (k,)."""
    given = [row.get("supply_pressure", np.nan) for row in parameters]
    pressure: Float = np.array(given, dtype=float).reshape(count, -1)
    return np.where(np.isfinite(pressure), pressure, known)

"""What the trace of a hydraulic machine holds besides a robot's, and its energy bill.

    E_supply = int p_S sum(max(q_a, 0) + max(q_b, 0)) dt,     E_pistons = int sum(F v) dt                          (1)

q flows into a chamber. The pump's line gives what flows in, at the pressure that its cylinder was given; the pistons
pass on F v, the trapezoidal rule; the rest heats oil in valves and seals, or is left in oil and moving masses.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np

from skillframe.either import maximum
from skillframe.frames import Float
from skillframe.machine.law.generated import Batch

if TYPE_CHECKING:
    from skillframe.fmu.actuator import Actuators

__all__ = ["EnergyBill", "columns", "supply_pressures"]


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
        (count, k), names = supply.shape, bank.outputs
        self._flows = [names.index(f"flow_{side}") for side in "ab"] if "flow_a" in names and "flow_b" in names else []
        self._velocity: Float = np.zeros((count, k))
        self._sums, after = np.zeros((count, 3)), np.zeros((count, 3))
        self._fresh, self._everyone = np.ones(1), np.arange(count)
        price: Float = dt * np.repeat(supply, 2, axis=-1)  # (N, 2k), side by side as the flows
        function = bill_function(k, len(names), names.index("force"), self._flows, dt)
        inputs = [bank.y.reshape(count, -1), self._velocity, price, self._fresh, self._sums]
        self._bill = Batch(function, inputs, [after], (3,), carried={0: 4})
        self.start()

    def start(self) -> None:
        """Begin a new bill."""
        self._sums[:], self._fresh[0] = [0.0 if self._flows else np.nan, 0.0, 0.0], 1.0

    def step(self, velocity: Float) -> None:
        """Add a sample. The pistons' velocity is (N, k)."""
        self._velocity[...] = velocity
        self._bill.run(self._everyone)
        self._fresh[0] = 0.0

    @property
    def supply(self) -> Float:
        """What (N,) the pump's line has given since `start` [J], NaN where it is not known."""
        return self._sums[:, 0].copy()

    @property
    def pistons(self) -> Float:
        """What (N,) the pistons have passed on since `start` [J]."""
        return self._sums[:, 1].copy()


def bill_function(k: int, width: int, force: int, flows: Sequence[int], dt: float) -> ca.Function:
    """A sample of (1) for one machine.

    Inputs: outputs of its k cylinders, `width` each, with columns of force and flows; velocity (k,); p_S dt for each
    flow (2k,); 1 at the first sample; the sums of (1), and the power of the last sample (3,). Output: these after it.
    """
    y, velocity, price = ca.SX.sym("y", width, k), ca.SX.sym("velocity", k), ca.SX.sym("price", 2 * k)
    fresh, sums = ca.SX.sym("fresh"), ca.SX.sym("sums", 3)
    power = ca.dot(y[force, :].T, velocity)
    given = ca.reshape(y[list(flows), :], -1, 1)
    inflow = ca.dot(price, maximum(given, 0.0)) if flows else 0.0
    passed = 0.5 * dt * (power + ca.if_else(fresh > 0.0, power, sums[2]))
    return ca.Function(
        "bill", [y, velocity, price, fresh, sums], [ca.vertcat(sums[0] + inflow, sums[1] + passed, power)]
    )


def supply_pressures(parameters: list[dict[str, float]], known: Float, count: int) -> Float:
    """(N, k) supply pressures of the instances: what a trial was given, else what is known (k,)."""
    given = [row.get("supply_pressure", np.nan) for row in parameters]
    pressure: Float = np.array(given, dtype=float).reshape(count, -1)
    return np.where(np.isfinite(pressure), pressure, known)

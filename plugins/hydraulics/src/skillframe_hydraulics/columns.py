"""Trace columns of a hydraulic machine, and its energy balance.

    E_supply = int p_S sum(max(q_a, 0) + max(q_b, 0)) dt,     E_pistons = int sum(F v) dt                          (1)

q flows into a chamber. The difference heats oil in valves and seals, or remains in oil and moving masses.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np

from skillframe.frames import Float
from skillframe_hydraulics.law.generated import Batch
from skillframe_hydraulics.symbolic_or_numeric import maximum

if TYPE_CHECKING:
    from skillframe.fmu import Actuators

__all__ = ["EnergyBill", "columns"]


def columns(k: int, axes: int, lines: int = 0) -> dict[str, tuple[int, ...]]:
    """Names and sample shapes of the columns for k actuators and a tool that moves along m `axes`.

    `pressure_a`, `pressure_b` are measured [Pa], `valve` commanded; `piston_force` [N] follows from pressures and
    identified friction, `piston_force_true` is the simulator's; `force_sigma` [N] is of the estimated contact force
    along these axes, valid where `force_valid`; `energy_supply`, `energy_pistons` [J] count from the start. With
    declared supplies, `line_pressure` [Pa] and `pump_flow` [m3/s] are the simulator's, of each of the `lines`, and
    `pace` is the share of the commanded speed that the pump's flow allows.
    """
    each = dict.fromkeys(("pressure_a", "pressure_b", "valve", "piston_force", "piston_force_true"), (k,))
    told = {**each, "force_sigma": (axes,), "force_valid": (), "energy_supply": (), "energy_pistons": ()}
    return {**told, "line_pressure": (lines,), "pump_flow": (lines,), "pace": ()} if lines else told


class EnergyBill:
    """Equation (1) for N machines of k cylinders.

    Args:
        bank: their actuators; without `flow_a` and `flow_b` the supply's energy is unknown.
        supply: (N, k) pressures p_S [Pa].
        dt: sample time [s].
    """

    def __init__(self, bank: Actuators, supply: Float, dt: float) -> None:
        (count, k), names = supply.shape, bank.outputs
        self._flows = [names.index(f"flow_{side}") for side in "ab"] if "flow_a" in names and "flow_b" in names else []
        self._velocity: Float = np.zeros((count, k))
        self._sums, after = np.zeros((count, 3)), np.zeros((count, 3))
        self._fresh, self._everyone = np.ones(1), np.arange(count)
        self._dt, self._price = dt, np.empty((count, 2 * k))
        self.price(supply)
        function = bill_function(k, len(names), names.index("force"), self._flows, dt)
        inputs = [bank.y.reshape(count, -1), self._velocity, self._price, self._fresh, self._sums]
        self._bill = Batch(function, inputs, [after], (3,), carried={0: 4})
        self.start()

    def start(self) -> None:
        """Reset the sums."""
        self._sums[:], self._fresh[0] = [0.0 if self._flows else np.nan, 0.0, 0.0], 1.0

    def price(self, supply: Float) -> None:
        """Set the pressures p_S (N, k) [Pa] at which oil is taken from now on."""
        self._price[...] = self._dt * np.repeat(supply, 2, axis=-1)  # in the order of the flows

    def step(self, velocity: Float) -> None:
        """Add a sample with piston velocities (N, k)."""
        self._velocity[...] = velocity
        self._bill.run(self._everyone)
        self._fresh[0] = 0.0

    @property
    def supply(self) -> Float:
        """Energy from the supply since `start` (N,) [J], NaN if unknown."""
        return self._sums[:, 0].copy()

    @property
    def pistons(self) -> Float:
        """Work of the pistons since `start` (N,) [J]."""
        return self._sums[:, 1].copy()


def bill_function(k: int, width: int, force: int, flows: Sequence[int], dt: float) -> ca.Function:
    """A sample of (1) for one machine.

    Inputs: outputs of its k cylinders, `width` each, with columns of force and flows; velocity (k,); p_S dt for each
    flow (2k,); 1 at the first sample; the sums of (1) and the last power (3,). Output: these after the sample.
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

r"""Faults of a hydraulic machine: readings, spools, hoses and supply of N trials.

From `fault.time` on, in the cylinder `fault.cylinder` (the encoder is that of its joint):

    reading frozen, zero, or off by a step; spool at u_0 or stuck; a hole of area S in a hose;
    p_S falls by  loss (p_S - p_R) (1 - e^{-(t - t_0)/tau}),   tau = 0.1 s (an accumulator that empties)

Faults may be combined. They act on readings before filters, and on commands after the bus. Holes and supply are inputs
of the cylinder's FMU (`PORTS`), which it must have.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from skillframe.errors import InputError
from skillframe.fmu import Actuators
from skillframe.frames import Float
from skillframe.robot import ClosedChain
from skillframe_hydraulics.checks.feasibility import moved_by
from skillframe_hydraulics.quantities import FAULTS
from skillframe_hydraulics.sensors import MachineSensors

SUPPLY_S = 0.1
"""Time constant of a lost supply [s]."""
PORTS = {
    "actuator.burst_a": "burst_a", "actuator.burst_b": "burst_b", "actuator.supply_loss": "supply_drop",
}  # fmt: skip
"""Faults that are inputs of the cylinder, with the inputs' names."""
NAMES = tuple(each.name for each in FAULTS)
Flags = NDArray[np.bool_]


def faults_in(draws: Mapping[str, Float]) -> tuple[str, ...]:
    """The faults of any trial.

    Raises:
        InputError: time or cylinder of a fault without a fault.
    """
    if not any(name in draws for name in NAMES):
        for key in ("fault.time", "fault.cylinder"):
            if key in draws:
                raise InputError(key, "is set, and no fault is", f"set one of {', '.join(NAMES)}, or leave it out")
    return tuple(name for name in NAMES if np.any(draws.get(name, 0.0)))


def ports(names: Sequence[str]) -> tuple[str, ...]:
    """Cylinder inputs that these faults need."""
    return tuple(PORTS[name] for name in names if name in PORTS)


class Faults:
    """The faults of N trials.

    `joints` (k,) is the coordinate that each cylinder moves, `begin` the first tick from the skill's start.
    """

    def __init__(
        self, draws: Mapping[str, Float], joints: NDArray[np.int64], count: int, dt: float, begin: int
    ) -> None:
        self._value = {name: np.broadcast_to(np.asarray(draws.get(name, 0.0), float), (count,)) for name in NAMES}
        self._k, self._dt, self._now = len(joints), dt, begin - 1
        time = np.broadcast_to(np.asarray(draws.get("fault.time", 0.0), float), (count,))
        self._at = np.round(time / dt).astype(np.int64)
        which = np.broadcast_to(np.asarray(draws.get("fault.cylinder", 1.0), float), (count,)).astype(np.int64) - 1
        self._cylinder: Flags = np.arange(self._k) == which[:, None]
        self._joint: Flags = np.arange(int(joints.max()) + 1) == joints[which][:, None]
        self._held: Float | None = None
        self._stays: Float | None = None
        self._live: Flags = np.zeros(count, dtype=bool)

    def tick(self) -> None:
        """Advance by a sample."""
        self._now += 1
        self._live = self._now >= self._at

    def _of(self, name: str, where: Flags) -> Flags:
        """Where (N, ...) a fault has occurred."""
        found: Flags = where & (self._live & (self._value[name] != 0.0))[:, None]
        return found

    def read(self, raw: Float) -> Float:
        """Faulty readings (N, n + 2k) of coordinates, pressures a and pressures b."""
        raw, n = raw.copy(), self._joint.shape[1]
        chambers = np.tile(self._cylinder, 2)
        raw[:, :n] += self._of("sensor.encoder_step", self._joint) * self._value["sensor.encoder_step"][:, None]
        raw[:, n:][self._of("sensor.pressure_zero", chambers)] = 0.0
        still = np.concatenate(
            [self._of("sensor.encoder_frozen", self._joint), self._of("sensor.pressure_frozen", chambers)], axis=1
        )
        if self._held is not None:
            raw[still] = self._held[still]
        self._held = raw
        return raw

    def obey(self, command: Float, spool: Float) -> Float:
        """Faulty spool commands (N, k), from spool positions (N, k), NaN if unknown."""
        stuck, wild = (self._of(f"actuator.{what}", self._cylinder) for what in ("stuck", "runaway"))
        if self._stays is None:
            self._stays = np.zeros_like(command)
        command = np.where(stuck, self._stays, command)
        self._stays = np.where(stuck, self._stays, np.where(np.isfinite(spool), spool, command))
        return np.where(wild, self._value["actuator.runaway"][:, None], command)

    def leak(self, side: str) -> Float:
        """Holes in the hoses of a side, "a" or "b" (N, k) [m^2]."""
        name = f"actuator.burst_{side}"
        hole: Float = self._of(name, self._cylinder) * self._value[name][:, None]
        return hole

    def drop(self, height: Float) -> Float:
        """Lost supply pressure (N, k) [Pa], from its height (N, k) above the return line's."""
        since = np.maximum(self._now - self._at, 0) * self._dt
        share = np.where(self._live, self._value["actuator.supply_loss"] * -np.expm1(-since / SUPPLY_S), 0.0)
        fallen: Float = share[:, None] * height
        return fallen


def moved_joints(chain: ClosedChain) -> NDArray[np.int64]:
    """The minimal coordinate (k,) that each cylinder moves, at home."""
    state = chain.at(chain.minimal(chain.home), np.zeros(len(chain.independent)))
    return moved_by(state.arms[:, : chain.steered])


class BrokenParts:
    """Applies the `Faults` of N machines to bank and gauges. `begin` is the first tick from the skill's start."""

    def __init__(
        self, chain: ClosedChain, bank: Actuators, draws: Mapping[str, Float], gauges: MachineSensors, dt: float,
        begin: int,
    ) -> None:  # fmt: skip
        count = bank.count // len(chain.actuated)
        self._faults = Faults(draws, moved_joints(chain), count, dt, begin)
        self._bank, self._spool = bank, bank.outputs.index("spool")
        self._holes = {s: bank.inputs.index(f"burst_{s}") for s in "ab" if f"burst_{s}" in bank.inputs}
        self._drop = bank.inputs.index("supply_drop") if "supply_drop" in bank.inputs else None
        gauges.fault = self._faults.read

    def tick(self) -> None:
        """Advance by a sample."""
        self._faults.tick()

    def obey(self, command: Float, height: Float) -> Float:
        """Spool commands (N, k) under faults. `height` is the supply pressure above the return line's [Pa]."""
        for side, column in self._holes.items():
            self._bank.u[:, column] = self._faults.leak(side).ravel()
        if self._drop is not None:
            self._bank.u[:, self._drop] = self._faults.drop(height).ravel()
        return self._faults.obey(command, self._bank.y[:, self._spool].reshape(command.shape))

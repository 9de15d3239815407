r"""What breaks in a hydraulic machine, and when: readings, spools, hoses and the supply of N trials.

From `fault.time` on, in the cylinder `fault.cylinder` (the joint that it moves has the encoder):

    reading frozen, zero, or off by a step; spool at u_0 or where it was; a hole of area S in a hose;
    p_S falls by  loss (p_S - p_R) (1 - e^{-(t - t_0)/tau}),   tau = 0.1 s (ours: an accumulator that empties)

Several may strike at once. Faults act on readings before filters, and on commands after the bus. Holes and the supply
are inputs of the cylinder's FMU (`PORTS`), so a cylinder without them cannot have these faults.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from skillframe.errors import InputError
from skillframe.frames import Float
from skillframe.world.quantities import FAULTS

SUPPLY_S = 0.1
"""Time constant of a supply that is lost [s] (ours)."""
PORTS = {
    "actuator.burst_a": "burst_a", "actuator.burst_b": "burst_b", "actuator.supply_loss": "supply_drop",
}  # fmt: skip
"""Faults that are inputs of the cylinder, and what these are called."""
NAMES = tuple(each.name for each in FAULTS)
Flags = NDArray[np.bool_]


def faults_in(draws: Mapping[str, Float]) -> tuple[str, ...]:
    """The faults that some trial has.

    Raises:
        InputError: it is said when or where something breaks, and not what.
    """
    if not any(name in draws for name in NAMES):
        for key in ("fault.time", "fault.cylinder"):
            if key in draws:
                raise InputError(key, "is set, and no fault is", f"set one of {', '.join(NAMES)}, or leave it out")
    return tuple(name for name in NAMES if np.any(draws.get(name, 0.0)))


def ports(names: Sequence[str]) -> tuple[str, ...]:
    """Inputs of the cylinders that these faults need."""
    return tuple(PORTS[name] for name in names if name in PORTS)


class Faults:
    """The faults of N trials.

    Args:
        draws: quantities per trial.
        joints: (k,) which of the n coordinates each cylinder moves.
        count: N.
        dt: [s] of a tick; begin: tick of the first sample, counted from the skill's start.
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
        self._joint: Flags = np.arange(len(joints)) == joints[which][:, None]
        self._held: Float | None = None
        self._stays: Float | None = None
        self._live: Flags = np.zeros(count, dtype=bool)

    def tick(self) -> None:
        """A sample later."""
        self._now += 1
        self._live = self._now >= self._at

    def _of(self, name: str, where: Flags) -> Flags:
        """Where (N, ...) a fault has occurred."""
        found: Flags = where & (self._live & (self._value[name] != 0.0))[:, None]
        return found

    def read(self, raw: Float) -> Float:
        """Readings (N, n + 2k) of coordinates, pressures a and pressures b as broken sensors give them."""
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
        """Commands (N, k) that spools go by, where they are (N, k), NaN if that is not known."""
        stuck, wild = (self._of(f"actuator.{what}", self._cylinder) for what in ("stuck", "runaway"))
        if self._stays is None:
            self._stays = np.zeros_like(command)
        command = np.where(stuck, self._stays, command)
        self._stays = np.where(stuck, self._stays, np.where(np.isfinite(spool), spool, command))
        return np.where(wild, self._value["actuator.runaway"][:, None], command)

    def leak(self, side: str) -> Float:
        """(N, k) holes in the hoses of a side, "a" or "b" [m^2]."""
        name = f"actuator.burst_{side}"
        hole: Float = self._of(name, self._cylinder) * self._value[name][:, None]
        return hole

    def drop(self, height: Float) -> Float:
        """(N, k) of the supply pressure that has failed, of its height (N, k) above the return line's [Pa]."""
        since = np.maximum(self._now - self._at, 0) * self._dt
        share = np.where(self._live, self._value["actuator.supply_loss"] * -np.expm1(-since / SUPPLY_S), 0.0)
        fallen: Float = share[:, None] * height
        return fallen

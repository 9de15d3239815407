"""Can each trial's own supply pressure hold what its machine carries? Capacities as in `feasibility`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from skillframe.errors import InputError
from skillframe.frames import Float
from skillframe.machine.checks.feasibility import capacity
from skillframe.robot.driven import Actuation


def require_held(actuation: Sequence[Actuation], hold: Float, supply: Float, where: object) -> None:
    """Refuse trials whose cylinders cannot hold their loads, stiction left out.

    Args:
        actuation: of the k cylinders.
        hold: (N, k) piston forces at rest [N].
        supply: (N, k) supply pressures [Pa].
        where: the machine, for the message.

    Raises:
        InputError: names the first trial's cylinders that cannot, with force and pressure.
    """
    for forces, pressures in zip(hold, supply, strict=True):
        rows = zip(actuation, forces, pressures, strict=True)
        found = [text for one, force, pressure in rows if (text := _overload(one, force, pressure))]
        if found:
            raise InputError(where, "; ".join(found), "raise the supply pressure, carry less, or start elsewhere")


def _overload(actuation: Actuation, force: float, pressure: float) -> str:
    """What a cylinder would have to do and cannot, or ""."""
    limit = capacity(replace(actuation, parameters={**actuation.parameters, "supply_pressure": float(pressure)}))
    bound, way = (limit.push, "push") if force > 0.0 else (limit.pull, "pull")
    if abs(force) <= bound:
        return ""
    needed = f"{actuation.joint} would have to {way} {abs(force) / 1e3:.1f} kN"
    return f"{needed}, more than the {max(bound, 0.0) / 1e3:.1f} kN that {pressure / 1e5:.4g} bar can give"

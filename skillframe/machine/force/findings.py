"""What a run says of its swing in the air: a load that was not as told, and every figure that was found beyond a bound.

A figure on its bound is one that the law does not go by as it was found, so nothing is bounded without a sentence. The
overlap that is compensated is no less than zero, which is most valves' and says nothing.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from skillframe.machine.force.calibration import carried_bounds
from skillframe.machine.force.load import carrier
from skillframe.machine.law.vdc_actuator import friction_parameters
from skillframe.machine.law.vdc_adaptation import relative_bounds

if TYPE_CHECKING:
    from skillframe.machine.force.identification import Identification
    from skillframe.machine.force.load import BelievedLoad
    from skillframe.machine.force.valve import ValveIdentification
    from skillframe.machine.law.hydraulic_compiled import CompiledLaw

_FRICTION = (("coulomb_friction", "N"), ("viscous_friction", "N s/m"))


def findings(
    law: CompiledLaw, load: BelievedLoad, found: Identification, valves: ValveIdentification
) -> list[list[str]]:
    """Sentences of every trial, in order. None where all is as told, or was found within its bounds."""
    count = len(load.mass)
    return [
        [*_weighed(load, i), *_load(law, load, found, i), *_rubbing(law, found, i), *_valves(law, valves, i)]
        for i in range(count)
    ]


def _weighed(load: BelievedLoad, i: int) -> Iterator[str]:
    if load.mass[i] != load.told[i]:
        told, held = f"{load.told[i]:.0f} kg in the grip", f"{load.mass[i]:.0f} kg"
        yield f"the controller was told of {told}; at rest the cylinders' pressures hold {held}, and it goes by these"


def _load(law: CompiledLaw, load: BelievedLoad, found: Identification, i: int) -> Iterator[str]:
    mass = law.told[i, carrier(law.chain), 0]
    for bound, beyond in zip(carried_bounds(law), (np.less, np.greater), strict=True):
        if beyond(mass + found.payload[i], bound):
            text = _bounded("load in the grip", load.mass[i] + found.payload[i], load.mass[i] + bound - mass, "kg")
            yield f"{text}; expect the tool to sag or to rise, and check payload.mass and the masses in the URDF"


def _rubbing(law: CompiledLaw, found: Identification, i: int) -> Iterator[str]:
    nominal = friction_parameters(law.cylinders)
    lower, upper = relative_bounds(nominal, law.gains.friction_share)
    seen = nominal + np.stack([found.coulomb[i], found.viscous[i]])
    for row, (name, unit) in enumerate(_FRICTION):
        for k, joint in enumerate(law.chain.actuated):
            if not lower[row, k] <= seen[row, k] <= upper[row, k]:
                yield _bounded(f"{name} of {joint}", seen[row, k], law.friction[i, row, k], unit)


def _valves(law: CompiledLaw, valves: ValveIdentification, i: int) -> Iterator[str]:
    for k, joint in enumerate(law.chain.actuated):
        if valves.overlap[i, k] - valves.overlap_deviation[i, k] > (most := valves.settings.largest):
            yield _bounded(f"deadband of {joint}", 100.0 * valves.overlap[i, k], 100.0 * most, "% of the travel")
        seen, used = valves.supply_found[i, k], valves.supply[i, k]
        if abs(seen - used) > 1.0:  # Pa: they differ by rounding where none is bounded
            yield _bounded(f"supply_pressure of {joint}", seen / 1e5, used / 1e5, "bar")


def _bounded(what: str, found: float, bound: float, unit: str) -> str:
    return f"{what}: the swing found {found:.4g} {unit}, beyond its bound; the law goes by {bound:.4g} {unit}"

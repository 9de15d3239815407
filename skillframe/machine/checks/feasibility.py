r"""Can a closed chain stand in a configuration? Reach, stroke, dead centre, and the pressure that holds the load.

A cylinder between supply and return pressure pushes at most \(A_a p_S - A_b p_R\) and pulls at most
\(A_b p_S - A_a p_R\); at rest it must hold F = R^-T G^T g (`loops`). Near a dead centre the moment arm dx/dz of a
cylinder vanishes and no force helps. Friction is left out: what only stiction holds is not held.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from skillframe.errors import InputError
from skillframe.frames import Float
from skillframe.machine.checks.figures import CYLINDER
from skillframe.robot.chain import ChainState, ClosedChain, OutOfReach
from skillframe.robot.driven import Actuation

LEAST_ARM = 0.1  # m; ours: below it a force error of 1 kN at the piston is felt three times less than at mid stroke
_NEEDED = ("bore", "rod", "stroke", "supply_pressure", "return_pressure")


class Capacity(NamedTuple):
    """What a cylinder can do: largest push and pull [N], stroke [m]."""

    push: float
    pull: float
    stroke: float


def capacity(actuation: Actuation, where: object = "robot.toml") -> Capacity:
    """Largest push and pull of a hydraulic cylinder at rest.

    Raises:
        InputError: a parameter that decides it is not given.
    """
    p = actuation.known
    missing = [name for name in _NEEDED if name not in p]
    if missing:
        text = f"the cylinder on {actuation.joint} has no {', '.join(missing)}"
        raise InputError(where, text, "add it to parameters or nominal of its [[actuation]]")
    area_a = math.pi / 4 * p["bore"] ** 2
    area_b = area_a - math.pi / 4 * p["rod"] ** 2
    high, low = p["supply_pressure"], p["return_pressure"]
    return Capacity(area_a * high - area_b * low, area_b * high - area_a * low, p["stroke"])


def problems(chain: ClosedChain, z: Float) -> list[str]:
    """Why the chain cannot stand at minimal coordinates (n,): sentences, none if it can.

    Other actuators than `hydraulic_cylinder` whose areas or pressures are not given are judged by stroke limits of the
    URDF and moment arm only.

    Raises:
        InputError: a cylinder whose pressures or areas are not given.
    """
    try:
        state = chain.at(z, np.zeros(len(chain.independent)))
    except OutOfReach as error:
        return [f"{error.problem}; {error.fix}"]
    found = _outside(chain, state.q) + _dead_centres(state)
    return found or _overloaded(state)


def require_feasible(chain: ClosedChain, z: Float) -> None:
    """Refuse a configuration that the machine cannot stand in.

    Raises:
        InputError: names every joint that prevents it, with its number.
    """
    found = problems(chain, z)
    if found:
        place = ", ".join(f"{name} {value:.4g}" for name, value in zip(chain.independent, z, strict=True))
        raise InputError(f"{chain.robot.spec.name} at {place}", "; ".join(found), "choose another configuration")


def _outside(chain: ClosedChain, q: Float) -> list[str]:
    model, found = chain.model, []
    for index in range(1, model.njoints):
        value = q[i := model.joints[index].idx_q]
        low, high = model.lowerPositionLimit[i], model.upperPositionLimit[i]
        if not low - 1e-9 <= value <= high + 1e-9:
            found.append(f"{model.names[index]} would stand at {value:.4g}, outside {low:.4g} to {high:.4g}")
    return found


def _dead_centres(state: ChainState) -> list[str]:
    pistons = {state.chain.model.names[c.piston] for c in state.chain.cylinders}
    arms = dict(zip(state.chain.actuated, np.abs(state.arms).max(axis=1), strict=True))
    return [
        f"{name} is near its dead centre: its moment arm is {arm:.3f} m, below {LEAST_ARM:g} m"
        for name, arm in arms.items()
        if name in pistons and arm < LEAST_ARM
    ]


def _overloaded(state: ChainState) -> list[str]:
    spec, found = state.chain.robot.spec, []
    for actuation, force in zip(spec.actuation, state.holding_force(), strict=False):
        if actuation.fmu != CYLINDER and any(name not in actuation.known for name in _NEEDED):
            continue
        limit = capacity(actuation, spec.folder / "robot.toml")
        bound, way = (limit.push, "push") if force > 0.0 else (limit.pull, "pull")
        if abs(force) > bound:
            pressure = actuation.known["supply_pressure"] / 1e5
            found.append(
                f"{actuation.joint} would have to {way} {abs(force) / 1e3:.1f} kN, more than the"
                f" {max(bound, 0.0) / 1e3:.1f} kN that {pressure:.4g} bar can give"
            )
    return found

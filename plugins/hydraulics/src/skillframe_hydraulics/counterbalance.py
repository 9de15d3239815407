r"""Counterbalance (overcentre) valve at a port of a cylinder, in series with the spool's edge to the return line.

    open = clip((p_load + R p_pilot - p_set) / p_range, 0, 1),    C = open Q_N / sqrt(dp_N),                        (1)
    c = c_v C / sqrt(c_v^2 + C^2)                                                                                   (2)

p_load is the pressure at the port, p_pilot at the other one, R the pilot ratio, p_set the setting. Pressures are gauge:
the spring chamber is vented, so that the pressure behind the valve does not act on it. In a valve without a vent it
adds 1 + R times itself to the setting (Sun Hydraulics, data sheets of CBCL and MWIM; Simscape, Counterbalance Valve).
A check valve lets oil in freely and keeps it from the supply line. (2) adds the drops of two orifices with one flow.
Opening without delay, and linearly over p_range, are our choice. Formulas take arrays or casadi expressions.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from skillframe.frames import Float
from skillframe.robot import Actuation
from skillframe_hydraulics.symbolic_or_numeric import clip, maximum, sqrt

ABSENT, SHUT = 1e3, 1e-30  # m3/(s sqrt(Pa)): (2) rounds to c_v, or to nothing


@dataclass(frozen=True, slots=True, kw_only=True)
class Counterbalance:
    """Counterbalance valves of n cylinders, arrays (n,), SI, with the names of the FMU's parameters.

    Attributes:
        counterbalance_a, counterbalance_b: settings at either port [Pa], 0 where there is none.
        holds_a, holds_b: 1 with a valve, else 0.
        pilot_ratio: R; counterbalance_range: p_range [Pa].
        counterbalance_edge: conductance of the open valve [m^3/(s sqrt(Pa))].
    """

    counterbalance_a: Float
    counterbalance_b: Float
    holds_a: Float
    holds_b: Float
    pilot_ratio: Float
    counterbalance_range: Float
    counterbalance_edge: Float


DEFAULTS = {
    "counterbalance_a": 0.0, "counterbalance_b": 0.0, "pilot_ratio": 4.0, "counterbalance_flow": 1e-3,
    "counterbalance_drop": 10e5, "counterbalance_range": 30e5,
}  # fmt: skip
"""Of the FMU's parameters."""


def counterbalances(actuation: Sequence[Actuation]) -> Counterbalance | None:
    """The valves that a robot's actuators declare, None if there are none."""
    rows = [{name: a.known.get(name, value) for name, value in DEFAULTS.items()} for a in actuation]
    p = {name: np.array([row[name] for row in rows], dtype=float) for name in DEFAULTS}
    if not np.any(p["counterbalance_a"] + p["counterbalance_b"] > 0.0):
        return None
    edge = p.pop("counterbalance_flow") / np.sqrt(p.pop("counterbalance_drop"))
    holds = {f"holds_{side}": np.where(p[f"counterbalance_{side}"] > 0.0, 1.0, 0.0) for side in "ab"}
    return Counterbalance(**p, **holds, counterbalance_edge=edge)


def conductances(p: Any, pressure_a: Any, pressure_b: Any) -> tuple[Any, Any]:
    """C of (1) at both ports [m^3/(s sqrt(Pa))] at the chambers' pressures [Pa], `ABSENT` where there is no valve."""

    def opened(holds: Any, setting: Any, load: Any, pilot: Any) -> Any:
        lift = (load + p.pilot_ratio * pilot - setting) / p.counterbalance_range
        return ABSENT * (1.0 - holds) + holds * p.counterbalance_edge * clip(lift, 0.0, 1.0)

    return (
        opened(p.holds_a, p.counterbalance_a, pressure_a, pressure_b),
        opened(p.holds_b, p.counterbalance_b, pressure_b, pressure_a),
    )


def narrowing(edge: Any, valve: Any) -> Any:
    """Factor c / c_v of (2) for the conductances of the edge and of the valve."""
    ratio = edge / maximum(valve, SHUT)
    return 1.0 / sqrt(1.0 + ratio * ratio)

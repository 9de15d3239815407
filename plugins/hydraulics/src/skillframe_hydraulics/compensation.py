r"""Pressure-compensated valves: the pressure p_H that a compensator holds behind an edge from the supply.

Flow into an actuator whose spool opens by u, with the pressure p of the chamber that it feeds, is

    q = u c sqrt(p_S - max(p, p_H)),                                                                                (1)
    p_H = p_S - margin of a pre-compensated valve,    p_H = p_L of a post-compensated one,                          (2)

with p_L the largest load, among the chambers that open valves of the line feed, which its load-sensing pump senses. A
pre-compensated flow is in proportion to u whatever the load, until the pump is full; then the heaviest load is left
behind. Behind post-compensated edges all loads look alike, so that the flows keep their proportion (flow sharing; LUDV
of Bosch Rexroth). Ideal compensators are our choice: no spring of their own, no delay; none lets oil back. As
max(p, p_L) is the same with and without its own p, an actuator's p_H counts the other loads alone: its own then acts
within a step.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import casadi as ca
import numpy as np

from skillframe_hydraulics.lines import Lines
from skillframe_hydraulics.symbolic_or_numeric import absolute, maximum, where

HELD = "held_pressure"
"""Input p_H of an actuator with a compensator."""
OPEN = 2e-3
"""Opening of a valve, share of its travel, from which on a load-sensing pump senses the pressure of its chamber."""


def sensed(spool: Any, overlap: Any, pressure_a: Any, pressure_b: Any) -> Any:
    """Pressures (..., k) of the chambers that valves feed [Pa], 0 of shut ones."""
    return where(absolute(spool) - overlap > OPEN, where(spool > 0.0, pressure_a, pressure_b), 0.0)


def held_pressures(lines: Lines, loads: Sequence[Any], supply: Sequence[Any]) -> list[Any]:
    """p_H of k actuators [Pa], 0 without a compensator.

    `loads` are those of `sensed`, `supply` the pressures at the valves, one of each for every actuator.
    """
    found = []
    for i, (load, pressure) in enumerate(zip(loads, supply, strict=True)):
        held, own = 0.0 * load, lines.feeds[:, i] > 0.0
        if np.any(own & np.isfinite(lines.keeps)):
            held = maximum(pressure - float(lines.keeps[own][0]), held)
        elif np.any(own & (lines.shares > 0.0)):
            for j in np.flatnonzero((lines.feeds[own][0] > 0.0) & (np.arange(len(loads)) != i)).tolist():
                held = maximum(held, loads[j])
        found.append(held)
    return found


def held_range(
    lines: Lines, halves: Sequence[ca.SX], pressures: tuple[ca.SX, ca.SX], supply: tuple[ca.SX, ca.SX], sure: ca.SX
) -> tuple[ca.SX, ca.SX]:
    """Largest and least p_H (k,) that commands may make, at the lowest and the highest pressure of the supply.

    `halves` are means of the commands' positive and negative parts; beyond `sure` a valve's load is sensed.
    """
    opened = halves[0], -halves[1]
    open_a, open_b = (ca.if_else(part > sure, p, 0.0) for part, p in zip(opened, pressures, strict=True))
    loads = maximum(*pressures), maximum(open_a, open_b)
    largest, least = (
        ca.vertcat(*held_pressures(lines, ca.vertsplit(load), ca.vertsplit(line)))
        for load, line in zip(loads, supply, strict=True)
    )
    return largest, least

r"""The pressure that a controller's own commands will make in a line of open-centre valves.

Such a line has a pressure only while spools shut the centre. Where nothing flows yet, a valve that is inverted at the
measured pressure opens too little, and later swings. With openings u_i(p) that give the demanded flows at a pressure p,
and flows q_i(p) that they take from the line, the controller inverts its valves at the root p of

    V/B (p - p_S)/T = Q_max - sum q_i(p) - q_C(p, u(p)) - q_R(p),                                                   (1)

the line's pressure a time T ahead by one implicit step, as `skillframe_hydraulics.supply` writes it. The right side
falls with p, as openings do, so bisection finds the root. T is longer than the delay of sensors and spools. A small
flow so closes the centre until the line has the load's pressure, by a jump of the spool as across an overlap.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np

from skillframe.robot import RobotSpec
from skillframe_hydraulics.compensation import held_pressures, sensed
from skillframe_hydraulics.cylinder.equations import edge_flow
from skillframe_hydraulics.declared import supplies_of
from skillframe_hydraulics.law.vdc_actuator import chamber_lengths, inverse_valve, spool_for
from skillframe_hydraulics.lines import Lines, lines_of
from skillframe_hydraulics.open_centre import bypass, conductance, narrowed
from skillframe_hydraulics.opening import overlap
from skillframe_hydraulics.symbolic_or_numeric import clip, maximum, minimum, where

AHEAD_S = 0.05
"""T [s]; sensors and spools are 30 ms late."""
ROUNDS = 16
"""Of bisection: 0.01 bar."""
STILL = 30.0
"""Least root of a drop to the return line [sqrt(Pa)]. A chamber that has run empty makes no force by draining, and the
less it is believed to, the smaller is the demand that shuts the centre."""
BEGIN = 2e-3
"""Required speed at which valves begin to open, fully at twice that [m/s, rad/s of a motor]. Else noise of the sensors
would shut and open the centre of a standing machine, which its shut valves hold."""
EMPTY = 0.5e5
"""Pressure below the return line's at which a chamber fills through its check valve alone [Pa]: what flows into it
makes no force, and the piston's motion takes none."""


def known_lines(spec: RobotSpec) -> Lines | None:
    """The supplies of a robot if one is of open centres or has compensated valves, else None."""
    lines = lines_of(spec) if supplies_of(spec) else None
    return lines if lines is not None and (lines.compensated or np.any(lines.drop > 0.0)) else None


def checked(c: Any, drop: Any) -> Any:
    """Root of the drop [sqrt(Pa)] over an edge behind a load check valve."""
    return where(drop > 0.0, edge_flow(maximum(drop, 0.0), c.laminar_pressure), 0.0)


def drained(c: Any, drop: Any) -> Any:
    """Root of the drop [sqrt(Pa)] over an edge to the return line, of at least `STILL`."""
    return maximum(checked(c, drop), STILL)


def inverse_ahead(
    lines: Lines, c: Any, motion: tuple[ca.SX, ...], pressures: tuple[ca.SX, ca.SX], supply: ca.SX, deadband: ca.SX
) -> ca.SX:
    """Unlimited openings u_e (k,) as of `inverse_valve`, at the roots of (1) of lines of open centres.

    `motion` is flow demand, piston position, velocity and required velocity; `supply` (k,) are measured pressures at
    the valves, at which those of other pumps are inverted, compensated ones with the p_H of `held_pressures`.
    """
    (demand, x, moved, speed), (p_a, p_b) = motion, pressures
    opened = inverse_valve(c, demand, x, pressures, supply)
    empty_a, empty_b = (clip((c.return_pressure - pressure) / EMPTY, 0.0, 1.0) for pressure in pressures)
    length_a, length_b = chamber_lengths(c, x)
    demand -= empty_a * c.area_a / length_a * maximum(moved, 0.0) + empty_b * c.area_b / length_b * minimum(moved, 0.0)
    pushing = replace(c, edge_pa=c.edge_pa * (1.0 - empty_a), edge_pb=c.edge_pb * (1.0 - empty_b))
    if lines.compensated:
        spool = spool_for(c, deadband, inverse_valve(pushing, demand, x, pressures, supply))
        loads = ca.vertsplit(
            sensed(spool, overlap(c.openings, deadband), *pressures)
        )  # of the valves that open, without compensators
        held = ca.vertcat(*held_pressures(lines, loads, ca.vertsplit(supply)))
        kept = inverse_valve(pushing, demand, x, pressures, supply, held=held)
        fed = ca.DM(lines.feeds[lines.compensates].any(axis=0))
        opened = fed * kept + (1.0 - fed) * opened
    demand = demand * clip(ca.fabs(speed) / BEGIN - 1.0, 0.0, 1.0)
    for i in np.flatnonzero(lines.drop > 0.0).tolist():
        fed, outlet = ca.DM(lines.feeds[i]), lines.outlet[i]
        first, count = int(np.argmax(lines.feeds[i])), float(lines.feeds[i].sum())
        rated, centre = c.supply_pressure[first], conductance(lines.flow[i], lines.drop[i])
        low, high = ca.SX(outlet), 1.1 * rated
        for _ in range(ROUNDS):
            p = 0.5 * (low + high)
            u = inverse_valve(pushing, demand, x, pressures, p, checked, drained)
            narrowing = narrowed(clip(spool_for(c, deadband, u), -1.0, 1.0), lines.shut[i])
            into = where(demand > 0.0, c.edge_pa * checked(c, p - p_a), c.edge_pb * checked(c, p - p_b))
            taken = ca.dot(fed, c.edge * minimum(ca.fabs(u), 1.0) * into)
            through, _ = bypass(centre, ca.dot(fed, narrowing) / count, p - outlet)
            relieved = lines.flow[i] / (0.1 * rated) * maximum(p - rated, 0.0)
            left = minimum(lines.flow[i], lines.power[i] / p) - taken - through - relieved
            rises = left > lines.softness[i] / AHEAD_S * (p - supply[first])
            low, high = where(rises, p, low), where(rises, high, p)
        ahead = inverse_valve(pushing, demand, x, pressures, 0.5 * (low + high), checked, drained)
        opened = fed * ahead + (1.0 - fed) * opened
    return opened

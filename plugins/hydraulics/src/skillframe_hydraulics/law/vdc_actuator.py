r"""Virtual Decomposition Control of one hydraulic cylinder: valve command for a required piston force.

    f_pr = f_cr + Y_f theta_f,    Y_f = (y, xd_r),    theta_f' = rho_f Y_f^T (xd_r - xd) within bounds
    y = z + c (tanh(xd_r / v_s) - z),    z' = (xd_r - |xd_r| z) / z_ss,    c = f^2 / (f^2 + f_0^2)
    u_f = k_x (xd_r - xd) + k_f (f_pr - f_p) + f_pr'/B + A_a xd/(V_a/A_a + x) + A_b xd/(V_b/A_b + s - x)
          + c_l (1/(V_a/A_a + x) + 1/(V_b/A_b + s - x)) (p_a - p_b),    f_p = A_a p_a - A_b p_b
    u_e = u_f / (c_pa sqrt(p_S - p_a)/(V_a/A_a + x) + c_bt sqrt(p_b - p_R)/(V_b/A_b + s - x))    for u_f > 0,
    u_e = u_f / (c_pb sqrt(p_S - p_b)/(V_b/A_b + s - x) + c_at sqrt(p_a - p_R)/(V_a/A_a + x))    for u_f < 0,
    u = (1 - b) u_e + b tanh(u_e / w)

This is J. Koivumaki and J. Mattila's cylinder subsystem (data set of Petrovic and Mattila, Mech. Mach. Theory 170
(2022) 104680). With the exact inverse, (f_pr - f_p)'/B = -k_x (xd_r - xd) - k_f (f_pr - f_p), so (f_pr - f_p)^2 / (2 B
k_x) + (theta_f - theta_f^)^2 / (2 rho_f) is the accompanying function of a cylinder. Pressure drops are at least
`laminar_pressure`, where the published inverse is singular. The last line compensates the overlap b, smoothed over w =
0.2 % of the travel against chatter.

Where a counterbalance valve stands in series with an edge to the return line, c_at or c_bt u_e is that of both, by
`counterbalance`, and u_e is found by Newton's rule: the flow is concave in u_e, so it is approached from below.

Without force feedback (c = 0) friction has a bristle state z (Zhu and Piedboeuf, 2005). With feedback it is a flat
function of the required velocity: a bristle would answer the estimated force too late and a steep tanh too strongly,
and the machine would oscillate. f_0 is small, so that the two do not alternate while a tool lands. Formulas take arrays
(..., n) or casadi expressions.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from skillframe.frames import Float
from skillframe.robot import Actuation
from skillframe_hydraulics.checks.figures import EDGES, NEEDED, SHAPE, areas, is_motor, require_known
from skillframe_hydraulics.counterbalance import Counterbalance, conductances, counterbalances, narrowing
from skillframe_hydraulics.opening import ACROSS, Openings, openings, travel
from skillframe_hydraulics.symbolic_or_numeric import (
    absolute,
    copysign,
    exp,
    maximum,
    sign,
    sqrt,
    square_sum,
    tanh,
    where,
)

ROUNDS = 5  # of Newton's rule; 2e-5 of the flow are then missing at most, for edges that differ a hundredfold


@dataclass(frozen=True, slots=True, kw_only=True)
class Cylinders:
    """Nominal parameters of n cylinders, arrays (n,), SI, names of the contract.

    Attributes:
        area_a, area_b: piston and rod side [m^2]; edge: conductance of a valve edge [m^3/(s sqrt(Pa))].
        edge_pa, edge_pb, edge_at, edge_bt: of each edge, from the supply and to the return line, over `edge`.
        feed_check: 1 with a check valve against flow back into the supply line, else 0.
        arm_a, arm_b: dead volume over area [m]. deadband: overlap b of the spool, share of its travel.
        sliding: 1, or 0 of a motor. Its areas are volumes per radian [m^3], its chambers keep their volumes, its stroke
            is 0; what is in m, m/s and N of a cylinder is in rad, rad/s and Nm.
        presliding_length: z_ss [m].
        counterbalance: their counterbalance valves, None if there are none.
        openings: points of their valves' opening over the travel, None if there are none.
    """

    area_a: Float
    area_b: Float
    arm_a: Float
    arm_b: Float
    sliding: Float
    stroke: Float
    edge: Float
    bulk_modulus: Float
    leakage: Float
    coulomb_friction: Float
    viscous_friction: Float
    supply_pressure: Float
    return_pressure: Float
    laminar_pressure: Float
    deadband: Float
    presliding_length: Float
    edge_pa: Float
    edge_pb: Float
    edge_at: Float
    edge_bt: Float
    feed_check: Float
    counterbalance: Counterbalance | None = None
    openings: Openings | None = None


CYLINDER = tuple(name for name in Cylinders.__dataclass_fields__ if name not in ("counterbalance", "openings"))
"""Fields that are arrays (n,)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CylinderGains:
    """Velocity gain k_x and force gain k_f per cylinder (n,)."""

    velocity: Float
    force: Float


def cylinders(actuation: Sequence[Actuation], where: object = "robot.toml") -> Cylinders:
    """The controller's cylinders from a robot's `[[actuation]]`.

    Raises:
        InputError: a parameter is missing.
    """
    rows = [a.known for a in actuation]
    for each in actuation:
        require_known(each, NEEDED, where)
    p = {name: np.array([row[name] for row in rows], dtype=float) for name in NEEDED if name not in SHAPE}
    area_a, area_b = np.array([areas(each) for each in actuation], dtype=float).T.copy()
    sliding = np.array([0.0 if is_motor(each) else 1.0 for each in actuation])
    per_edge = np.array([1.0 if row.get("rated_drop_is_per_edge", True) else 0.5 for row in rows])
    stroke = np.array([0.0 if is_motor(each) else each.known["stroke"] for each in actuation], dtype=float)
    kept = ("bulk_modulus", "leakage", "coulomb_friction", "viscous_friction")
    pressures = ("supply_pressure", "return_pressure")
    return Cylinders(
        area_a=area_a, area_b=area_b, arm_a=p["dead_volume_a"] / area_a, arm_b=p["dead_volume_b"] / area_b,
        sliding=sliding, stroke=stroke,
        edge=p["rated_flow"] / np.sqrt(per_edge * p["rated_pressure_drop"]),
        laminar_pressure=np.array([row.get("laminar_pressure", 1e5) for row in rows], dtype=float),
        deadband=np.array([row.get("deadband", 0.0) for row in rows], dtype=float),
        presliding_length=np.array([row.get("presliding_length", 5e-4) for row in rows], dtype=float),
        **{name: p[name] for name in (*kept, *pressures)},
        **{name: np.array([row.get(name, 1.0) for row in rows], dtype=float) for name in EDGES},
        feed_check=np.array([row.get("feed_check", 0.0) for row in rows], dtype=float),
        counterbalance=counterbalances(actuation), openings=openings(actuation),
    )  # fmt: skip


def pressure_force(c: Any, pressure_a: Any, pressure_b: Any) -> Any:
    """f_p (..., n) of chamber pressures [N]."""
    return c.area_a * pressure_a - c.area_b * pressure_b


def friction_parameters(c: Cylinders) -> Float:
    """Nominal theta_f (2, n) of the friction law: F_C [N] and F_v [N s/m]."""
    return np.stack([c.coulomb_friction, c.viscous_friction])


def bristle_after(c: Any, bristle: Any, velocity: Any, dt: Any) -> Any:
    """Bristles z (..., n) after dt [s] at constant velocity, exactly."""
    way = sign(velocity)
    return way + (bristle - way) * exp(-absolute(velocity) * dt / c.presliding_length)


@dataclass(frozen=True, slots=True, kw_only=True)
class ContactFriction:
    """Force above which friction is that of contact, f_0 [N], and its width v_s [m/s]."""

    force: float = 500.0
    sliding: float = 1e-2


def coulomb_shape(bristle: Any, velocity: Any, force: Any, contact: Any) -> Any:
    """Shape y (..., n) for bristles and required velocities (..., n), and the force (..., m) on the tool."""
    square = square_sum(force)
    share = square / (square + contact.force**2)
    return bristle + share * (tanh(velocity / contact.sliding) - bristle)


def chamber_lengths(c: Any, x: Any) -> tuple[Any, Any]:
    """Volume over area (..., n) of chambers a and b [m] at piston positions."""
    return c.arm_a + c.sliding * x, c.arm_b + c.stroke - c.sliding * x


def flow_demand(c: Any, gains: Any, motion: tuple[Any, ...], force: tuple[Any, ...], pressures: tuple[Any, ...]) -> Any:
    """Flow demand u_f (..., n).

    `gains` are k_x and k_f; `motion` is piston position, velocity and required velocity; `force` is f_pr and its rate
    [N, N/s]; `pressures` are those of both chambers [Pa].
    """
    (x, xd, xd_r), (f_pr, rate), (p_a, p_b) = motion, force, pressures
    a, b = (1.0 / length for length in chamber_lengths(c, x))
    feedback = gains.velocity * (xd_r - xd) + gains.force * (f_pr - pressure_force(c, p_a, p_b))
    leak = c.leakage * (a + b) * (p_a - p_b)
    return feedback + rate / c.bulk_modulus + (c.area_a * a + c.area_b * b) * xd + leak


def least_root(c: Any, drop: Any) -> Any:
    """Root of a drop of at least `laminar_pressure` [sqrt(Pa)]."""
    return sqrt(maximum(drop, c.laminar_pressure))


def inverse_valve(
    c: Any,
    demand: Any,
    x: Any,
    pressures: tuple[Any, ...],
    supply: Any = None,
    root: Callable[..., Any] = least_root,
    out: Callable[..., Any] = least_root,
    held: Any = None,
) -> Any:
    """Unlimited opening u_e (..., n) of the edges for the flow demand, at the supply p_S or the nominal one.

    `root` and `out` are those of the drops from the supply and to the return line, of `c` and drops. `held` is p_H of
    compensated valves, see `skillframe_hydraulics.compensation`.
    """
    (p_a, p_b), high = pressures, c.supply_pressure if supply is None else supply
    behind_a, behind_b = (p_a, p_b) if held is None else (maximum(p_a, held), maximum(p_b, held))
    a, b = (1.0 / length for length in chamber_lengths(c, x))
    into_a, out_b = c.edge_pa * root(c, high - behind_a) * a, c.edge_bt * out(c, p_b - c.return_pressure) * b
    into_b, out_a = c.edge_pb * root(c, high - behind_b) * b, c.edge_at * out(c, p_a - c.return_pressure) * a
    opened = demand / (c.edge * where(demand > 0.0, into_a + out_b, into_b + out_a))
    if c.counterbalance is None:
        return opened
    held_a, held_b = conductances(c.counterbalance, p_a, p_b)
    into, out = c.edge * where(demand > 0.0, into_a, into_b), c.edge * where(demand > 0.0, out_b, out_a)
    wide, held = c.edge * where(demand > 0.0, c.edge_bt, c.edge_at), where(demand > 0.0, held_b, held_a)
    u = absolute(opened)
    for _ in range(ROUNDS):
        bent = narrowing(wide * u, held)
        u = u + (absolute(demand) - (into + out * bent) * u) / (into + out * bent * bent * bent)
    return copysign(u, demand)


def across_deadband(deadband: Any, opening: Any) -> Any:
    """Command u (..., n) for an opening u_e of a valve with overlap b."""
    return (1.0 - deadband) * opening + deadband * tanh(opening / ACROSS)


def spool_for(c: Any, deadband: Any, opening: Any) -> Any:
    """Command u (..., n) for an opening u_e, through `skillframe_hydraulics.opening`."""
    return travel(c.openings, across_deadband(deadband, opening))

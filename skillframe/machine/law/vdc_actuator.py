r"""Virtual Decomposition Control, one hydraulic cylinder: from a required piston force to a valve command.

    f_pr = f_cr + Y_f theta_f,    Y_f = (y, xd_r),    theta_f' = rho_f Y_f^T (xd_r - xd) within bounds
    y = z + c (tanh(xd_r / v_s) - z),    z' = (xd_r - |xd_r| z) / z_ss,    c = f^2 / (f^2 + f_0^2)
    u_f = k_x (xd_r - xd) + k_f (f_pr - f_p) + f_pr'/B + A_a xd/(V_a/A_a + x) + A_b xd/(V_b/A_b + s - x)
          + c_l (1/(V_a/A_a + x) + 1/(V_b/A_b + s - x)) (p_a - p_b),    f_p = A_a p_a - A_b p_b
    u_e = u_f / (c sqrt(p_S - p_a)/(V_a/A_a + x) + c sqrt(p_b - p_R)/(V_b/A_b + s - x))    for u_f > 0,
    u_e = u_f / (c sqrt(p_S - p_b)/(V_b/A_b + s - x) + c sqrt(p_a - p_R)/(V_a/A_a + x))    for u_f < 0,
    u = (1 - b) u_e + b tanh(u_e / w)

J. Koivumaki and J. Mattila's cylinder subsystem as published with the data set of Petrovic and Mattila, Mech. Mach.
Theory 170 (2022) 104680. With the exact inverse, (f_pr - f_p)'/B = -k_x (xd_r - xd) - k_f (f_pr - f_p), so
(f_pr - f_p)^2 / (2 B k_x) + (theta_f - theta_f^)^2 / (2 rho_f) is the accompanying function of a cylinder. Pressure
drops below `laminar_pressure` are raised to it (our choice): the published inverse divides by a root that vanishes. The
last line steps over the spool's overlap b; it is ours, and smooth over w = 0.2 % of the travel, because there the noise
of u_e would throw a spool to and fro (an exact inverse has a step of 2 b).

Where no force is fed back (c = 0) friction has a bristle's state z, as published (Zhu and Piedboeuf, 2005): a piston
that stops keeps the friction it had, and turns it round over z_ss. Where one is, it is a flat function of the required
velocity (our choice): there xd_r depends on the estimated force f, which a bristle answers a quarter of a period late
and a steep tanh too strongly, so that the machine swung by 1 kN where it should have stood. f_0 is small, so that the
two do not change places while a tool lands: with 1 kN it hopped.

The formulas of the law take arrays (..., n) or casadi expressions (n, 1), and cylinders and gains that hold either.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from skillframe.either import absolute, exp, maximum, sign, sqrt, square_sum, tanh, where
from skillframe.errors import InputError
from skillframe.frames import Float
from skillframe.robot.driven import Actuation

ACROSS = 2e-3  # w, share of the valve's travel
_NAMES = (
    "bore", "rod", "stroke", "dead_volume_a", "dead_volume_b", "bulk_modulus", "rated_flow", "rated_pressure_drop",
    "leakage", "coulomb_friction", "viscous_friction", "supply_pressure", "return_pressure",
)  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class Cylinders:
    """Parameters of n cylinders as the controller knows them, arrays (n,), SI, names of the contract.

    Attributes:
        area_a, area_b: piston and rod side [m^2]; edge: conductance of a valve edge [m^3/(s sqrt(Pa))].
        arm_a, arm_b: dead volume over area [m]. deadband: nominal overlap b of the spool, share of its travel.
        presliding_length: z_ss [m].
    """

    area_a: Float
    area_b: Float
    arm_a: Float
    arm_b: Float
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


@dataclass(frozen=True, slots=True, kw_only=True)
class CylinderGains:
    """Velocity gain k_x and force gain k_f per cylinder (n,). Published: 5e-3 and 2e-8, extension 1e-3 and 8e-9."""

    velocity: Float
    force: Float


def cylinders(actuation: Sequence[Actuation], where: object = "robot.toml") -> Cylinders:
    """The controller's cylinders from a robot's `[[actuation]]`.

    Raises:
        InputError: a parameter is missing.
    """
    rows = [a.known for a in actuation]
    for a in actuation:
        missing = [name for name in _NAMES if name not in a.known]
        if missing:
            text = f"the cylinder on {a.joint} has no {', '.join(missing)}"
            raise InputError(where, text, "add it to parameters or nominal of its [[actuation]]")
    p = {name: np.array([row[name] for row in rows], dtype=float) for name in _NAMES}
    area_a = math.pi / 4 * p["bore"] ** 2
    area_b = area_a - math.pi / 4 * p["rod"] ** 2
    per_edge = np.array([1.0 if row.get("rated_drop_is_per_edge", True) else 0.5 for row in rows])
    kept = ("stroke", "bulk_modulus", "leakage", "coulomb_friction", "viscous_friction")
    pressures = ("supply_pressure", "return_pressure")
    return Cylinders(
        area_a=area_a, area_b=area_b, arm_a=p["dead_volume_a"] / area_a, arm_b=p["dead_volume_b"] / area_b,
        edge=p["rated_flow"] / np.sqrt(per_edge * p["rated_pressure_drop"]),
        laminar_pressure=np.array([row.get("laminar_pressure", 1e5) for row in rows], dtype=float),
        deadband=np.array([row.get("deadband", 0.0) for row in rows], dtype=float),
        presliding_length=np.array([row.get("presliding_length", 5e-4) for row in rows], dtype=float),
        **{name: p[name] for name in (*kept, *pressures)},
    )  # fmt: skip


def pressure_force(c: Any, pressure_a: Any, pressure_b: Any) -> Any:
    """f_p (..., n) of chamber pressures [N]."""
    return c.area_a * pressure_a - c.area_b * pressure_b


def friction_parameters(c: Cylinders) -> Float:
    """theta_f (2, n) of the friction law: F_C [N] and F_v [N s/m], as the controller knows them."""
    return np.stack([c.coulomb_friction, c.viscous_friction])


def bristle_after(c: Any, bristle: Any, velocity: Any, dt: Any) -> Any:
    """Bristles z (..., n) after a sample of dt [s] at one velocity, exactly."""
    way = sign(velocity)
    return way + (bristle - way) * exp(-absolute(velocity) * dt / c.presliding_length)


@dataclass(frozen=True, slots=True, kw_only=True)
class ContactFriction:
    """From which force on it is that of contact, f_0 [N], and how flat it then is, v_s [m/s]."""

    force: float = 500.0
    sliding: float = 1e-2


def coulomb_shape(bristle: Any, velocity: Any, force: Any, contact: Any) -> Any:
    """Shape y (..., n) of bristles and required velocities (..., n), and the force (..., 2) on the tool."""
    square = square_sum(force)
    share = square / (square + contact.force**2)
    return bristle + share * (tanh(velocity / contact.sliding) - bristle)


def flow_demand(c: Any, gains: Any, motion: tuple[Any, ...], force: tuple[Any, ...], pressures: tuple[Any, ...]) -> Any:
    """u_f (..., n).

    Args:
        c: the cylinders.
        gains: k_x and k_f, as `CylinderGains` has them.
        motion: piston position, velocity and required velocity.
        force: required pressure force f_pr and its rate [N, N/s].
        pressures: of both chambers [Pa].
    """
    (x, xd, xd_r), (f_pr, rate), (p_a, p_b) = motion, force, pressures
    a, b = 1.0 / (c.arm_a + x), 1.0 / (c.arm_b + c.stroke - x)
    feedback = gains.velocity * (xd_r - xd) + gains.force * (f_pr - pressure_force(c, p_a, p_b))
    leak = c.leakage * (a + b) * (p_a - p_b)
    return feedback + rate / c.bulk_modulus + (c.area_a * a + c.area_b * b) * xd + leak


def inverse_valve(c: Any, demand: Any, x: Any, pressures: tuple[Any, ...], supply: Any = None) -> Any:
    """Opening u_e (..., n) of the edges, not limited, that makes the flow demand. Supply: p_S, nominal if not given."""
    (p_a, p_b), high = pressures, c.supply_pressure if supply is None else supply
    a, b = 1.0 / (c.arm_a + x), 1.0 / (c.arm_b + c.stroke - x)
    extend = sqrt(_drop(c, high - p_a)) * a + sqrt(_drop(c, p_b - c.return_pressure)) * b
    retract = sqrt(_drop(c, high - p_b)) * b + sqrt(_drop(c, p_a - c.return_pressure)) * a
    return demand / (c.edge * where(demand > 0.0, extend, retract))


def across_deadband(deadband: Any, opening: Any) -> Any:
    """Command u (..., n) that opens a valve of overlap b as wanted, u_e."""
    return (1.0 - deadband) * opening + deadband * tanh(opening / ACROSS)


def _drop(c: Any, drop: Any) -> Any:
    return maximum(drop, c.laminar_pressure)

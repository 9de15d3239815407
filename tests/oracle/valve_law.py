"""The cylinder's law over arrays, a second time, and the cylinder that it inverts.

The second opinion on the formulas that the product writes once for arrays and expressions.
"""

from __future__ import annotations

import numpy as np
from skillframe_hydraulics.law.vdc_actuator import ACROSS, ContactFriction, CylinderGains, Cylinders

from skillframe.frames import Float

SLIDING = 5e-3  # m/s at which friction without a state has risen to tanh(1)


def pressure_force(c: Cylinders, pressure_a: Float, pressure_b: Float) -> Float:
    """f_p (..., n) of chamber pressures [N]."""
    return np.asarray(c.area_a * pressure_a - c.area_b * pressure_b)


def friction(c: Cylinders, velocity: Float) -> Float:
    """Coulomb and viscous friction (..., n) against a sliding piston [N]."""
    return np.asarray(c.coulomb_friction * np.tanh(velocity / SLIDING) + c.viscous_friction * velocity)


def friction_regressor(velocity: Float, shape: Float | None = None) -> Float:
    """Y_f (..., 2, n) of velocities (..., n): friction is the sum of Y_f theta_f over the second axis from the end.

    shape: y (..., n); tanh(v / 5 mm/s) where it is not given.
    """
    return np.stack([np.tanh(velocity / SLIDING) if shape is None else shape, velocity], axis=-2)


def bristle_after(c: Cylinders, bristle: Float, velocity: Float, dt: float) -> Float:
    """Bristles z (..., n) after a sample of dt [s] at one velocity, exactly."""
    way = np.sign(velocity)
    return np.asarray(way + (bristle - way) * np.exp(-np.abs(velocity) * dt / c.presliding_length))


def coulomb_shape(bristle: Float, velocity: Float, force: Float, contact: ContactFriction) -> Float:
    """Shape y (..., n) of bristles and required velocities (..., n), and the force (..., 2) on the tool."""
    square = np.sum(np.square(force), axis=-1, keepdims=True)
    share = square / (square + contact.force**2)
    return np.asarray(bristle + share * (np.tanh(velocity / contact.sliding) - bristle))


def pressure_rates(
    c: Cylinders, pressures: tuple[Float, Float], x: Float, xd: Float, command: Float
) -> tuple[Float, Float]:
    """Rates of both chamber pressures with a valve that follows at once; the model that the law inverts."""
    p_a, p_b = pressures
    out, u_e = command > 0.0, opening(c.deadband, command)
    wide_a, wide_b = np.where(out, c.edge_pa, c.edge_at), np.where(out, c.edge_bt, c.edge_pb)
    drop_a = np.where(out, _drop(c, c.supply_pressure - p_a), _drop(c, p_a - c.return_pressure))
    drop_b = np.where(out, _drop(c, p_b - c.return_pressure), _drop(c, c.supply_pressure - p_b))
    q_a, q_b = u_e * c.edge * wide_a * np.sqrt(drop_a), u_e * c.edge * wide_b * np.sqrt(drop_b)
    leak = c.leakage * (p_a - p_b)
    rate_a = c.bulk_modulus / (c.area_a * (c.arm_a + x)) * (q_a - leak - c.area_a * xd)
    rate_b = c.bulk_modulus / (c.area_b * (c.arm_b + c.stroke - x)) * (leak + c.area_b * xd - q_b)
    return rate_a, rate_b


def flow_demand(
    c: Cylinders, gains: CylinderGains, motion: tuple[Float, Float, Float], force: tuple[Float, Float],
    pressures: tuple[Float, Float],
) -> Float:  # fmt: skip
    """u_f (..., n).

    Args:
        c: the cylinders.
        gains: k_x and k_f.
        motion: piston position, velocity and required velocity.
        force: required pressure force f_pr and its rate [N, N/s].
        pressures: of both chambers [Pa].
    """
    (x, xd, xd_r), (f_pr, rate), (p_a, p_b) = motion, force, pressures
    x = np.where(c.stroke > 0.0, x, 0.0)  # a motor's chambers keep their volumes
    a, b = 1.0 / (c.arm_a + x), 1.0 / (c.arm_b + c.stroke - x)
    feedback = gains.velocity * (xd_r - xd) + gains.force * (f_pr - pressure_force(c, p_a, p_b))
    leak = c.leakage * (a + b) * (p_a - p_b)
    return np.asarray(feedback + rate / c.bulk_modulus + (c.area_a * a + c.area_b * b) * xd + leak)


def inverse_valve(
    c: Cylinders, demand: Float, x: Float, pressures: tuple[Float, Float], supply: Float | None = None,
    held: Float | None = None,
) -> Float:  # fmt: skip
    """Opening u_e (..., n) of the edges, not limited, that makes the flow demand; supply: p_S, nominal if not given.

    held: least pressure behind the edges from the supply.
    """
    (p_a, p_b), high = pressures, c.supply_pressure if supply is None else supply
    in_a, in_b = pressures if held is None else [np.where(held > p, held, p) for p in pressures]
    x = np.where(c.stroke > 0.0, x, 0.0)  # a motor's chambers keep their volumes
    a, b = 1.0 / (c.arm_a + x), 1.0 / (c.arm_b + c.stroke - x)
    extend = np.sqrt(_drop(c, high - in_a)) * a + np.sqrt(_drop(c, p_b - c.return_pressure)) * b
    retract = np.sqrt(_drop(c, high - in_b)) * b + np.sqrt(_drop(c, p_a - c.return_pressure)) * a
    return np.asarray(demand / (c.edge * np.where(demand > 0.0, extend, retract)))


def compensated(
    c: Cylinders, demand: Float, x: Float, pressures: tuple[Float, Float], supply: Float, deadband: Float,
    margin: float | None,
) -> Float:  # fmt: skip
    """u_e (N, n) of one pump's compensated valves of full chambers; margin: of pre-compensated ones, None of others."""
    if margin is not None:
        return inverse_valve(c, demand, x, pressures, supply, supply - margin)
    u = across_deadband(deadband, inverse_valve(c, demand, x, pressures, supply))
    load = np.where(np.abs(u) > deadband + 2e-3, np.where(u > 0.0, *pressures), 0.0)
    return inverse_valve(c, demand, x, pressures, supply, load.max(axis=-1, keepdims=True))


def opening(deadband: Float, command: Float) -> Float:
    """u_e (..., n) that a command opens; the overlap opens nothing."""
    return np.asarray(np.copysign(np.maximum(np.abs(command) - deadband, 0.0) / (1.0 - deadband), command))


def across_deadband(deadband: Float, opening: Float) -> Float:
    """Command u (..., n) that opens a valve of overlap b as wanted, u_e."""
    return np.asarray((1.0 - deadband) * opening + deadband * np.tanh(opening / ACROSS))


def through_points(c: Cylinders, command: Float) -> Float:
    """Travels (N, n) at which the valves' points give these openings, across the overlap as `across_deadband`."""
    size, found = np.abs(command).clip(max=1.0), command.copy()
    for i in np.flatnonzero(c.openings.has if c.openings else ()):
        travel, share = c.openings.travel[:, i], c.openings.share[:, i]
        overlap = travel[0] * (np.tanh(size[:, i] / ACROSS) - 1.0)
        found[:, i] = np.copysign(np.interp(size[:, i], share, travel) + overlap, command[:, i])
    return found


def _drop(c: Cylinders, drop: Float) -> Float:
    return np.maximum(drop, c.laminar_pressure)


def pursued(imbalance: Float, force: Float, sigma: Float) -> Float:
    """Share (..., 1) of an imbalance T (..., 2) that is pursued, with a force (..., 2) known to sigma (..., 2) [N]."""
    certain = np.maximum(sigma, 1e-3)
    touch = np.sum(np.square(force / (2.0 * certain)), axis=-1, keepdims=True) ** 2
    worth = np.sum(np.square(imbalance / (1.5 * certain)), axis=-1, keepdims=True) ** 4
    return np.asarray(1.0 - touch / (1.0 + touch) / (1.0 + worth))

r"""Equations of the hydraulic cylinder over arrays of cylinders, a readable counterpart of fmus/hydraulic_cylinder.

States \(x_s, \dot x_s, p_a, p_b, z\): spool and its velocity, gauge pressures of the chambers, deflection of the
seals. Equation numbers and sources are those of fmus/hydraulic_cylinder/README.md. Quantities are
arrays (n,), floats or casadi expressions.
"""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np

from skillframe.fmu import Float
from skillframe_hydraulics.counterbalance import conductances, narrowing
from skillframe_hydraulics.symbolic_or_numeric import (
    absolute,
    clip,
    copysign,
    exp,
    maximum,
    sqrt,
    stack,
    where,
)

AMBIENT = 101325.0  # Pa
HOLE = 0.0325  # 0.67 sqrt(2 / (850 kg/m^3)), flow through a sharp hole per area and sqrt(Pa)
VAPOUR, BOILING = -0.9e5, 0.1e5
FLOOR = VAPOUR - BOILING
STATES = ("spool", "spool_velocity", "pressure_a", "pressure_b", "deflection")


class PistonMotion(NamedTuple):
    """Inputs of the oil's equations at an instant.

    Piston position [m] and velocity [m/s], spool command [-1, 1], areas of holes in the hoses [m^2], pressure lost
    before the valve [Pa], pressure that a compensator holds behind the edge from the supply [Pa], 0 without one.
    """

    position: Float
    velocity: Float
    demand: Float
    burst_a: Float | float = 0.0
    burst_b: Float | float = 0.0
    supply_drop: Float | float = 0.0
    held_pressure: Float | float = 0.0


class Flows(NamedTuple):
    """Valve flows into chambers a and b and out of the supply line [m^3/s], the last with its slope [m^3/(s Pa)]."""

    a: Float
    b: Float
    supply: Float
    supply_slope: Float


def derive(values: dict[str, Any]) -> SimpleNamespace:
    """Parameters with derived ones: areas [m^2], edge conductances, spool frequency [rad/s]."""
    p = SimpleNamespace(**values)
    p.slides = np.where(p.displacement > 0, 0.0, 1.0)  # a motor's chambers keep their volumes, and it has no ends
    piston = math.pi / 4 * p.bore**2
    p.area_a = np.where(p.displacement > 0, p.displacement, piston)
    p.area_b = np.where(p.displacement > 0, p.displacement, piston - math.pi / 4 * p.rod**2)
    drop = p.rated_pressure_drop * np.where(p.rated_drop_is_per_edge, 1.0, 0.5)
    p.edge = p.rated_flow / np.sqrt(drop)
    p.cushion = p.cushion_flow / np.sqrt(p.rated_pressure_drop)
    p.omega = 2 * math.pi * p.spool_frequency
    p.stiffness = p.coulomb_friction / p.presliding_length
    p.counterbalance_edge = p.counterbalance_flow / np.sqrt(p.counterbalance_drop)
    p.holds_a, p.holds_b = (np.where(x > 0, 1.0, 0.0) for x in (p.counterbalance_a, p.counterbalance_b))
    p.has_counterbalance = bool(np.any(p.holds_a + p.holds_b > 0))
    p.has_points = bool(np.any(p.opening_points > 0))
    for i in range(1, 8):  # behind the last point travel and opening are 1
        for name in (f"travel_{i + 1}", f"opening_{i + 1}"):
            setattr(p, name, np.where(p.opening_points > i, getattr(p, name), 1.0))
        width = getattr(p, f"travel_{i + 1}") - getattr(p, f"travel_{i}")
        rise = getattr(p, f"opening_{i + 1}") - getattr(p, f"opening_{i}")
        setattr(p, f"steep_{i}", np.where(width > 0.0, rise / np.where(width > 0.0, width, 1.0), 0.0))
    p.has_air, p.has_cushion = bool(np.any(p.air_fraction > 0)), bool(np.any(p.cushion_length > 0))
    p.has_stribeck = bool(np.any(p.static_friction > p.coulomb_friction))
    return p


def edge_flow(dp: Float, transition: Float) -> Float:
    """Eq. 3: flow of an edge per conductance, linear for small drops, a square root for large ones."""
    result: Float = dp / sqrt(sqrt(dp * dp + transition * transition))
    return result


def edge_slope(dp: Float, transition: Float) -> Float:
    """Derivative of `edge_flow` by the drop."""
    square = dp * dp + transition * transition
    result: Float = (square - 0.5 * dp * dp) / (square * sqrt(sqrt(square)))
    return result


def bulk_modulus(pressure: Float, p: SimpleNamespace) -> Float:
    """Eq. 5: effective bulk modulus of oil, hoses and undissolved air [Pa] at a gauge pressure [Pa]."""
    oil: Float = p.bulk_modulus + p.bulk_modulus_slope * pressure
    if not p.has_air:
        return oil
    gas, polytropic = maximum(pressure + AMBIENT, 100.0), 1.4  # Pa, exponent
    bubbles = p.air_fraction * (AMBIENT / gas) ** (1 / polytropic)
    pure = 1.0 - p.air_fraction
    result: Float = (pure + bubbles) / (pure / oil + bubbles / (polytropic * gas))
    return result


def opening(p: SimpleNamespace, spool: Float) -> Float:
    """Eq. 2: opening of the edges from the spool's position, -1 to 1, zero within the overlap."""
    x = clip(spool, -1.0, 1.0)
    plain: Float = copysign(maximum(absolute(x) - p.deadband, 0.0) / (1.0 - p.deadband), x)
    if not p.has_points:
        return plain
    total = 0.0 * x
    for i in range(1, 8):
        start, end = getattr(p, f"travel_{i}"), getattr(p, f"travel_{i + 1}")
        total = total + getattr(p, f"steep_{i}") * clip(absolute(x) - start, 0.0, end - start)
    result: Float = where(p.opening_points > 0.0, copysign(total, x), plain)
    return result


def _throttled(conductance: Float, room: Float, drop: Float, p: SimpleNamespace) -> Float:
    """Eq. 6: conductance of an edge in series with an end cushion, with the piston `room` from its end."""
    if not p.has_cushion:
        return conductance
    with np.errstate(divide="ignore", invalid="ignore"):
        closing = where(p.cushion_length > 0, p.slides * clip(1.0 - room / p.cushion_length, 0.0, 1.0), 0.0)
    q = where(drop > 0.0, conductance * closing / p.cushion, 0.0)
    result: Float = conductance / sqrt(1.0 + q * q)
    return result


def valve_flows(
    p: SimpleNamespace, spool: Float, pa: Float, pb: Float, ps: Float, position: Float, held: Float | float = 0.0
) -> Flows:
    """Eq. 3: flows of the four edges: a positive spool connects supply to a and b to return. `held`: eq. 14."""
    u = p.edge * opening(p, spool)
    extend, retract = maximum(u, 0.0), maximum(-u, 0.0)
    drop_a, drop_b, tr = pa - p.return_pressure, pb - p.return_pressure, p.laminar_pressure
    open_a, open_b = p.edge_pa * extend, p.edge_pb * retract
    check_a = check_b = p.feed_check
    if p.has_counterbalance:  # each has a check valve
        check_a, check_b = maximum(check_a, p.holds_a), maximum(check_b, p.holds_b)
    behind_a, behind_b = (where(held * (held > pressure) > 0.0, held, pressure) for pressure in (pa, pb))
    open_a, open_b = (
        opened * where(maximum(check, 1.0 * (behind > pressure)) * (behind - ps) > 0.0, 0.0, 1.0)
        for opened, check, behind, pressure in ((open_a, check_a, behind_a, pa), (open_b, check_b, behind_b, pb))
    )
    into_a, into_b = open_a * edge_flow(ps - behind_a, tr), open_b * edge_flow(ps - behind_b, tr)
    slope = open_a * edge_slope(ps - behind_a, tr) + open_b * edge_slope(ps - behind_b, tr)
    wide_a = _throttled(p.edge_at * retract, position, drop_a, p)
    wide_b = _throttled(p.edge_bt * extend, p.stroke - position, drop_b, p)
    if p.has_counterbalance:
        held_a, held_b = conductances(p, pa, pb)
        wide_a = wide_a * where(drop_a > 0.0, narrowing(wide_a, held_a), 1.0)
        wide_b = wide_b * where(drop_b > 0.0, narrowing(wide_b, held_b), 1.0)
    out_a, out_b = wide_a * edge_flow(drop_a, tr), wide_b * edge_flow(drop_b, tr)
    return Flows(into_a - out_a, into_b - out_b, into_a + into_b, slope)


def port_flow(p: SimpleNamespace, pressure: Float) -> Float:
    """Eq. 7: flow into a chamber from the anti-cavitation check (positive) or port relief (negative)."""
    relief = p.relief_conductance * maximum(pressure - p.relief_pressure, 0.0)
    result: Float = p.check_conductance * maximum(p.return_pressure - pressure, 0.0) - relief
    return result


def burst_flow(p: SimpleNamespace, area: Float | float, pressure: Float) -> Float:
    """Eq. 11: flow into a chamber through a hole in its hose, negative above ambient pressure."""
    result: Float = -(area * HOLE) * edge_flow(pressure, p.laminar_pressure)
    return result


def held_burst_flow(p: SimpleNamespace, area: Float | float, pressure: Float, valve: Float, flow: Float) -> Float:
    """Eq. 13: flow into a chamber through a hole in the hose before its counterbalance valve, of conductance `valve`.

    The spool's `flow` goes out of the hole first. Of the chamber's oil only what the valve passes is lost.
    """
    hole = -burst_flow(p, area, pressure)
    through = hole * narrowing(area * HOLE, valve)
    result: Float = -where(pressure > 0.0, clip(maximum(flow, 0.0), through, hole), hole)
    return result


def boiling(pressure: Float, net: Float) -> Float:
    """Eq. 4: factor on the rate of a falling pressure while the oil boils, else 1."""
    result: Float = where(net < 0.0, clip(1.0 + (pressure - VAPOUR) / BOILING, 0.0, 1.0), 1.0)
    return result


def sliding_deflection(p: SimpleNamespace, velocity: Float) -> Float:
    """Eq. 8: deflection of the seals in steady sliding [m], longer near standstill if break-away exceeds Coulomb."""
    if not p.has_stribeck:
        length: Float = p.presliding_length + 0.0 * velocity
        return length
    with np.errstate(divide="ignore", invalid="ignore"):
        excess = where(p.coulomb_friction > 0, maximum(p.static_friction / p.coulomb_friction - 1.0, 0.0), 0.0)
    result: Float = p.presliding_length * (1.0 + excess * exp(-((velocity / p.stribeck_velocity) ** 2)))
    return result


def friction_force(p: SimpleNamespace, deflection: Float, velocity: Float) -> Float:
    """Eq. 8: force against the motion [N]."""
    result: Float = p.stiffness * deflection + p.viscous_friction * velocity
    return result


def end_stop_force(p: SimpleNamespace, position: Float, velocity: Float) -> Float:
    """Eq. 9: pushing force of the end stops on the piston [N]."""
    low, high = -position, position - p.stroke
    k, d = p.endstop_stiffness, p.endstop_damping
    push = where(low > 0, maximum(k * low - d * velocity, 0.0), 0.0)
    result: Float = p.slides * (push - where(high > 0, maximum(k * high + d * velocity, 0.0), 0.0))
    return result


def piston_force(p: SimpleNamespace, y: Float, position: Float, velocity: Float) -> Float:
    """Eq. 9: force on the piston [N], positive extends, from states `y` (5, n)."""
    result: Float = (
        p.area_a * y[2] - p.area_b * y[3] - friction_force(p, y[4], velocity) + end_stop_force(p, position, velocity)
    )
    return result


def volumes(p: SimpleNamespace, position: Float) -> tuple[Float, Float]:
    """Volumes of both chambers [m^3], which a motor does not change."""
    volume_a: Float = p.dead_volume_a + p.area_a * (p.slides * position)
    volume_b: Float = p.dead_volume_b + p.area_b * (p.slides * (p.stroke - position))
    return volume_a, volume_b


def pressure_rates(p: SimpleNamespace, y: Float, motion: PistonMotion) -> Float:
    """Eq. 4: rates of the pressures (2, n) [Pa/s]."""
    pa, pb = y[2], y[3]
    supply = p.supply_pressure - motion.supply_drop
    flows = valve_flows(p, y[0], pa, pb, supply, motion.position, motion.held_pressure)
    leak = p.leakage * (pa - pb)
    burst_a, burst_b = burst_flow(p, motion.burst_a, pa), burst_flow(p, motion.burst_b, pb)
    if p.has_counterbalance:
        held_a, held_b = conductances(p, pa, pb)
        burst_a = held_burst_flow(p, motion.burst_a, pa, held_a, flows.a)
        burst_b = held_burst_flow(p, motion.burst_b, pb, held_b, flows.b)
    net_a = flows.a + port_flow(p, pa) - p.area_a * motion.velocity - leak + burst_a
    net_b = flows.b + port_flow(p, pb) + p.area_b * motion.velocity + leak + burst_b
    volume_a, volume_b = volumes(p, motion.position)
    rate_a = bulk_modulus(pa, p) / volume_a * net_a * boiling(pa, net_a)
    rate_b = bulk_modulus(pb, p) / volume_b * net_b * boiling(pb, net_b)
    result: Float = stack([rate_a, rate_b])
    return result


def rates(p: SimpleNamespace, y: Float, motion: PistonMotion) -> Float:
    """Rates of all states (5, n): eq. 2 for the spool, eq. 4 for the pressures, eq. 8 for the seals."""
    pull = p.omega**2 * (motion.demand - y[0]) - 2 * p.spool_damping * p.omega * y[1]
    pressures = pressure_rates(p, y, motion)
    slip = motion.velocity - absolute(motion.velocity) * y[4] / sliding_deflection(p, motion.velocity)
    result: Float = stack([y[1], pull, pressures[0], pressures[1], slip])
    return result


def equilibrium(p: SimpleNamespace, command: Float) -> Float:
    """Eq. 10: states (5, n) at rest, with pressures that hold `initial_force`."""
    low, over = p.initial_pressure, p.initial_force - (p.area_a - p.area_b) * p.initial_pressure
    pa = np.where(over > 0, low + over / p.area_a, low)
    pb = np.where(over > 0, low, low - over / p.area_b)
    u = np.clip(command, -1.0, 1.0)
    zero = np.zeros(np.shape(u))
    return np.stack([u, zero, pa + zero, pb + zero, zero])

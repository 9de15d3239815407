r"""The hydraulic cylinder's equations over arrays of cylinders: the readable twin of fmus/hydraulic_cylinder.

States \(x_s, \dot x_s, p_a, p_b, p_S, z\): spool, its velocity, gauge pressures of both chambers and of the supply
line, deflection of the seals. Equation numbers are those of fmus/hydraulic_cylinder/README.md, which names the sources.
Every quantity is an array (n,), a float, or a casadi expression (`either`); nothing here knows about steps, files or
the standard.
"""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np

from skillframe.either import absolute, clip, copysign, exp, maximum, minimum, sqrt, stack, where
from skillframe.fmu.actuator import Float

AMBIENT = 101325.0
POLYTROPIC = 1.4
LEAST_ABSOLUTE = 100.0
HOLE = 0.0325  # 0.67 sqrt(2 / (850 kg/m^3)), flow through a sharp hole per area and sqrt(Pa)
VAPOUR, BOILING = -0.9e5, 0.1e5
FLOOR = VAPOUR - BOILING
STATES = ("spool", "spool_velocity", "pressure_a", "pressure_b", "pressure_supply", "deflection")


class PistonMotion(NamedTuple):
    """What drives the oil at an instant.

    Piston position [m] and velocity [m/s], command the spool follows [-1, 1], flow of others [m^3/s], areas of holes in
    the hoses [m^2], pressure that is lost before the valve [Pa].
    """

    position: Float
    velocity: Float
    demand: Float
    other_flow: Float
    burst_a: Float | float = 0.0
    burst_b: Float | float = 0.0
    supply_drop: Float | float = 0.0


class Flows(NamedTuple):
    """Valve flows into chambers a and b and out of the supply line [m^3/s]."""

    a: Float
    b: Float
    supply: Float


def derive(values: dict[str, Any]) -> SimpleNamespace:
    """Parameters by name, with what follows from them: areas [m^2], edge conductances, spool frequency [rad/s]."""
    p = SimpleNamespace(**values)
    p.area_a = math.pi / 4 * p.bore**2
    p.area_b = p.area_a - math.pi / 4 * p.rod**2
    drop = p.rated_pressure_drop * np.where(p.rated_drop_is_per_edge, 1.0, 0.5)
    p.edge = p.rated_flow / np.sqrt(drop)
    p.cushion = p.cushion_flow / np.sqrt(p.rated_pressure_drop)
    p.omega = 2 * math.pi * p.spool_frequency
    p.stiffness = p.coulomb_friction / p.presliding_length
    p.pump_slope = p.pump_flow / p.pump_droop
    p.has_air, p.has_cushion = bool(np.any(p.air_fraction > 0)), bool(np.any(p.cushion_length > 0))
    p.has_pump, p.has_stribeck = bool(np.any(p.pump_flow > 0)), bool(np.any(p.static_friction > p.coulomb_friction))
    return p


def edge_flow(dp: Float, transition: Float) -> Float:
    """Eq. 3: flow of an edge per unit conductance, linear for small drops and a square root for large ones."""
    result: Float = dp / sqrt(sqrt(dp * dp + transition * transition))
    return result


def bulk_modulus(pressure: Float, p: SimpleNamespace) -> Float:
    """Eq. 5: effective bulk modulus of oil with hoses and undissolved air [Pa] at a gauge pressure [Pa]."""
    oil: Float = p.bulk_modulus + p.bulk_modulus_slope * pressure
    if not p.has_air:
        return oil
    gas = maximum(pressure + AMBIENT, LEAST_ABSOLUTE)
    bubbles = p.air_fraction * (AMBIENT / gas) ** (1 / POLYTROPIC)
    pure = 1.0 - p.air_fraction
    result: Float = (pure + bubbles) / (pure / oil + bubbles / (POLYTROPIC * gas))
    return result


def opening(spool: Float, deadband: Float) -> Float:
    """Eq. 2: opening of the edges from the spool's position, -1 to 1. The overlap opens nothing."""
    x = clip(spool, -1.0, 1.0)
    result: Float = copysign(maximum(absolute(x) - deadband, 0.0) / (1.0 - deadband), x)
    return result


def _throttled(conductance: Float, room: Float, drop: Float, p: SimpleNamespace) -> Float:
    """Eq. 6: conductance of an edge in series with the cushion of the end that the piston is `room` away from."""
    if not p.has_cushion:
        return conductance
    with np.errstate(divide="ignore", invalid="ignore"):
        closing = where(p.cushion_length > 0, clip(1.0 - room / p.cushion_length, 0.0, 1.0), 0.0)
    q = where(drop > 0.0, conductance * closing / p.cushion, 0.0)
    result: Float = conductance / sqrt(1.0 + q * q)
    return result


def valve_flows(p: SimpleNamespace, spool: Float, pa: Float, pb: Float, ps: Float, position: Float) -> Flows:
    """Flows of the four edges: supply to a and b to return when the spool is positive, the other way round if not."""
    u = p.edge * opening(spool, p.deadband)
    extend, retract = maximum(u, 0.0), maximum(-u, 0.0)
    drop_a, drop_b, tr = pa - p.return_pressure, pb - p.return_pressure, p.laminar_pressure
    into_a, into_b = extend * edge_flow(ps - pa, tr), retract * edge_flow(ps - pb, tr)
    out_a = _throttled(retract, position, drop_a, p) * edge_flow(drop_a, tr)
    out_b = _throttled(extend, p.stroke - position, drop_b, p) * edge_flow(drop_b, tr)
    return Flows(into_a - out_a, into_b - out_b, into_a + into_b)


def port_flow(p: SimpleNamespace, pressure: Float) -> Float:
    """Eq. 7: into a chamber, from the anti-cavitation check (positive) or through port relief (negative)."""
    relief = p.relief_conductance * maximum(pressure - p.relief_pressure, 0.0)
    result: Float = p.check_conductance * maximum(p.return_pressure - pressure, 0.0) - relief
    return result


def burst_flow(p: SimpleNamespace, area: Float | float, pressure: Float) -> Float:
    """Eq. 11: into a chamber through a hole of this area in its hose, negative while the chamber is above ambient."""
    result: Float = -(area * HOLE) * edge_flow(pressure, p.laminar_pressure)
    return result


def boiling(pressure: Float, net: Float) -> Float:
    """Eq. 4: share of a falling pressure's rate that is left as the oil boils. 1 while it does not."""
    result: Float = where(net < 0.0, clip(1.0 + (pressure - VAPOUR) / BOILING, 0.0, 1.0), 1.0)
    return result


def sliding_deflection(p: SimpleNamespace, velocity: Float) -> Float:
    """Eq. 8: deflection of the seals in steady sliding [m], longer near standstill where break-away exceeds Coulomb."""
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
    """Eq. 9: force of the end stops on the piston [N]. They push and never pull."""
    low, high = -position, position - p.stroke
    k, d = p.endstop_stiffness, p.endstop_damping
    push = where(low > 0, maximum(k * low - d * velocity, 0.0), 0.0)
    result: Float = push - where(high > 0, maximum(k * high + d * velocity, 0.0), 0.0)
    return result


def piston_force(p: SimpleNamespace, y: Float, position: Float, velocity: Float) -> Float:
    """Eq. 9: force on the piston [N], positive extends. `y` (6, n) are the states."""
    result: Float = (
        p.area_a * y[2] - p.area_b * y[3] - friction_force(p, y[5], velocity) + end_stop_force(p, position, velocity)
    )
    return result


def pressure_rates(p: SimpleNamespace, y: Float, motion: PistonMotion) -> Float:
    """Eq. 4: rates of the pressures (3, n) [Pa/s]."""
    pa, pb, ps = y[2], y[3], y[4]
    flows = valve_flows(p, y[0], pa, pb, ps - motion.supply_drop, motion.position)
    leak = p.leakage * (pa - pb)
    net_a = flows.a + port_flow(p, pa) - p.area_a * motion.velocity - leak + burst_flow(p, motion.burst_a, pa)
    net_b = flows.b + port_flow(p, pb) + p.area_b * motion.velocity + leak + burst_flow(p, motion.burst_b, pb)
    volume_a = p.dead_volume_a + p.area_a * motion.position
    volume_b = p.dead_volume_b + p.area_b * (p.stroke - motion.position)
    rate_a = bulk_modulus(pa, p) / volume_a * net_a * boiling(pa, net_a)
    rate_b = bulk_modulus(pb, p) / volume_b * net_b * boiling(pb, net_b)
    rate_s: Float | float = 0.0
    if p.has_pump:
        pump = minimum(p.pump_slope * (p.supply_pressure - ps), p.pump_flow)
        sag = where(p.pump_flow > 0, pump - flows.supply - motion.other_flow, 0.0)
        rate_s = p.bulk_modulus / p.supply_volume * sag
    result: Float = stack([rate_a, rate_b, rate_s])
    return result


def rates(p: SimpleNamespace, y: Float, motion: PistonMotion) -> Float:
    """Rates of all states (6, n): eq. 2 for the spool, eq. 4 for the pressures, eq. 8 for the seals."""
    pull = p.omega**2 * (motion.demand - y[0]) - 2 * p.spool_damping * p.omega * y[1]
    pressures = pressure_rates(p, y, motion)
    slip = motion.velocity - absolute(motion.velocity) * y[5] / sliding_deflection(p, motion.velocity)
    result: Float = stack([y[1], pull, pressures[0], pressures[1], pressures[2], slip])
    return result


def equilibrium(p: SimpleNamespace, command: Float) -> Float:
    """Eq. 10: states (6, n) at rest, spool at its command, pressures that hold `initial_force`."""
    low, over = p.initial_pressure, p.initial_force - (p.area_a - p.area_b) * p.initial_pressure
    pa = np.where(over > 0, low + over / p.area_a, low)
    pb = np.where(over > 0, low, low - over / p.area_b)
    u = np.clip(command, -1.0, 1.0)
    zero = np.zeros(np.shape(u))
    return np.stack([u, zero, pa + zero, pb + zero, p.supply_pressure + zero, zero])


def oil_energy(p: SimpleNamespace, pressure: float, volume: float, points: int = 2001) -> float:
    r"""Elastic energy of the oil in a chamber [J] as a state function: \(V \rho(p) \int_0^p \pi / (\rho B)\, d\pi\).

    With \(d\rho/\rho = dp/B\). For a constant B this is \(V (B e^{p/B} - B - p)\). A flow Q (at chamber pressure)
    brings in \(Q (p + \rho e)\), the specific enthalpy, and the piston takes \(p\,\dot V\).
    """
    grid = np.linspace(0.0, pressure, points)
    soft = 1.0 / bulk_modulus(grid, p)
    step = grid[1] - grid[0]
    log_density = np.concatenate([[0.0], np.cumsum(0.5 * step * (soft[1:] + soft[:-1]))])
    integrand = grid * soft * np.exp(log_density[-1] - log_density)
    return float(volume * np.trapezoid(integrand, dx=step))

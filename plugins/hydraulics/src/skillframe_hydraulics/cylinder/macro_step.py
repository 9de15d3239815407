r"""One communication step of the hydraulic cylinder, over arrays of cylinders or as casadi expressions of one.

Pressures and spool use the classical Runge-Kutta rule with internal steps \(h \lambda \le 1/2\), \(\lambda\) an upper
bound of the oil's fastest rate (Gershgorin, from the edges' slope at the least pressure drop), at least two per
millisecond; the seals their exact solution (Dahl); impulse and work the corrected trapezoidal rule. Each cylinder has
its own number of internal steps, so its values are independent of the batch. Vectors have the rows of GIVEN, MEMORY,
STAGE and RESULT: arrays (rows, n), or columns of expressions.
"""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np

from skillframe_hydraulics.cylinder import equations as eq
from skillframe_hydraulics.symbolic_or_numeric import absolute, ceil, clip, expm1, maximum, minimum, sqrt, stack, where

GIVEN = (
    "command", "position", "velocity", "acceleration", "burst_a", "burst_b", "supply_drop", "held_pressure", "step",
)  # fmt: skip
STEP = GIVEN.index("step")
MEMORY = ("target", "demand", "force_mean", "work")
STAGE = (
    *eq.STATES, *(f"{name}_rate" for name in eq.STATES), "force", "power", "force_rate", "power_rate",
    "impulse", "done", "target", "count", "turn",
)  # fmt: skip
SHOWN = (
    "force", "force_mean", "work", "pressure_a", "pressure_b", "flow_a", "flow_b", "spool",
    "flow_supply", "supply_slope", "friction",
)  # fmt: skip
RESULT = (*eq.STATES, *MEMORY, *SHOWN)
Vector = Any


class _Motion(NamedTuple):
    """Motion of the piston over a step, and the valve's inputs."""

    position: Any
    velocity: Any
    acceleration: Any
    target: Any
    demand: Any
    slew: Any
    outside: tuple[Any, Any, Any, Any]

    def at(self, t: Any) -> eq.PistonMotion:
        limit = where(self.slew > 0, self.slew * t, np.inf)
        demand = self.demand + clip(self.target - self.demand, -limit, limit)
        x, v, a = self.position, self.velocity, self.acceleration
        return eq.PistonMotion(x + t * (v + 0.5 * a * t), v + a * t, demand, *self.outside)


def _motion(p: SimpleNamespace, memory: Vector, given: Vector, target: Any) -> _Motion:
    outside = given[4], given[5], given[6], given[7]
    return _Motion(given[1], given[2], given[3], target, memory[1], p.spool_slew, outside)


def begin(p: SimpleNamespace, y: Vector, memory: Vector, given: Vector) -> Vector:
    """STAGE at the beginning of a step, from states y (5 rows), MEMORY and GIVEN."""
    half, u = 0.5 * p.hysteresis, clip(given[0], -1.0, 1.0)
    target = minimum(maximum(u - half, memory[0]), u + half)
    motion = _motion(p, memory, given, target)
    here = motion.at(0.0)
    rates = eq.rates(p, y, here)
    count = _count(p, y, here, rates, given[STEP])
    return stack([*_rows(y), *_rows(rates), *_push(p, y, rates, here, given[3]), 0.0, 0.0, target, count, 0.0])


def substep(p: SimpleNamespace, stage: Vector, memory: Vector, given: Vector) -> Vector:
    """STAGE after the next internal step, unchanged for cylinders that are finished."""
    turn, a, h = stage[18], given[3], given[STEP] / stage[17]
    motion, y, k1 = _motion(p, memory, given, stage[16]), stage[0:5], stage[5:10]
    here, middle, there = (motion.at((turn + share) * h) for share in (0.0, 0.5, 1.0))
    k2 = eq.rates(p, y + 0.5 * h * k1, middle)
    k3 = eq.rates(p, y + 0.5 * h * k2, middle)
    k4 = eq.rates(p, y + h * k3, there)
    z, integral, work = _slide(p, y[4], here.velocity, a, h)
    moved = y + h / 6.0 * (k1 + 2 * k2 + 2 * k3 + k4)
    chambers = [where(moved[i] < eq.FLOOR, eq.FLOOR, moved[i]) for i in (2, 3)]  # overshoot of a step
    after = stack([moved[0], moved[1], *chambers, z])
    rates = eq.rates(p, after, there)
    push = _push(p, after, rates, there, a)
    more = [
        0.5 * h * (stage[10 + j] + push[j]) + h * h / 12.0 * (stage[12 + j] - push[2 + j]) - p.stiffness * seals
        for j, seals in ((0, integral), (1, work))
    ]
    totals = [stage[14] + more[0], stage[15] + more[1]]
    next_one = stack([*_rows(after), *_rows(rates), *push, *totals, stage[16], stage[17], turn + 1.0])
    return where(turn < stage[17], next_one, stage)


def finish(p: SimpleNamespace, stage: Vector, memory: Vector, given: Vector) -> Vector:
    """RESULT of a step: states, MEMORY, and SHOWN at the end of the motion."""
    end = _motion(p, memory, given, stage[16]).at(given[STEP])
    new = stack([stage[16], end.demand, stage[14] / given[STEP], stage[15]])
    shown = show(p, stage[0:5], new, stack([given[0], end.position, end.velocity, 0.0, 0.0, 0.0, given[6], given[7]]))
    return stack([*_rows(stage, 5), *_rows(new, 4), *_rows(shown, len(SHOWN))])


def show(p: SimpleNamespace, y: Vector, memory: Vector, given: Vector) -> Vector:
    """SHOWN at states y, and at position, velocity, supply_drop and held_pressure of GIVEN."""
    position, velocity = given[1], given[2]
    flows = eq.valve_flows(p, y[0], y[2], y[3], p.supply_pressure - given[6], position, given[7])
    force, friction = eq.piston_force(p, y, position, velocity), eq.friction_force(p, y[4], velocity)
    return stack(
        [force, memory[2], memory[3], y[2], y[3], flows.a, flows.b, y[0], flows.supply, flows.supply_slope, friction]
    )


def _rows(vector: Vector, count: int = 5) -> list[Any]:
    return [vector[i] for i in range(count)]


def _count(p: SimpleNamespace, y: Vector, motion: eq.PistonMotion, rates: Vector, step: Any) -> Any:
    """Number of internal steps that keeps h lambda below one half. `rates` predict opening ports."""
    pa, pb, low = y[2], y[3], p.return_pressure
    supply = p.supply_pressure - motion.supply_drop
    to_supply = minimum(absolute(supply - pa), absolute(supply - pb))
    least = minimum(to_supply, minimum(absolute(pa - low), absolute(pb - low))) + p.laminar_pressure
    wide = maximum(absolute(eq.opening(p, y[0])), absolute(eq.opening(p, motion.demand)))
    soon_a, soon_b = 2.0 * step * absolute(rates[2]), 2.0 * step * absolute(rates[3])
    widest = maximum(maximum(p.edge_pa, p.edge_pb), maximum(p.edge_at, p.edge_bt))
    slope = p.edge * widest * wide / sqrt(least) + p.leakage
    slope = slope + where(minimum(pa - soon_a, pb - soon_b) < low, p.check_conductance, 0.0)
    slope = slope + where(maximum(pa + soon_a, pb + soon_b) > p.relief_pressure, p.relief_conductance, 0.0)
    slope = slope + eq.HOLE * maximum(motion.burst_a, motion.burst_b) / sqrt(p.laminar_pressure)
    if p.has_counterbalance:  # that opens with either pressure
        steep = p.counterbalance_edge / p.counterbalance_range * (1.0 + p.pilot_ratio)
        held = maximum(p.holds_a, p.holds_b) * steep * sqrt(maximum(maximum(pa, pb), p.laminar_pressure))
        slope = slope + where(wide + motion.burst_a + motion.burst_b > 0.0, held, 0.0)
    volume_a, volume_b = eq.volumes(p, motion.position)
    drawn = p.area_a * absolute(motion.velocity) + p.leakage * absolute(pa - pb)  # m3/s that may make a chamber boil
    slope = slope + where(minimum(pa - soon_a, pb - soon_b) < eq.VAPOUR, drawn / eq.BOILING, 0.0)
    rate = p.bulk_modulus / minimum(volume_a, volume_b) * slope
    slowest = 1000.0  # 1/s
    known = where(rate < np.inf, where(rate > slowest, rate, slowest), slowest)
    return clip(ceil(2.0 * step * known), 1.0, 400.0)


def _push(p: SimpleNamespace, y: Vector, rates: Vector, motion: eq.PistonMotion, a: Any) -> list[Any]:
    """Force and power without the seals' deflection, and their rates, for the quadrature."""
    v = motion.velocity
    force = eq.piston_force(p, y, motion.position, v) + p.stiffness * y[4]
    rate = p.area_a * rates[2] - p.area_b * rates[3] - p.viscous_friction * a
    return [force, force * v, rate, rate * v + force * a]


def _slide(p: SimpleNamespace, z: Any, v: Any, a: Any, h: Any) -> tuple[Any, Any, Any]:
    """Deflection of the seals after h, its integral over time, and over the path.

    Exact for Coulomb friction, in two parts if the piston reverses.
    """
    turn = where(v * (v + a * h) < 0, -v / a, h)
    integral, work = 0.0 * z, 0.0 * z
    for start, length in ((0.0 * turn, turn), (turn, h - turn)):
        mean = v + a * (start + 0.5 * length)
        limit = eq.sliding_deflection(p, mean)
        goal, way = where(mean < 0, -limit, limit), absolute(mean) * length / limit
        fade = expm1(-way)
        share = where(way > 1e-6, -fade / way, 1.0 - 0.5 * way)
        after = z - (goal - z) * fade
        integral = integral + length * (goal + (z - goal) * share)
        work = work + goal * (mean * length - (after - z))
        z = after
    return z, integral, work

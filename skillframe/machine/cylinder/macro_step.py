r"""One communication step of the hydraulic cylinder, over arrays of cylinders or as casadi expressions of one.

Pressures and spool go by the classical Runge-Kutta rule with internal steps \(h \lambda \le 1/2\), \(\lambda\) an upper
bound of the oil's fastest rate (Gershgorin, from the edges' slope at the least pressure drop seen), and two a
millisecond at least; the seals' state by its exact solution (Dahl); impulse and work by the corrected trapezoidal rule
(our choices). Every cylinder has its own
number of internal steps, so that its numbers do not depend on others stepped beside it.

Vectors have a row per quantity, as named by GIVEN, MEMORY, STAGE, RESULT: arrays (rows, n), or columns of expressions.
"""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np

from skillframe.either import absolute, ceil, clip, expm1, maximum, minimum, sqrt, stack, where
from skillframe.machine.cylinder import equations as eq

GIVEN = ("command", "position", "velocity", "acceleration", "other_flow", "burst_a", "burst_b", "supply_drop", "step")
STEP = GIVEN.index("step")
MEMORY = ("target", "demand", "force_mean", "work")
STAGE = (
    *eq.STATES, *(f"{name}_rate" for name in eq.STATES), "force", "power", "force_rate", "power_rate",
    "impulse", "done", "target", "count", "turn",
)  # fmt: skip
SHOWN = (
    "force", "force_mean", "work", "pressure_a", "pressure_b", "flow_a", "flow_b", "spool", "pressure_supply",
    "flow_supply", "friction",
)  # fmt: skip
RESULT = (*eq.STATES, *MEMORY, *SHOWN)
MOST_SUBSTEPS, SLOWEST_RATE = 400, 1000.0
Vector = Any


class _Motion(NamedTuple):
    """Motion of the piston over a step, and what the valve is told."""

    position: Any
    velocity: Any
    acceleration: Any
    other_flow: Any
    target: Any
    demand: Any
    slew: Any
    faults: tuple[Any, Any, Any]

    def at(self, t: Any) -> eq.PistonMotion:
        limit = where(self.slew > 0, self.slew * t, np.inf)
        demand = self.demand + clip(self.target - self.demand, -limit, limit)
        x, v, a = self.position, self.velocity, self.acceleration
        return eq.PistonMotion(x + t * (v + 0.5 * a * t), v + a * t, demand, self.other_flow, *self.faults)


def _motion(p: SimpleNamespace, memory: Vector, given: Vector, target: Any) -> _Motion:
    return _Motion(
        given[1], given[2], given[3], given[4], target, memory[1], p.spool_slew, (given[5], given[6], given[7])
    )


def begin(p: SimpleNamespace, y: Vector, memory: Vector, given: Vector) -> Vector:
    """STAGE at the beginning of a step from states y (6 rows), MEMORY and GIVEN."""
    half, u = 0.5 * p.hysteresis, clip(given[0], -1.0, 1.0)
    target = minimum(maximum(u - half, memory[0]), u + half)
    motion = _motion(p, memory, given, target)
    here = motion.at(0.0)
    rates = eq.rates(p, y, here)
    count = _count(p, y, here, rates, given[STEP])
    return stack([*_rows(y), *_rows(rates), *_push(p, y, rates, here, given[3]), 0.0, 0.0, target, count, 0.0])


def substep(p: SimpleNamespace, stage: Vector, memory: Vector, given: Vector) -> Vector:
    """STAGE after the next internal step. It stays where a cylinder has come to its end."""
    turn, a, h = stage[20], given[3], given[STEP] / stage[19]
    motion, y, k1 = _motion(p, memory, given, stage[18]), stage[0:6], stage[6:12]
    here, middle, there = (motion.at((turn + share) * h) for share in (0.0, 0.5, 1.0))
    k2 = eq.rates(p, y + 0.5 * h * k1, middle)
    k3 = eq.rates(p, y + 0.5 * h * k2, middle)
    k4 = eq.rates(p, y + h * k3, there)
    z, integral, work = _slide(p, y[5], here.velocity, a, h)
    moved = y + h / 6.0 * (k1 + 2 * k2 + 2 * k3 + k4)
    chambers = [where(moved[i] < eq.FLOOR, eq.FLOOR, moved[i]) for i in (2, 3)]  # what a step's error may overshoot
    after = stack([moved[0], moved[1], *chambers, moved[4], z])
    rates = eq.rates(p, after, there)
    push = _push(p, after, rates, there, a)
    more = [
        0.5 * h * (stage[12 + j] + push[j]) + h * h / 12.0 * (stage[14 + j] - push[2 + j]) - p.stiffness * seals
        for j, seals in ((0, integral), (1, work))
    ]
    totals = [stage[16] + more[0], stage[17] + more[1]]
    next_one = stack([*_rows(after), *_rows(rates), *push, *totals, stage[18], stage[19], turn + 1.0])
    return where(turn < stage[19], next_one, stage)


def finish(p: SimpleNamespace, stage: Vector, memory: Vector, given: Vector) -> Vector:
    """RESULT of a step: states, MEMORY, and what is SHOWN at the end of the motion."""
    end = _motion(p, memory, given, stage[18]).at(given[STEP])
    new = stack([stage[18], end.demand, stage[16] / given[STEP], stage[17]])
    shown = show(p, stage[0:6], new, stack([given[0], end.position, end.velocity, 0.0, 0.0, 0.0, 0.0, given[7]]))
    return stack([*_rows(stage, 6), *_rows(new, 4), *_rows(shown, len(SHOWN))])


def show(p: SimpleNamespace, y: Vector, memory: Vector, given: Vector) -> Vector:
    """SHOWN at states y, at the position, velocity and supply_drop in GIVEN."""
    position, velocity = given[1], given[2]
    flows = eq.valve_flows(p, y[0], y[2], y[3], y[4] - given[7], position)
    force, friction = eq.piston_force(p, y, position, velocity), eq.friction_force(p, y[5], velocity)
    return stack(
        [force, memory[2], memory[3], y[2], y[3], flows.a, flows.b, y[0], y[4], flows.supply, friction]
    )  # fmt: skip


def _rows(vector: Vector, count: int = 6) -> list[Any]:
    return [vector[i] for i in range(count)]


def _count(p: SimpleNamespace, y: Vector, motion: eq.PistonMotion, rates: Vector, step: Any) -> Any:
    """How many internal steps keep h lambda below one half. `rates` are those now, to see ports open."""
    pa, pb, low = y[2], y[3], p.return_pressure
    supply = y[4] - motion.supply_drop
    to_supply = minimum(absolute(supply - pa), absolute(supply - pb))
    least = minimum(to_supply, minimum(absolute(pa - low), absolute(pb - low))) + p.laminar_pressure
    wide = maximum(absolute(eq.opening(y[0], p.deadband)), absolute(eq.opening(motion.demand, p.deadband)))
    soon_a, soon_b = 2.0 * step * absolute(rates[2]), 2.0 * step * absolute(rates[3])
    slope = p.edge * wide / sqrt(least) + p.leakage
    slope = slope + where(minimum(pa - soon_a, pb - soon_b) < low, p.check_conductance, 0.0)
    slope = slope + where(maximum(pa + soon_a, pb + soon_b) > p.relief_pressure, p.relief_conductance, 0.0)
    slope = slope + eq.HOLE * maximum(motion.burst_a, motion.burst_b) / sqrt(p.laminar_pressure)
    volume_a = p.dead_volume_a + p.area_a * motion.position
    volume_b = p.dead_volume_b + p.area_b * (p.stroke - motion.position)
    drawn = p.area_a * absolute(motion.velocity) + p.leakage * absolute(pa - pb)  # m3/s that may make a chamber boil
    slope = slope + where(minimum(pa - soon_a, pb - soon_b) < eq.VAPOUR, drawn / eq.BOILING, 0.0)
    rate = p.bulk_modulus / minimum(volume_a, volume_b) * slope
    line = p.bulk_modulus / p.supply_volume * (p.pump_slope + p.edge / sqrt(p.laminar_pressure))
    rate = rate + where(p.pump_flow > 0, line, 0.0)
    known = where(rate < np.inf, where(rate > SLOWEST_RATE, rate, SLOWEST_RATE), SLOWEST_RATE)
    return clip(ceil(2.0 * step * known), 1.0, float(MOST_SUBSTEPS))


def _push(p: SimpleNamespace, y: Vector, rates: Vector, motion: eq.PistonMotion, a: Any) -> list[Any]:
    """Force and power without the seals' deflection, and their rates, for the quadrature."""
    v = motion.velocity
    force = eq.piston_force(p, y, motion.position, v) + p.stiffness * y[5]
    rate = p.area_a * rates[2] - p.area_b * rates[3] - p.viscous_friction * a
    return [force, force * v, rate, rate * v + force * a]


def _slide(p: SimpleNamespace, z: Any, v: Any, a: Any, h: Any) -> tuple[Any, Any, Any]:
    """Seals over h, exactly for Coulomb friction, in two parts where the piston reverses.

    Returns:
        Deflection, its integral over time, and over the path.
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

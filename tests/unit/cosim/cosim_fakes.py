"""Mechanics in closed form, and the same coupled to the cylinder's equations in one system for scipy's Radau."""

import itertools
import math

import numpy as np
from scipy.integrate import solve_ivp
from skillframe_hydraulics.cylinder import equations as eq

from skillframe.cosim import Motion
from skillframe.fmu.build import fmu_folders
from skillframe.fmu.table import read_table, rows

GRAVITY = 9.81
CYLINDER = {
    "dead_volume_a": 3e-4, "dead_volume_b": 3e-4, "bulk_modulus": 1.2e9, "stroke": 0.6, "supply_pressure": 200e5,
    "return_pressure": 0.0, "spool_frequency": 60.0, "spool_damping": 0.8, "static_friction": 0.0, "leakage": 1e-13,
}  # fmt: skip


def parameters(**changes):
    table = read_table(fmu_folders()["hydraulic_cylinder"])
    return eq.derive({r.name: r.entry.start for r in rows(table) if r.causality == "parameter"} | changes)


class Boom:
    """A boom on a pivot, lifted by a cylinder in a triangle of sides a and b: len^2 = a^2 + b^2 - 2 a b cos q."""

    a, b, q0, lc, count = 1.2, 0.45, math.radians(70.0), 1.6, 1

    def __init__(self, mass):
        self.mass, self.inertia = mass, 3.4 * mass
        self.shift = self.length(self.q0) - 0.3
        self.state = np.array([self.q0, 0.0])

    def length(self, q):
        return math.sqrt(self.a**2 + self.b**2 - 2 * self.a * self.b * math.cos(q))

    def arm(self, q):
        return self.a * self.b * math.sin(q) / self.length(q)

    def arm_rate(self, q):
        length = self.length(q)
        return self.a * self.b * math.cos(q) / length - (self.a * self.b * math.sin(q)) ** 2 / length**3

    def rates(self, state, force):
        q, w = state
        return np.array(
            [w, (self.arm(q) * force - self.mass * GRAVITY * self.lc * math.cos(q - self.q0)) / self.inertia]
        )

    def piston(self, state):
        return self.length(state[0]) - self.shift, self.arm(state[0]) * state[1]

    def holding_force(self):
        return self.mass * GRAVITY * self.lc / self.arm(self.q0)

    def motion(self, force):
        q, w = self.state
        x, v = self.piston(self.state)
        a = self.arm(q) * self.rates(self.state, force[0])[1] + self.arm_rate(q) * w * w
        return Motion(np.array([x]), np.array([v]), np.array([a]))

    def advance(self, begin, end, step):
        forces = begin[0], 0.5 * (begin[0] + end[0]), end[0]
        y = self.state
        k1 = self.rates(y, forces[0])
        k2 = self.rates(y + 0.5 * step * k1, forces[1])
        k3 = self.rates(y + 0.5 * step * k2, forces[1])
        k4 = self.rates(y + step * k3, forces[2])
        self.state = y + step / 6 * (k1 + 2 * k2 + 2 * k3 + k4)

    def effective_mass(self):
        return np.array([self.inertia / self.arm(self.state[0]) ** 2])

    def save(self):
        self.kept = self.state.copy()

    def restore(self):
        self.state = self.kept.copy()


def monolithic(boom, values, commands, hold, tolerance=1e-9):
    """Boom and cylinder as one system by Radau: rows of (q, q', p_a) every millisecond."""
    p = parameters(**values)
    y = np.concatenate([boom.state, eq.equilibrium(p, np.zeros(1))[:, 0]])
    one, demand, history = np.ones(1), 0.0, []
    for u in commands:
        way = u - demand
        arrival = abs(way) / p.spool_slew
        times = np.arange(1, hold + 1) * 1e-3

        def f(t, y, demand=demand, way=way, arrival=arrival):
            x, v = boom.piston(y[:2])
            now = demand + way * min(t / arrival, 1.0) if arrival > 0 else demand
            cylinder = y[2:, None]
            force = eq.piston_force(p, cylinder, x * one, v * one)[0]
            oil = eq.rates(p, cylinder, eq.PistonMotion(x * one, v * one, now * one))[:, 0]
            return np.concatenate([boom.rates(y[:2], force), oil])

        atol = [1e-11, 1e-11, 1e-10, 1e-8, 0.1, 0.1, 1e-13]
        pieces = sorted({0.0, min(arrival, hold * 1e-3), hold * 1e-3})
        for begin, end in itertools.pairwise(pieces):
            wanted = times[(times > begin) & (times <= end + 1e-12)]
            at = np.unique([*wanted, end])
            r = solve_ivp(f, (begin, end), y, method="Radau", rtol=tolerance, atol=atol, t_eval=at)
            history += [(*r.y[:2, i], r.y[4, i]) for i, t in enumerate(r.t) if np.isclose(t, wanted).any()]
            y = r.y[:, -1]
        demand = u
    return np.array(history)

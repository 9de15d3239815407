"""Crane and cylinders as one system of differential equations for scipy's Radau: the reference of the co-simulation.

Mechanics by loop embedding, oil, spool and seals by `actuation.equations`; work, losses and what the lines bring in are
integrated with the states, so that energy can be balanced.
"""

import itertools
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp
from skillframe_hydraulics.cylinder import equations as eq

from skillframe.fmu.build import fmu_folders
from skillframe.fmu.table import read_table, rows
from tests.laws.crane_plants import crane

TOLERANCES = [1e-12] * 3 + [1e-11] * 3 + [1e-11] * 3 + [1e-9] * 3 + [1e-2] * 6 + [1e-14] * 3


def parameters(cylinders):
    """All parameters of the three cylinders as arrays (3,), with what follows from them."""
    table = {
        r.name: r.entry.start
        for r in rows(read_table(fmu_folders()["hydraulic_cylinder"]))
        if r.causality == "parameter"
    }
    full = [table | c for c in cylinders]
    return eq.derive({name: np.array([float(f[name]) for f in full]) for name in table})


class Energy(NamedTuple):
    """Of the machine at an instant [J]: kinetic, potential and oil are functions of the state."""

    kinetic: float
    potential: float
    oil: float

    @property
    def total(self):
        return self.kinetic + self.potential + self.oil


class Monolith:
    """The machine as one system.

    Args:
        z: minimal coordinates at the start, at rest; cylinders: parameters, three mappings.
        external, chain: as `ChainPlant`.
    """

    def __init__(self, z, cylinders, external=None, chain=None):
        self.chain, self.external = chain or crane(), external or (lambda state: None)
        holding = self.chain.at(np.asarray(z), np.zeros(3)).holding_force()
        self.p = parameters([{**c, "initial_force": f} for c, f in zip(cylinders, holding, strict=True)])
        oil = eq.equilibrium(self.p, np.zeros(3))
        self.y = np.concatenate([z, np.zeros(3), oil.ravel()])
        self._known = (b"", None)

    def _mechanics(self, y):
        """What depends on z and zd alone. Kept, because a Jacobian by differences asks 19 times for the same."""
        key = y[:6].tobytes()
        if self._known[0] != key:
            s = self.chain.at(y[:3], y[3:6])
            extra = self.external(s)
            pins = float(s.v @ (self.chain.model.damping * s.v))
            bias = s.bias - (0.0 if extra is None else extra)
            known = SimpleNamespace(
                mass=np.linalg.inv(s.mass), bias=bias, arms=s.arms, piston=s.driven_motion, pins=pins
            )
            self._known = (key, known)
        return self._known[1]

    def rates(self, demand, y):
        """Rates of the state (21,) under the commands that the spools follow (3,)."""
        m, oil = self._mechanics(y), y[6:21].reshape(5, 3)
        x, v = m.piston
        force = eq.piston_force(self.p, oil, x, v)
        drive = m.mass @ (m.arms.T @ force - m.bias)
        own = eq.rates(self.p, oil, eq.PistonMotion(x, v, demand))
        return np.concatenate([y[3:6], drive, own.ravel()])

    def powers(self, y):
        """Power [W]: what the lines bring less what they take, what leaks past the pistons, seals, pins."""
        m, oil = self._mechanics(y), y[6:21].reshape(5, 3)
        x, v = m.piston
        flows = eq.valve_flows(self.p, oil[0], oil[2], oil[3], self.p.supply_pressure, x)
        a, b = (self._per_volume(oil[k]) + oil[k] for k in (2, 3))
        leaked = self.p.leakage * (oil[2] - oil[3]) * (a - b)
        seals = eq.friction_force(self.p, oil[4], v) * v
        return np.array([np.sum(flows.a * a + flows.b * b), np.sum(leaked), np.sum(seals), m.pins])

    def _per_volume(self, pressure):
        """Elastic energy of oil of constant bulk modulus per volume in closed form."""
        b = self.p.bulk_modulus
        return b * np.expm1(pressure / b) - pressure

    def energy(self, y):
        s, oil = self.chain.at(y[:3], y[3:6]), y[6:21].reshape(5, 3)
        x = s.driven_motion[0]
        volumes = self.p.dead_volume_a + self.p.area_a * x, self.p.dead_volume_b + self.p.area_b * (self.p.stroke - x)
        stored = sum(float(v @ self._per_volume(oil[k])) for v, k in zip(volumes, (2, 3), strict=True))
        return Energy(*s.energy(), stored)

    def follow(self, command, stop, tolerance=1e-9):
        """State (21,) and integrated powers (4,) at the end of a run under smooth commands (a function of time)."""

        def f(t, y):
            return np.concatenate([self.rates(command(t), y), self.powers(y)])

        atol = [*TOLERANCES, *[1e-5] * 4]
        begin = np.concatenate([self.y, np.zeros(4)])
        return solve_ivp(f, (0.0, stop), begin, method="Radau", rtol=tolerance, atol=atol, max_step=0.02).y[:, -1]

    def held(self, commands, hold, tolerance=1e-9):
        """States at the end of every hold (T, 21), commands (T, 3) reached at the spool's slew from the last ones."""
        y, demand, history = self.y, np.zeros(3), []
        for u in np.asarray(commands):
            way = u - demand
            arrival = np.abs(way) / self.p.spool_slew

            def f(t, y, demand=demand, way=way, arrival=arrival):
                done = np.where(arrival > 0, np.minimum(t / np.where(arrival > 0, arrival, 1.0), 1.0), 1.0)
                return self.rates(demand + way * done, y)

            pieces = np.unique(np.concatenate([[0.0, hold], arrival[arrival < hold]]))
            for begin, end in itertools.pairwise(pieces):
                y = solve_ivp(f, (begin, end), y, method="Radau", rtol=tolerance, atol=TOLERANCES).y[:, -1]
            demand = u
            history.append(y)
        return np.array(history)

    def pistons(self, states):
        """(T, 3) of states (T, 21)."""
        return np.array([self.chain.at(y[:3], y[3:6]).driven_motion[0] for y in states])

"""Whoever may steer the cranes of `crane_motion`: the hydraulic law, and ordinary controllers beside it.

The ordinary ones believe the same model, know the same nominal friction, take the same desired motion, turned into
joints, and drive the same valves. Two make piston forces with the cylinders' force loop (no k_x: that is VDC's), their
friction fed forward at the desired velocity; one goes straight to the valve:

    PI on the valve:  v = xd_d + w (x_d - x) + w^2/8 int (x_d - x) dt,    u_f = (A_a a + A_b b) v.

Tuned by `vdc_baselines.tune` on `tuning_path`, with the plant's errors of the test: w on its ladder and, where there is
a force loop, k_f at once, twice and four times its published size; without a force loop on a quarter of the ladder, for
such a loop is as slow as the oil lets it be. What counts is the rms error of the tool; who diverges is out.
"""

from typing import NamedTuple

import numpy as np
from skillframe_hydraulics.law import vdc_actuator as act
from skillframe_hydraulics.law.hydraulic import HydraulicGains
from skillframe_hydraulics.law.hydraulic_compiled import CompiledLaw

from skillframe.signals import RateFilter
from tests.figures.crane_motion import DT, Truth, begin, believed, figures, free_reference, known, run
from tests.laws.vdc_loop import leg, task
from tests.oracle import valve_law
from tests.oracle.vdc_baselines import LADDER, ModelBased, PistonPid, tune

FORCE = np.array([2e-8, 2e-8, 8e-9])  # published k_f
FORCE_SHARES = (1.0, 2.0, 4.0)
WRONG = Truth(friction=1.2, believed=0.9)
TUNING_S = 8.0


class Rival(NamedTuple):
    """ "pid", "model" or "valve"; w [1/s]; k_f over its published size."""

    kind: str
    bandwidth: float
    force: float = 1.0


TUNED = {"pid": Rival("pid", 2.0**5.5, 2.0), "model": Rival("model", 16.0, 2.0), "valve": Rival("valve", 0.5**0.5)}
"""What `tuned` finds: rms on the tuning path 11.7, 9.9 and 11.9 mm. Run this module to find them again."""


class Vdc:
    """The law for N cranes on one path; `law` keeps its estimates."""

    def __init__(self, path, share, count, gains=None):
        self.path, self.count = path, count
        self.law = CompiledLaw(believed(share), known(), gains or HydraulicGains(), count, DT)
        self.law.start()

    def __call__(self, t, measured):
        return self.law.step(measured, free_reference(self.path(t), self.count), np.arange(self.count)).valve


class Rivals:
    """N ordinary controllers, each with its own crane."""

    def __init__(self, path, share, rivals):
        self.path, self.chain, self.rivals, self.rate = path, believed(share), rivals, RateFilter(8.0, DT)
        start = begin(path)
        made = {"pid": lambda w: PistonPid(self.chain, start, w), "model": ModelBased, "valve": lambda w: None}
        self.laws = [made[r.kind](r.bandwidth) for r in rivals]
        self.sums, self.z = np.zeros((len(rivals), 3)), start
        self.w = np.array([[r.bandwidth] for r in rivals])
        self.direct = np.array([[r.kind == "valve"] for r in rivals])
        self.gains = act.CylinderGains(velocity=np.zeros(3), force=np.array([[r.force] for r in rivals]) * FORCE)
        self.fresh = True

    def desired(self, t):
        """State on the path and its zdd (3,)."""
        path = self.path(t)
        self.z = task().solve(self.chain, path.position, self.z)
        jacobian = task().jacobian(self.chain.at(self.z, np.zeros(3)))
        at = self.chain.at(self.z, np.linalg.solve(jacobian, path.velocity))
        return at, np.linalg.solve(jacobian, path.acceleration - task().drift(at, at.zd))

    def force(self, law, state, desired, zdd):
        if law is None:
            return np.zeros(3)
        return law.forces(state, desired, DT) if isinstance(law, PistonPid) else law.forces(state, desired, zdd)

    def __call__(self, t, measured):
        desired, zdd = self.desired(t)
        states = [self.chain.at(z, zd) for z, zd in zip(measured.z, measured.rate, strict=True)]
        x, xd = (np.array(rows) for rows in zip(*(s.driven_motion for s in states), strict=True))
        x_d, xd_d = desired.driven_motion
        forces = [self.force(law, s, desired, zdd) for law, s in zip(self.laws, states, strict=True)]
        force = np.array(forces) + valve_law.friction(known(), xd_d)
        if self.fresh:
            self.rate.start(force)
            self.fresh = False
        pressures = (measured.pressure_a, measured.pressure_b)
        demand = act.flow_demand(known(), self.gains, (x, xd, xd_d), (force, self.rate.step(force)), pressures)
        self.sums += DT * (x_d - x)
        speed = xd_d + self.w * (x_d - x) + self.w**2 / 8.0 * self.sums
        c = known()
        straight = (c.area_a / (c.arm_a + x) + c.area_b / (c.arm_b + c.stroke - x)) * speed
        valve = act.inverse_valve(c, np.where(self.direct, straight, demand), x, pressures)
        return np.clip(np.nan_to_num(valve), -1.0, 1.0)


def tuning_path(t):
    """Up and back on a slanted line, the extension moving, and again the other way: not the test's path."""
    duration, low, high = TUNING_S / 2, np.array([2.6, 0.9, 0.4]), np.array([3.2, 1.3, 0.6])
    if t < duration:
        return leg(low, high, t, duration)
    return leg(high, low, min(t - duration, duration), duration)


def error(errors, speed):
    """What `tune` compares: rms [m] of one trial; infinite once it has diverged."""
    return figures(errors, speed).rms if np.isfinite(errors).all() else np.inf


def tuned(kind, seed=7):
    """The best rival of a kind, and a table {k_f's share: {w: rms [m]}}; every candidate meets the same noise."""
    shares = (1.0,) if kind == "valve" else FORCE_SHARES
    ladder = np.array(LADDER) / 4 if kind == "valve" else LADDER
    rivals = [Rival(kind, float(w), share) for share in shares for w in ladder]
    plants = [WRONG] * len(rivals), [seed] * len(rivals)
    errors, speed, _ = run(Rivals(tuning_path, WRONG.believed, rivals), tuning_path, TUNING_S, *plants, bonds=np.inf)
    table = {
        share: {r.bandwidth: error(errors[:, i], speed) for i, r in enumerate(rivals) if r.force == share}
        for share in shares
    }
    best = {share: tune(row.__getitem__, tuple(row)) for share, row in table.items()}
    share = min(best, key=lambda s: table[s][best[s]])
    return Rival(kind, best[share], share), table


if __name__ == "__main__":
    for name in TUNED:
        found, rows = tuned(name)
        print(found)
        for force, row in rows.items():
            print(f"  k_f x {force:g}:", ", ".join(f"{w:.3g} 1/s {1e3 * rms:.1f} mm" for w, rms in row.items()))

"""N cranes with cylinder FMUs follow a path in air, sampled at 1 kHz through noisy sensors; every controller alike.

Plant: MuJoCo, closed chain, RK4, coupled with the FMUs by `cosim.Master` at 1 ms. Encoders 1e-4 rad (m), pressures
0.22 bar, white at 1 kHz, behind filters of 24 Hz, critically damped: all published. The controller may believe in other
inertias and another friction than the plant has.
"""

import dataclasses
from functools import cache
from typing import NamedTuple

import numpy as np
from skillframe_hydraulics.law import vdc_actuator as act
from skillframe_hydraulics.law.hydraulic import Measured, Reference

from skillframe.cosim import CosimSettings, Master
from skillframe.execution.drives.actuated import CoupledPlant
from skillframe.fmu.actuator import ActuatorSpec
from skillframe.fmu.opening import open_actuators
from skillframe.robot.chain import ClosedChain
from skillframe.world.placement import fixture_poses
from skillframe.world.plant import Plant
from tests.crane_press import ENCODER, PRESSURE, SENSOR_CORNER, Filter
from tests.laws.crane_plants import crane, empty_scene, tooled
from tests.laws.vdc_loop import task
from tests.laws.vdc_motion import share_of

LEAD = 2 / SENSOR_CORNER
DT, OUTER = 1e-3, 6.0  # s; 1/s, published Lambda of free motion


FAR = 1.5  # m; a tool that far from its path has diverged
ENERGY = 200.0  # J exchanged from which on the bond's relative residual says something


class Truth(NamedTuple):
    """What the controller does not know: friction over its own, its inertias over the plant's, noise over published."""

    friction: float = 1.0
    believed: float = 1.0
    noise: float = 1.0


class Errors(NamedTuple):
    """Of the tool over a span of time: largest and rms [m]; rho = largest over fastest desired speed [s]."""

    largest: float
    rms: float
    rho: float


@cache
def believed(share):
    """The crane as a controller believes it to be: all inertias are a share of the plant's."""
    robot = tooled().robot
    model = robot.model.copy()
    for j in range(1, model.njoints):
        model.inertias[j] = share_of(model.inertias[j], share)
    return ClosedChain(dataclasses.replace(robot, model=model))


@cache
def known():
    return act.cylinders(crane().robot.spec.actuation)


def begin(path):
    """Minimal coordinates (3,) at the start of a path."""
    return task().solve(crane(), path(0.0).position, np.array([0.8, -1.5, 0.5]))


class Coupled:
    """The cranes, their cylinders and their sensors.

    Args:
        z: (3,) start; truth: one for each seed.
    """

    def __init__(self, z, truth, seeds):
        self.count, robot = len(seeds), crane().robot
        self.rngs, self.noise = [np.random.default_rng(s) for s in seeds], np.array([t.noise for t in truth])
        self.plant = Plant(robot, empty_scene(), self.count, fixture_poses(robot, {}, self.count), {}, DT)
        self.plant.reset(np.tile(crane().configuration(z), (self.count, 1)))
        self.coupled = CoupledPlant(self.plant, crane().actuated)
        hold = tooled().at(z, 0 * z).holding_force()
        specs = [
            ActuatorSpec(
                fmu=a.fmu, parameters={**a.parameters, "initial_force": float(f)}, inputs=dict(a.inputs),
                outputs=dict(a.outputs), name=a.joint,
            )
            for a, f in zip(robot.spec.actuation, hold, strict=True)
        ]  # fmt: skip
        self.master = Master(self.coupled, open_actuators(specs, trials=self.count), CosimSettings(step=DT))
        rub = ("coulomb_friction", "viscous_friction", "static_friction")
        self.master.start(
            parameters=[{name: t.friction * s.parameters[name] for name in rub} for t in truth for s in specs]
        )
        self._z = [int(self.plant.model.joint(name).qposadr[0]) for name in crane().independent]
        bank = self.master.bank
        self._pressures = [bank.outputs.index(f"pressure_{side}") for side in "ab"]
        self.filter = Filter(self.true(), SENSOR_CORNER)

    def true(self):
        """Minimal coordinates and pressures (N, 9)."""
        y = self.master.bank.y
        return np.concatenate(
            [self.plant.state[0][:, self._z], *(y[:, c].reshape(-1, 3) for c in self._pressures)], axis=-1
        )

    def step(self, valves, near):
        """A millisecond of the trials that are near enough (N,) and whose cylinders are well; the others end."""
        bank, well = self.master.bank, near.copy()
        for i in np.flatnonzero(near):
            well[i] = not any(bank.problem(3 * i + j) for j in range(3))
        self.coupled.active = np.flatnonzero(well)
        bank.active[:] = np.repeat(well, 3)
        self.master.step(valves.ravel())

    def tool(self):
        """Where the tool is (N, 2), base x and z."""
        return self.plant.tool_pose().position[:, [0, 2]].copy()

    def measure(self):
        noise = np.array([rng.normal(size=9) for rng in self.rngs]) * np.repeat([ENCODER, PRESSURE], [3, 6])
        x, rate = self.filter.step(self.true() + self.noise[:, None] * noise)
        return Measured(x[:, :3] + LEAD * rate[:, :3], rate[:, :3], x[:, 3:6], x[:, 6:], *np.zeros((2, self.count, 2)))


def free_reference(path, count, outer=OUTER):
    """The law's reference for a path's point: K = outer x D."""
    p, v, a = (np.tile(x, (count, 1)) for x in path)
    d = np.tile(5e4 * np.eye(2), (count, 1, 1))
    return Reference(p[:, :2], v[:, :2], outer * d, d, np.zeros((count, 2)), p[:, 2:], v[:, 2:], a)


def run(controller, path, seconds, truth, seeds, bonds=3e-4):
    """Errors of the tool (ticks, N, 2), desired speed (ticks,), valves (ticks, N, 3); a trial that diverges ends, NaN.

    `controller(t, measured)` gives valve commands (N, 3); `bonds` is what no bond's relative residual may exceed.
    """
    cranes = Coupled(begin(path), truth, seeds)
    ticks = round(seconds / DT)
    errors, valves = np.full((ticks, len(seeds), 2), np.nan), np.zeros((ticks, len(seeds), 3))
    speed = np.array([np.hypot(*path(k * DT).velocity[:2]) for k in range(ticks)])
    for k in range(ticks):
        going = cranes.coupled.active
        valves[k] = controller(k * DT, cranes.measure())
        errors[k, going] = path(k * DT).position[:2] - cranes.tool()[going]
        cranes.step(valves[k], np.abs(errors[k]).max(axis=-1) < FAR)
    busy = np.repeat(np.isfinite(errors[-1, :, 0]), 3) & (cranes.master.exchanged > ENERGY)
    assert cranes.master.residual[busy].max(initial=0.0) < bonds, cranes.master.residual
    return errors, speed, valves


def figures(errors, speed):
    """Of one trial (ticks, 2)."""
    size = np.hypot(errors[:, 0], errors[:, 1])
    return Errors(float(size.max()), float(np.sqrt(np.mean(size**2))), float(size.max() / speed.max()))

"""The crane and its three cylinders, coupled: set-up of every law about the co-simulated crane."""

import dataclasses
import math
from functools import cache

import numpy as np
from skillframe_worlds.hooks import skillframe_worlds as world_types

from skillframe.cosim import CosimSettings, Master, Motion
from skillframe.execution.drives.actuated import CoupledPlant
from skillframe.extend import make_scene
from skillframe.fmu.actuator import ActuatorSpec
from skillframe.fmu.opening import open_actuators
from skillframe.robot.chain import ClosedChain
from skillframe.robot.model import load_model
from skillframe.robot.spec import load_robot
from skillframe.world.placement import fixture_poses
from skillframe.world.plant import Plant
from tests.references import attach_payload

START = np.array([math.pi / 4, -math.pi / 2, 0.5])  # published
# what exudyn's actuator has not: spool dynamics, seals, laminar edge, port valves, leakage
PLAIN = {
    "spool_frequency": 1e5, "spool_slew": 0.0, "coulomb_friction": 0.0, "static_friction": 0.0,
    "laminar_pressure": 1.0, "relief_conductance": 0.0, "check_conductance": 0.0, "leakage": 0.0,
}  # fmt: skip


@cache
def crane():
    """Loop-embedding model of the crane with its published end object."""
    return ClosedChain(load_model(load_robot("hiab_xs031")))


@cache
def empty_scene():
    return make_scene(next(w for w in world_types() if w.name == "free"), {})


@cache
def tooled():
    """The same with the tool of the simulated world in its grip."""
    robot, tool = crane().robot, empty_scene().tool
    frame = robot.tool_frames[0]
    loaded = attach_payload(robot.model, frame, tool.mass, tool.center_of_mass, tool.inertia)
    return ClosedChain(dataclasses.replace(robot, model=loaded))


def simulated(step, z=START):
    """The crane in MuJoCo, in empty space, one trial, as the mechanics of a co-simulation."""
    robot = crane().robot
    plant = Plant(robot, empty_scene(), 1, fixture_poses(robot, {}, 1), {}, step)
    plant.reset(crane().configuration(np.asarray(z))[None])
    return CoupledPlant(plant, crane().actuated)


def cylinders(**changes):
    """Parameters of the three cylinders as robot.toml has them, changed."""
    return [{**a.parameters, **changes} for a in crane().robot.spec.actuation]


def areas(cylinder):
    """Areas of piston and rod side [m2]."""
    whole = math.pi / 4 * cylinder["bore"] ** 2
    return whole, whole - math.pi / 4 * cylinder["rod"] ** 2


class ChainPlant:
    """The loop-embedding model as the mechanics of a co-simulation: one crane, three bonds, Runge-Kutta of order four.

    Independent of MuJoCo; the force goes linearly over a step.
    """

    count = 3

    def __init__(self, z=START, zd=(0.0, 0.0, 0.0), external=None, chain=None):
        self.chain, self.z, self.zd = chain or crane(), np.array(z, dtype=float), np.array(zd, dtype=float)
        self.external = external or (lambda state: None)

    def _at(self, z, zd, force):
        state = self.chain.at(z, zd)
        return state, state.acceleration(force, self.external(state))

    def motion(self, force):
        state, zdd = self._at(self.z, self.zd, force)
        driven = self.chain.driven
        x, v = state.driven_motion
        return Motion(x, v, (state.embedding @ zdd + state.drift)[driven])

    def advance(self, begin, end, step):
        z, zd, middle = self.z, self.zd, 0.5 * (begin + end)
        a1 = self._at(z, zd, begin)[1]
        v2 = zd + 0.5 * step * a1
        a2 = self._at(z + 0.5 * step * zd, v2, middle)[1]
        v3 = zd + 0.5 * step * a2
        a3 = self._at(z + 0.5 * step * v2, v3, middle)[1]
        v4 = zd + step * a3
        a4 = self._at(z + step * v3, v4, end)[1]
        self.z = z + step / 6 * (zd + 2 * v2 + 2 * v3 + v4)
        self.zd = zd + step / 6 * (a1 + 2 * a2 + 2 * a3 + a4)

    def effective_mass(self):
        """Mass that each piston feels with the others free."""
        state = self.chain.at(self.z, self.zd)
        per_force = state.arms @ np.linalg.solve(state.mass, state.arms.T)
        return 1.0 / np.diag(per_force)

    def save(self):
        self.kept = self.z.copy(), self.zd.copy()

    def restore(self):
        self.z, self.zd = self.kept[0].copy(), self.kept[1].copy()


def coupled(plant, parameters, step, chain=None, z=START, **settings):
    """Master of a plant and three cylinders that hold it at a pose, started."""
    holding = (chain or crane()).at(np.asarray(z), np.zeros(3)).holding_force()
    specs = [
        ActuatorSpec(fmu="hydraulic_cylinder", parameters={**p, "initial_force": float(f)}, name=a.joint)
        for p, f, a in zip(parameters, holding, crane().robot.spec.actuation, strict=True)
    ]
    master = Master(plant, open_actuators(specs), CosimSettings(step=step, **settings))
    master.start()
    return master


class History:
    """What a coupled run leaves at every hold: piston (T, 3), pressure_a and pressure_b (T, 3)."""

    def __init__(self, master, commands, hold):
        each, rows = round(hold / master.settings.step), []
        for u in commands:
            for _ in range(each):
                assert master.step(u), master.trouble()
            piston = master.plant.motion(master.force).position.copy()
            rows.append((piston, *master.bank.y[:, [3, 4]].T.copy()))
        self.piston, self.pressure_a, self.pressure_b = np.array(rows).swapaxes(0, 1)
        self.residual, self.trouble = master.residual, master.trouble()
        master.bank.close()


def waves(count, hold, amplitudes, hertz):
    """Commands (T, 3): sines held over `hold` [s]."""
    time = np.arange(count)[:, None] * hold
    return np.array(amplitudes) * np.sin(2 * np.pi * time * np.array(hertz))

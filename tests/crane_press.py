"""N cranes with cylinder FMUs move in air, land on a plate on a spring, and slide to and fro; everything is recorded.

Plant: MuJoCo, closed chain, RK4, contact; cylinders: FMUs under `cosim.Master`, 1 ms. The controller is a plain
impedance law of ours with the published inner loop (`vdc_actuator`), not the machine's loop: it is here to move the
crane, and closes over the estimate that is tested. Encoders 1e-4 rad (m), pressures 0.22 bar, white at 1 kHz, behind
filters of 24 Hz, critically damped, all published.
"""

from functools import cache
from typing import NamedTuple

import mujoco
import numpy as np
from skillframe_hydraulics.force.momentum import Estimate
from skillframe_hydraulics.law import vdc_actuator as act
from skillframe_hydraulics.law.hydraulic import Measured, Terms
from skillframe_hydraulics.law.vdc_reference import ToolTask

from skillframe.cosim.energy_balance import Motion
from skillframe.cosim.master import CosimSettings, Master
from skillframe.fmu.actuator import ActuatorSpec
from skillframe.fmu.opening import open_actuators
from skillframe.world.convert import SOLIMP, SOLREF, build_spec
from skillframe.world.scene import Geom, Scene, Tool
from skillframe.world.scene import Task as SceneTask
from tests.crane_terms import terms
from tests.laws.vdc_loop import crane, quintic
from tests.oracle import valve_law
from tests.oracle.force_estimator import ForceEstimator

DT, AIR, LANDED = 1e-3, 9.0, 14.0  # s: a row, end of the air phase, begin of sliding
START, SURFACE, RADIUS = np.array([3.0, 0.95, 0.5]), 0.45, 0.05
ENCODER, PRESSURE, SENSOR_CORNER = 1e-4, 0.22e5, 2 * np.pi * 24.0
STIFFNESS, DAMPING, PRESS = 1e5, 5e4, 0.09  # N/m, N s/m, m below the surface
STROKE, SPEED = 0.5, 0.19  # m and m/s along the surface
PLATE = 40.0  # kg


class Case(NamedTuple):
    """Friction (N, 3) and mass (N,) of the plant over the model's, plate [N/m], impedance's damping [N s/m]."""

    friction: np.ndarray
    mass: np.ndarray
    plate: float = 1e6
    damping: float = DAMPING


class Log(NamedTuple):
    """(T, N, ...) arrays: what the estimator was given, and the truth."""

    measured: Measured
    terms: Terms
    force: np.ndarray
    speed: np.ndarray


@cache
def cylinders():
    return act.cylinders(crane().robot.spec.actuation)


def gains():
    """Published, the force gain a fifth of it."""
    return act.CylinderGains(velocity=np.array([5e-3, 5e-3, 1e-3]), force=np.array([4e-9, 4e-9, 1.6e-9]))


def plate_model(mass, stiffness):
    """The crane with a sphere at its tool above a plate on a spring of so many N/m."""
    tool = Tool(
        geoms=(Geom(kind="sphere", size=(RADIUS,)),), mass=1e-3, center_of_mass=(0.0, 0.0, 0.0),
        inertia=(1e-6, 1e-6, 1e-6), frames={"tip": (0.0, 0.0, 0.0)},
    )  # fmt: skip
    scene = Scene(
        name="plate", fixture=(), tool=tool, friction=0.3, start_tip=(0, 0, 0), start_quaternion=(0, 0, 0, 1),
        goal=lambda state: None, goal_error=lambda state: None, task=SceneTask(direction=None),
    )  # fmt: skip
    spec = build_spec(crane().robot, scene, DT)
    add_plate(spec, stiffness)
    model = spec.compile()
    for body in map(model.body, crane().model.names[1:]):
        model.body_mass[body.id] *= mass
        model.body_inertia[body.id] *= mass
    return model


def add_plate(spec, stiffness):
    body = spec.worldbody.add_body(name="plate", pos=[START[0], 0, SURFACE - 0.1])
    body.mass, body.inertia, body.explicitinertial, body.gravcomp = PLATE, [1, 1, 1], True, 1
    joint = body.add_joint(name="plate", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[0, 0, 1])
    joint.stiffness, joint.damping = [stiffness, 0, 0], [np.sqrt(stiffness * PLATE), 0, 0]  # zeta 0.5
    geom = body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[2, 0.5, 0.1])
    geom.contype, geom.conaffinity, geom.condim, geom.mass = 1, 2, 3, 0
    geom.friction, geom.solref, geom.solimp = [0.3, 0, 0], SOLREF, SOLIMP


class Cranes:
    """A `cosim` plant: one MuJoCo simulation per trial, bonds trial by trial."""

    def __init__(self, case):
        self.models = [plate_model(mass, case.plate) for mass in case.mass]
        self.data = [mujoco.MjData(m) for m in self.models]
        self.count = 3 * len(self.data)
        joint = self.models[0].joint
        self.pistons = np.array([(joint(n).qposadr[0], joint(n).dofadr[0]) for n in crane().actuated]).T
        self.joints = np.array([(joint(n).qposadr[0], joint(n).dofadr[0]) for n in crane().independent]).T
        self.tool = self.models[0].body("tool").id

    def reset(self, z):
        q = crane().configuration(z)
        for model, data in zip(self.models, self.data, strict=True):
            for j, name in enumerate(crane().model.names[1:], start=1):
                data.qpos[model.joint(name).qposadr[0]] = q[crane().model.joints[j].idx_q]
            mujoco.mj_forward(model, data)

    def _push(self, i, force):
        self.data[i].qfrc_applied[self.pistons[1]] = force[3 * i : 3 * i + 3]

    def motion(self, force):
        for i, (model, data) in enumerate(zip(self.models, self.data, strict=True)):
            self._push(i, force)
            mujoco.mj_forward(model, data)
        x, v = self.pistons
        rows = [(d.qpos[x], d.qvel[v], d.qacc[v]) for d in self.data]
        return Motion(*np.array(rows).transpose(1, 0, 2).reshape(3, -1))

    def advance(self, begin, end, step):
        for i, (model, data) in enumerate(zip(self.models, self.data, strict=True)):
            self._push(i, 0.5 * (begin + end))
            mujoco.mj_step(model, data)

    def state(self):
        """Minimal coordinates and rates (N, 3)."""
        return tuple(np.array([(d.qpos, d.qvel)[k][self.joints[k]] for d in self.data]) for k in (0, 1))

    def contact(self):
        """True force of the plate on the tool (N, 2), base x and z."""
        result, wrench = np.zeros((len(self.data), 2)), np.zeros(6)
        for i, (model, data) in enumerate(zip(self.models, self.data, strict=True)):
            for c in range(data.ncon):
                mujoco.mj_contactForce(model, data, c, wrench)
                sign = 1.0 if model.geom_bodyid[data.contact[c].geom2] == self.tool else -1.0
                result[i] += sign * (data.contact[c].frame.reshape(3, 3).T @ wrench[:3])[[0, 2]]
        return result


class Filter:
    """Second order, critically damped; its state gives the rate."""

    def __init__(self, value, corner):
        self.value, self.rate, self.corner = value, np.zeros_like(value), corner

    def step(self, seen):
        self.rate = self.rate + DT * (self.corner**2 * (seen - self.value) - 2 * self.corner * self.rate)
        self.value = self.value + DT * self.rate
        return self.value, self.rate


def swing(t):
    """In air: all three cylinders move, both ways."""
    way = np.array([0.25 * np.sin(1.4 * t), 0.2 * np.sin(2.1 * t), 0.1 * np.sin(2.1 * t + 1.0) - 0.1 * np.sin(1.0)])
    return START + min(1.0, t, AIR - t) * way


def reference(t):
    """Tool and extension (3,) to go to: swing, land, slide."""
    if t < AIR:
        return swing(t)
    way, _, _ = quintic(min(1.0, (t - AIR) / 4.0))
    since = max(0.0, t - LANDED)
    turned = SPEED / STROKE * (0.5 * since**2 if since < 1.0 else since - 0.5)
    return START + np.array([STROKE * np.sin(turned), (SURFACE + RADIUS - PRESS - START[1]) * way, 0.0])


class Law:
    """First-order impedance, required piston forces without Coriolis terms, the published inner loop."""

    def __init__(self, count, damping):
        self.rate, self.needed, self.count, self.damping = None, None, count, damping

    def step(self, t, measured, at):
        """Valve commands (N, 3)."""
        zr, acceleration = self.required(t, measured, at)
        tau = (at.mass @ acceleration[..., None])[..., 0] + at.gravity
        tau -= (np.swapaxes(at.jacobian, -1, -2) @ measured.force[..., None])[..., 0]
        speed = (at.arms @ zr[..., None])[..., 0]
        force = np.linalg.solve(np.swapaxes(at.arms, -1, -2), tau[..., None])[..., 0] + valve_law.friction(
            cylinders(), speed
        )
        self.needed = self.needed or Filter(force, 2 * np.pi * 8.0)
        change = self.needed.step(force)[1]
        pressures = (measured.pressure_a, measured.pressure_b)
        demand = act.flow_demand(
            cylinders(), gains(), (at.piston, at.piston_rate, speed), (force, change), pressures
        )  # fmt: skip
        return np.clip(act.inverse_valve(cylinders(), demand, at.piston, pressures), -1.0, 1.0)

    def required(self, t, measured, at):
        """Rates and accelerations (N, 3) of the minimal coordinates."""
        to, soon = reference(t), reference(t + 1e-4)
        ahead, (lead, push) = (
            (soon - to) / 1e-4,
            (6.0, 0.0) if t < AIR else (STIFFNESS / self.damping, 1.0 / self.damping),
        )
        tool = ahead[:2] + lead * (to[:2] - at.tip) + push * measured.force
        wanted = np.concatenate([tool, ahead[2] + 3.0 * (to[2] - measured.z[:, 2:])], axis=-1)
        jacobian = np.concatenate([at.jacobian, np.tile([[[0.0, 0.0, 1.0]]], (self.count, 1, 1))], axis=1)
        zr = np.linalg.solve(jacobian, wanted[..., None])[..., 0]
        self.rate = self.rate or Filter(zr, 2 * np.pi * 8.0)
        return zr, self.rate.step(zr)[1]


class Press:
    """A batch while it runs."""

    def __init__(self, case, seeds, settings=None):
        self.rngs, count = [np.random.default_rng(seed) for seed in seeds], len(seeds)
        self.plant, self.law = Cranes(case), Law(count, case.damping)
        z = ToolTask(crane(), np.eye(3)[[0, 2]], ("extension",)).solve(crane(), START, np.array([0.8, -1.6, 0.5]))
        self.plant.reset(z)
        spec = [
            ActuatorSpec(
                fmu=a.fmu, parameters=parameters(a, hold), inputs=dict(a.inputs), outputs=dict(a.outputs), name=a.joint
            )
            for a, hold in zip(crane().robot.spec.actuation, crane().at(z, 0 * z).holding_force(), strict=True)
        ]
        self.master = Master(self.plant, open_actuators(spec, trials=count), CosimSettings())
        rub = [name for name in spec[0].parameters if name.endswith("_friction")]
        drawn = [
            {name: factor * s.parameters[name] for name in rub}
            for factors in case.friction for factor, s in zip(factors, spec, strict=True)
        ]  # fmt: skip
        self.master.start(parameters=drawn)
        self.sensors = Filter(self.truth(), SENSOR_CORNER)
        self.estimator = ForceEstimator(crane(), cylinders(), count, DT, settings)
        self.force, self.sigma = np.zeros((count, 2)), np.zeros((count, 2))

    def truth(self):
        """Minimal coordinates and pressures (N, 9)."""
        bank = self.master.bank
        pressures = [bank.y[:, bank.outputs.index(f"pressure_{side}")].reshape(-1, 3) for side in "ab"]
        return np.concatenate([self.plant.state()[0], *pressures], axis=-1)

    def measure(self):
        noise = np.array([rng.normal(size=9) for rng in self.rngs]) * np.repeat([ENCODER, PRESSURE], [3, 6])
        x, rate = self.sensors.step(self.truth() + noise)
        return Measured(x[:, :3], rate[:, :3], x[:, 3:6], x[:, 6:], self.force, self.sigma)

    def tick(self, t):
        """One millisecond; a row of the log."""
        measured = self.measure()
        at = terms(crane(), measured.z, measured.rate)
        if t == 0.0:
            self.estimator.start()
        self.estimator.calibrate(t < AIR)
        estimate = self.estimator.step(measured, at)
        self.force, self.sigma = estimate.answered, estimate.sigma
        speed = (at.arms @ self.plant.state()[1][..., None])[..., 0]
        row = measured, at, self.plant.contact(), speed
        command = self.law.step(t, measured._replace(force=self.force, sigma=self.sigma), at)
        assert self.master.step(command.ravel()), self.master.trouble()
        return row

    def run(self, seconds):
        rows = [self.tick(k * DT) for k in range(round(seconds / DT))]
        measured, at, force, speed = zip(*rows, strict=True)
        return Log(
            Measured(*map(np.array, zip(*measured, strict=True))), Terms(*map(np.array, zip(*at, strict=True))),
            np.array(force), np.array(speed),
        )  # fmt: skip


def parameters(actuation, hold):
    return {**actuation.parameters, "initial_force": float(hold)}


def replay(log, estimator):
    """Estimate of (T, N, ...) arrays of an estimator over a log."""
    rows = []
    for k in range(len(log.force)):
        measured, at = Measured(*(x[k] for x in log.measured)), Terms(*(x[k] for x in log.terms))
        if k == 0:
            estimator.start()
        estimator.calibrate(k * DT < AIR)
        rows.append(estimator.step(measured, at))
    return Estimate(*(np.array(x) for x in zip(*rows, strict=True)))

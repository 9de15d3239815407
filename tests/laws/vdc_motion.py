"""The crane in free motion under sampled control: ideal force actuators with limits, noisy encoders, 1 kHz."""

import dataclasses
from functools import cache
from typing import NamedTuple

import numpy as np
from skillframe_hydraulics.checks.feasibility import capacity

from skillframe.robot.chain import ClosedChain
from tests.laws.vdc_loop import CORNERS, crane, leg, task
from tests.oracle.vdc import VdcController, VdcGains
from tests.oracle.vdc_baselines import ModelBased, PistonPid
from tests.oracle.vdc_reference import Path, required_motion
from tests.references import chain_step

DT = 1e-3
NOISE = 1e-4  # encoders, white at 1 kHz [rad or m], published
FILTER = 2 * np.pi * 24.0  # rate filter, critically damped, published
EXTENSION = 0.5


class Errors(NamedTuple):
    """Of the tool [m], and the fastest desired speed [m/s]."""

    largest: float
    rms: float
    speed: float


def corner(k):
    return np.array([*CORNERS[k % 4], EXTENSION])


def diamond(t, duration):
    """The published path, the extension held."""
    k = int(t // duration)
    return leg(corner(k), corner(k + 1), t - k * duration, duration)


def tuning_path(t, duration):
    """Up and back on a slanted line, the extension moving: not the test's path."""
    low, high = np.array([2.6, 0.9, 0.4]), np.array([3.2, 1.3, 0.6])
    return leg(low, high, t, duration) if t < duration else leg(high, low, t - duration, duration)


@cache
def believed(share=0.9):
    """A model whose inertias are a share of the true ones."""
    robot = crane().robot
    model = robot.model.copy()
    for j in range(1, model.njoints):
        model.inertias[j] = share_of(model.inertias[j], share)
    return ClosedChain(dataclasses.replace(robot, model=model))


def share_of(inertia, share):
    copy = inertia.copy()
    copy.mass, copy.inertia = share * inertia.mass, share * inertia.inertia
    return copy


class Vdc:
    """VDC for ideal force actuators; K from one bandwidth, as the baselines have one number."""

    def __init__(self, chain, bandwidth, adaptation=0.0, outer=6.0):
        self.chain, self.outer = chain, outer * np.eye(3)
        self.control = VdcController(chain, VdcGains(piston=np.zeros(3), bandwidth=bandwidth, adaptation=adaptation))

    def __call__(self, z, zd, path, _):
        state = self.chain.at(z, zd)
        force, motion = self.control.forces(state, required_motion(task(), state, path, self.outer))
        self.control.learn(motion, DT)
        return force


class Baseline:
    """Follows the same path in joint space."""

    def __init__(self, chain, law):
        self.chain, self.law = chain, law

    def __call__(self, z, zd, path, desired):
        z_d = task().solve(self.chain, path.position, desired)
        jacobian = task().jacobian(at := self.chain.at(z_d, np.zeros(3)))
        zd_d = np.linalg.solve(jacobian, path.velocity)
        at = self.chain.at(z_d, zd_d)
        state = self.chain.at(z, zd)
        if isinstance(self.law, PistonPid):
            return self.law.forces(state, at, DT)
        return self.law.forces(state, at, np.linalg.solve(jacobian, path.acceleration - task().drift(at, zd_d)))


def pid(bandwidth, path, duration):
    return Baseline(crane(), PistonPid(crane(), begin(path, duration), bandwidth))


def model_based(bandwidth, chain):
    return Baseline(chain, ModelBased(bandwidth))


def begin(path, duration):
    return task().solve(crane(), path(0.0, duration).position, np.array([0.8, -1.5, 0.5]))


@cache
def limits():
    found = [capacity(a) for a in crane().robot.spec.actuation]
    return np.array([-c.pull for c in found]), np.array([c.push for c in found])


def run(controller, path, seconds, duration=5.0, seed=0, noise=NOISE):
    """Errors of the tool over a run, tick by tick (ticks, 2), and the fastest desired speed; NaN once it diverges."""
    rng, chain = np.random.default_rng(seed), crane()
    z, zd = begin(path, duration), np.zeros(3)
    seen, rate = z.copy(), np.zeros(3)
    errors, speed = np.full((round(seconds / DT), 2), np.nan), 0.0
    for k in range(len(errors)):
        wanted: Path = path(k * DT, duration)
        measured = z + noise * rng.normal(size=3)
        rate = rate + DT * (FILTER**2 * (measured - seen) - 2 * FILTER * rate)
        seen = seen + DT * rate
        force = np.clip(controller(measured, rate, wanted, z), *limits())
        errors[k] = (wanted.position - task().position(chain.at(z, zd)))[:2]
        speed = max(speed, float(np.hypot(*wanted.velocity[:2])))
        z, zd = chain_step(chain, z, zd, force, DT)
        if not np.all(np.isfinite(z)) or np.hypot(*errors[k]) > 1.0:
            return np.full_like(errors, np.nan), speed
    return errors, speed


def figures(errors, speed):
    size = np.hypot(errors[:, 0], errors[:, 1])
    return Errors(float(size.max()), float(np.sqrt(np.mean(size**2))), speed)

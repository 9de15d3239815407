r"""Inputs for checks: two demonstrations of sliding into a valley, and random observations.

The demonstrations follow from statics with Coulomb friction: a tool that moves along the unit vector \(t\) on a plane
with normal \(n\) feels the force \(f = N (n - \mu t)\). They exercise a learner, and do not judge it.
"""

from __future__ import annotations

import numpy as np

from skillframe.demonstration import Demonstration
from skillframe.frames import Float, Pose, rotation_matrix
from skillframe.skill import Observation

SPEED, NORMAL_FORCE, FRICTION = 0.03, 8.0, 0.2  # m/s, N, 1
DOWN = (1.0, 0.0, 0.0, 0.0)  # tool z axis points down


def example_demonstrations() -> list[Demonstration]:
    """Two demonstrations, down either side of a 45 degree valley along y."""
    return [_slide(side, np.random.default_rng([20, i])) for i, side in enumerate((1.0, -1.0))]


def _slide(side: float, rng: np.random.Generator) -> Demonstration:
    rate, force_noise, torque_noise = 200.0, 0.05, 0.002  # Hz, N, Nm
    time = np.arange(0.0, 2.4, 1.0 / rate)  # s, of which 0.4 are the approach
    along = np.array([side, 0.0, -1.0]) / np.sqrt(2.0)
    normal = np.array([side, 0.0, 1.0]) / np.sqrt(2.0)
    touching = time >= 0.4
    direction = np.where(touching[:, None], along, np.array([0.0, 0.0, -1.0]))
    start = np.array([0.4 - 0.05 * side, 0.0, 0.2])
    position = start + np.cumsum(direction * SPEED / rate, axis=0)
    force = touching[:, None] * NORMAL_FORCE * (normal - FRICTION * along)
    wrench = np.concatenate([force, np.zeros_like(force)], axis=1)
    wrench += rng.normal(size=wrench.shape) * np.repeat([force_noise, torque_noise], 3)
    return Demonstration(
        time=time,
        position=position,
        quaternion=np.tile(DOWN, (len(time), 1)),
        wrench=wrench,
        meta={
            "task": "slide into a valley", "teacher": "kinesthetic", "rate": rate, "contact": True,
            "frames": {"wrist": [0.0, 0.0, -0.15]},
            "sensor": {"force_noise": force_noise, "torque_noise": torque_noise},
        },
    )  # fmt: skip


def random_observations(rng: np.random.Generator, trials: int, ticks: int, dt: float) -> list[Observation]:
    """Observations of `trials` tools over `ticks`: a random start pose each, then random poses near it.

    The arrays are read-only, so that a skill cannot write into them.
    """
    home = Pose(rng.uniform([0.2, -0.2, 0.1], [0.6, 0.2, 0.5], (trials, 3)), _rotations(rng, trials, 1.0))
    found = []
    for tick in range(ticks):
        spread = float(tick > 0)
        position = home.position + spread * rng.normal(0.0, 0.005, (trials, 3))
        pose = Pose(position, _rotations(rng, trials, 0.02 * spread) @ home.rotation)
        twist = spread * rng.normal(0.0, 0.05, (trials, 6))
        wrench = rng.normal(size=(trials, 6)) * np.repeat([5.0, 0.3], 3)
        arrays = (np.full(trials, tick * dt), *pose, twist, wrench)
        for array in arrays:
            array.setflags(write=False)
        found.append(Observation(arrays[0], dt, pose, twist, wrench))
    return found


def _rotations(rng: np.random.Generator, count: int, scale: float) -> Float:
    return rotation_matrix(scale * rng.normal(size=(count, 3)))

r"""Is a robot's mass matrix one that can be inverted, at every configuration?

\(M = L^T D L\) (Featherstone, Rigid Body Dynamics Algorithms, 2008, ch. 6): eliminated from the tips to the base,
\(D_i\) is the inertia that joint i moves while everything beyond it is free. The ratio \(D_i / M_{ii}\) has no unit and
no scale; zero (to rounding) means that the joint moves nothing of its own. Sampling and the bounds are our choice.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pinocchio as pin

from skillframe.frames import Float
from skillframe.robot.kinematics import random_configuration

SINGULAR = 1e-12  # rounding leaves 1e-15 at a joint that moves nothing; an honest planar chain of 100 links has 2e-6
ILL_CONDITIONED = 1e-9
_SAMPLES = 100
_WORK = 2000  # samples times degrees of freedom, so that large models stay quick


class Pivots(NamedTuple):
    """Smallest values over the configurations, per degree of freedom.

    Attributes:
        inertia: (nv,) smallest diagonal entry, relative to what the joint carries; ratio: (nv,) smallest D_i / M_ii.
    """

    inertia: Float
    ratio: Float


def smallest_pivots(model: pin.Model, home: Float) -> Pivots:
    """Evaluate the mass matrix at home and at many random configurations within the limits."""
    rng = np.random.default_rng(0)
    count = int(np.clip(_WORK / max(model.nv, 1), 8, _SAMPLES))
    configurations = [home, *(random_configuration(model, rng) for _ in range(count))]
    inertia, ratio = np.full(model.nv, np.inf), np.full(model.nv, np.inf)
    for q in configurations:
        data = model.createData()  # fresh: with joints that follow others, Pinocchio's crba adds to what it left there
        upper = np.triu(pin.crba(model, data, q))
        mass = upper + np.triu(upper, 1).T
        inertia = np.minimum(inertia, _relative(np.diag(mass), _carried(model, data)))
        ratio = np.minimum(ratio, pivot_ratios(mass))
    return Pivots(inertia, ratio)


def pivot_ratios(mass: Float) -> Float:
    """(n,) D_i / M_ii of a symmetric matrix, eliminated from the last row, or 0 where M_ii is not positive."""
    diagonal = np.diag(mass)
    scale = np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
    rest = mass / scale[:, None] / scale
    ratios = np.zeros(len(mass))
    for i in range(len(mass) - 1, -1, -1):
        ratios[i] = rest[i, i]
        if ratios[i] > SINGULAR:
            column = rest[:i, i]
            rest[:i, :i] -= np.outer(column, column) / ratios[i]
    return ratios


def _relative(moved: Float, carried: Float) -> Float:
    """Ratio where something is carried. Elsewhere (a follower may have all the inertia) 1, 0 or -1."""
    there = carried > 0.0
    return np.where(there, moved / np.where(there, carried, 1.0), np.sign(moved))


def _carried(model: pin.Model, data: pin.Data) -> Float:
    """(nv,) what each joint carries: mass if it slides, trace of the inertia about its origin if it turns."""
    carried = np.zeros(model.nv)
    for index in range(1, model.njoints):
        joint, load = model.joints[index], data.Ycrb[index]
        lever = np.asarray(load.lever)
        turning = float(np.trace(load.inertia)) + 2.0 * load.mass * float(lever @ lever)
        for i in range(joint.nv):
            carried[joint.idx_v + i] = load.mass if i < _sliding(joint) else turning
    return carried


def _sliding(joint: pin.JointModel) -> int:
    """How many of a joint's first degrees of freedom slide: 1 prismatic, 2 planar, 3 floating."""
    if joint.nv == 1:
        return int(joint.shortname().startswith("JointModelP"))
    return {3: 2, 6: 3}[joint.nv]


def joint_of(model: pin.Model, velocity: int) -> str:
    """Name of the joint that a velocity index belongs to."""
    for index in range(1, model.njoints):
        joint = model.joints[index]
        if joint.idx_v <= velocity < joint.idx_v + joint.nv:
            return str(model.names[index])
    raise IndexError(velocity)

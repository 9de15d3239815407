r"""Sectors and pyramids: the pushes that explain an interval of motion, and the miss of others.

A tool that slides along \(\hat v\) against a contact force \(F_m\) slides alike for every push in the sector between
\(\hat v\) and \(-\hat F_m\) (Fig. 5 of the overview paper), 90 degrees - atan(mu) wide for Coulomb friction. For a
teacher's wavering, a pyramid (Fig. 8) widens it by alpha out of its plane and by beta beyond its edges. With n = v x m,
m = unit(-F_m), w the angle from v to m, e = n x v, a direction D lies

    out = |asin D.n| out of the plane,   ins = min(ang, w - ang) inside the edges,   ang = atan2(D.e, D.v),

where behind the sector, from ang = w / 2 - pi down, the edge m is the nearer one: ins = w - 2 pi - ang. With beta =
max(5 degrees, alpha / 3), the least alpha that accepts D is

    a(D) = max(out, 0 if ex <= 5 degrees else 3 ex),   ex = max(0, -ins).

Without contact (or with the load along the motion) it is a cone: angle(D, v) <= alpha + beta.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import radians
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float, cross, norm, unit
from skillframe_lmc.intervals import Motion

BETA_MIN = np.float32(radians(5.0))
DEEP = np.float32(0.6)  # rad inside a sector; more hardly counts as better
Float32 = NDArray[np.float32]


class Sectors(NamedTuple):
    """The K sectors of one demonstration.

    Attributes:
        motion: (K, 3) unit v.
        push: (K, 3) unit -F, zero where free.
        contact: (K,) False where the interval is free.
    """

    motion: Float
    push: Float
    contact: NDArray[np.bool_]

    @property
    def width(self) -> Float:
        """(K,) angle between motion and push [rad]."""
        result: Float = np.arctan2(norm(cross(self.motion, self.push)), (self.motion * self.push).sum(-1))
        return result


def sectors(motion: Motion, *, teacher_driven_only: bool = False) -> Sectors:
    """Sectors of one part of a demonstration.

    Args:
        motion: the part.
        teacher_driven_only: leave out contact in which the environment did the work, for rotations: the axis is over 90
            degrees from the push, and the sector, nearly a half circle through a random plane, accepts both +y and -y.
    """
    size = norm(motion.load)
    keep = (motion.work <= 0.0) | (size < motion.load_min) if teacher_driven_only else np.ones(len(size), dtype=bool)
    v, load, size = unit(motion.displacement[keep]), motion.load[keep], size[keep]
    push = -unit(load)
    contact = (size >= motion.load_min) & (norm(cross(v, push)) >= 0.05)
    return Sectors(v, np.where(contact[:, None], push, 0.0), contact)


def concatenated(demonstrations: Sequence[Sectors]) -> Sectors:
    """Sectors of several demonstrations as those of one."""
    motion, push, contact = (np.concatenate(parts) for parts in zip(*demonstrations, strict=True))
    return Sectors(motion, push, contact)


def misses(directions: Float, given: Sectors) -> tuple[Float32, Float32]:
    """Miss and depth of directions.

    Args:
        directions: (C, 3) unit vectors.
        given: K sectors.

    Returns:
        The least alpha (C, K) at which each interval accepts each direction, and the depth (C, K) inside the sector
            less the distance out of its plane [rad].
    """
    D = directions.astype(np.float32)
    touching, free = given.contact, ~given.contact
    shape = (len(D), len(touching))
    need, depth = np.empty(shape, np.float32), np.empty(shape, np.float32)
    if touching.any():
        need[:, touching], depth[:, touching] = _contact(D, given.motion[touching], given.push[touching])
    if free.any():
        need[:, free], depth[:, free] = _free(D, given.motion[free])
    return need, depth


def _contact(D: Float32, v: Float, m: Float) -> tuple[Float32, Float32]:
    n = unit(cross(v, m))
    e = cross(n, v)
    w = np.arctan2((m * e).sum(-1), (m * v).sum(-1)).astype(np.float32)
    out = np.abs(np.arcsin(np.clip(D @ n.T.astype(np.float32), -1.0, 1.0)))
    angle = np.arctan2(D @ e.T.astype(np.float32), D @ v.T.astype(np.float32))
    inside = np.maximum(np.minimum(angle, w - angle), w - np.float32(2.0 * np.pi) - angle)
    beyond = -inside
    need = np.maximum(out, np.where(beyond <= BETA_MIN, np.float32(0.0), np.float32(3.0) * beyond))
    # slope beyond DEEP, so that the middle of two wide sectors is no plateau
    return need, np.minimum(inside, DEEP + np.float32(0.05) * (inside - DEEP)) - out


def _free(D: Float32, v: Float) -> tuple[Float32, Float32]:
    off = np.arccos(np.clip(D @ v.T.astype(np.float32), -1.0, 1.0))
    scaled = np.float32(0.75) * off
    return np.where(scaled >= 3.0 * BETA_MIN, scaled, np.maximum(off - BETA_MIN, np.float32(0.0))), -off

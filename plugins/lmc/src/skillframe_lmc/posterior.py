r"""The push: a posterior over all pushes, of which every piece of path is a witness.

A tool slides along v against the contact force F for every push in the *sector* between v and m = -F / |F|, which is 90
degrees - atan(mu) wide (Fig. 5 of the overview paper). A push that has to pass several contacts must lie in all their
sectors, however long each was slid on. A mean over the path weights contacts by their length, and so misses the push
where a short one bounds the set.

**Witnesses.** Pieces k and j (`pieces`) say the same as far as kappa(k, j) is near 1:

    kappa(k, j) = exp(-angle(v_k, v_j)^2 / 2 (20 deg)^2 - angle(m_k, m_j)^2 / 2 (10 deg)^2)     both in contact
    kappa(k, j) = exp(-angle(v_k, v_j)^2 / 2 (20 deg)^2)                                        both free
    n_k = sum_j kappa(k, j) l_j,        weight_k = l_k (1 - exp(-n_k / l_0)) / n_k

The weights of a contact of length L add up to 1 - exp(-L / l_0): a long floor is one witness, a spike a fraction of
one. Demonstrations are scaled to the same sum, in which those that show the same share theirs: a recording played twice
counts once.

**Explanation.** Let a be the angle of a push D from v in the plane of v and the edge, w the angle of the edge, and out
the angle of D out of that plane. A piece in contact, or free, explains D with

    S_k(D) = low(a) Phi((w - a) / 5 deg) exp(-out^2 / 2 (15 deg)^2),    low = exp(-a^2 / 2 (15 deg)^2) for a < 0, else 1
    S_k(D) = exp(-angle(D, v)^2 / 2 (15 deg)^2)

Beyond the far edge the tool jams. Before the near edge it only lifts and goes on in the air, as an aim does that is off
by 15 degrees. A contact that turns the tool says little by its motion: the share t of a piece that turned says what the
hand pushed, S <- S (1 - t + t exp(-angle(D, m)^2 / 2 (10 deg)^2)). No witness has a veto:

    log P(D) = sum_k weight_k log(e + (1 - e) S_k(D)),      e = 1/20 in contact, 1/10 free

**Decision.** P is flat where all sectors overlap. The push is the mean of D, weighted by P, over the plateau
P >= P_max / 10: the middle of what passes, with margin to every edge. With few witnesses the plateau ends half-way (of
log P) between P_max and a push that explains nothing. The push exists if it explains pieces of a share of the weight,
each with S > 0.3, and if it lies on a plateau of at most 60 degrees to either side, as it does not between two peaks.

All constants are our choice. Those in degrees are the error of a teacher's aim (15, 10), of m (5: the fixture off by 2
degrees, friction by a fifth), and how far v and m vary over one face (20, 10). Effect: docs/evidence/worth.md.
"""

from __future__ import annotations

from math import cos, log, radians
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from skillframe.frames import Float, cross, dot, norm, unit
from skillframe_lmc import sphere
from skillframe_lmc.pieces import Pieces

Float32 = NDArray[np.float32]
ALIKE_MOTION, ALIKE_PUSH = radians(20.0), radians(10.0)
EDGE, AIM, HELD = radians(5.0), radians(15.0), radians(10.0)  # of the far edge; of an aim; of the push in a turn
DOUBT, DOUBT_FREE = 0.05, 0.1  # e
MERGED = cos(radians(3.0))
PUSH_EXISTS, TURN_EXISTS = 0.4, 0.7
"""Least share explained. Two ways in the air 60 degrees apart have 0, humps 0.43 and more; turns on purpose 1.00, and
those that only aligned a peg or coupler from two sides at most 0.52."""
WIDEST = radians(60.0)  # half width; one contact without friction leaves 45
EXPLAINED = 0.3  # least S of a piece that counts as explained
COARSE = 32  # cells of 6.3 degrees; their children's children have 1.6


class Choice(NamedTuple):
    """Direction of a part's push, and how sure it is.

    Attributes:
        direction: (3,) unit vector, or None if no push explains the demonstrations.
        explained: share of the weight (or of the papers' intervals) that the best push explains.
        solid_angle: of the plateau [sr]; 0 without a direction.
        half_width: largest half width of the plateau [rad].
        pyramid_angle: half-opening at which the papers' pyramids share a direction [rad], or None.
    """

    direction: Float | None
    explained: float
    solid_angle: float
    half_width: float
    pyramid_angle: float | None = None


class Witnesses(NamedTuple):
    """K pieces, and the weight (K,) of each."""

    pieces: Pieces
    weight: Float


def witnesses(pieces: Pieces, whole: float) -> Witnesses:
    """Pieces of all demonstrations, weighed.

    Args:
        pieces: at least one.
        whole: l_0 [m or rad] (`pieces.whole_witness`).
    """
    free = ~pieces.contact
    apart = (_apart(pieces.motion) / ALIKE_MOTION) ** 2 + np.where(free, 0.0, (_apart(pieces.edge) / ALIKE_PUSH) ** 2)
    alike = np.where(free[:, None] == free, np.exp(-0.5 * apart), 0.0) * pieces.length
    same = alike.sum(axis=1)
    weight = pieces.length * (1.0 - np.exp(-same / whole)) / same
    return _merged(pieces, weight * _balance(alike, pieces, weight))


def _balance(alike: Float, pieces: Pieces, weight: Float) -> Float:
    """Factor (K,) that gives each demonstration the same sum, those that show the same sharing theirs."""
    of = (pieces.demonstration[:, None] == np.unique(pieces.demonstration)).astype(float)
    shared = (of * pieces.length[:, None]).T @ alike @ of
    size = np.sqrt(np.diag(shared))
    copies = (shared / np.outer(size, size)).sum(axis=1)
    total = weight @ of
    wanted = total.sum() / copies / (1.0 / copies).sum()
    result: Float = of @ (wanted / total)
    return result


def _merged(pieces: Pieces, weight: Float) -> Witnesses:
    """Witnesses of the same face as one each, for speed: within 3 degrees, where an edge is soft by 5."""
    near = (
        (pieces.motion @ pieces.motion.T >= MERGED) & (pieces.edge @ pieces.edge.T >= MERGED)
        & (pieces.contact[:, None] == pieces.contact) & (np.abs(pieces.turning[:, None] - pieces.turning) < 0.1)
    )  # fmt: skip
    left, groups = np.ones(len(weight), dtype=bool), list[NDArray[np.float64]]()
    while left.any():
        each = near[np.argmax((near & left).sum(axis=1) * left)] & left
        groups.append(each * weight)
        left &= ~each
    by = np.array(groups)
    total = by.sum(axis=1)
    share = by / total[:, None]
    first = by.argmax(axis=1)
    merged = Pieces(
        unit(share @ pieces.motion), unit(share @ pieces.push), unit(share @ pieces.edge), pieces.contact[first],
        (by > 0.0) @ pieces.length, share @ pieces.turning, pieces.demonstration[first],
    )  # fmt: skip
    return Witnesses(merged, total)


def explained(directions: Float, given: Pieces) -> Float32:
    """S (C, K) of pushes (C, 3)."""
    D = directions.astype(np.float32)
    result = np.empty((len(D), len(given.contact)), np.float32)
    touch, free = given.contact, ~given.contact
    if free.any():
        result[:, free] = _bell(_angle(D, given.motion[free]), AIM)
    if touch.any():
        v, m = given.motion[touch], given.edge[touch]
        normal = unit(cross(v, m))
        across = cross(normal, v)
        width = np.arctan2(dot(m, across), dot(m, v)).astype(np.float32)
        angle = np.arctan2(D @ across.T.astype(np.float32), D @ v.T.astype(np.float32))
        out = np.arcsin(np.clip(D @ normal.T.astype(np.float32), -1.0, 1.0))
        sector = _bell(np.hypot(np.minimum(angle, 0.0), out), AIM) * ndtr((width - angle) / np.float32(EDGE))
        turning = given.turning[touch].astype(np.float32)
        if turning.max() > 0.0:
            sector *= 1.0 - turning + turning * _bell(_angle(D, given.push[touch]), HELD)
        result[:, touch] = sector
    return result


def log_probability(directions: Float, seen: Witnesses) -> Float:
    """Log P (C,) of pushes (C, 3)."""
    e = np.where(seen.pieces.contact, DOUBT, DOUBT_FREE).astype(np.float32)
    logs: Float = np.log(e + (1.0 - e) * explained(directions, seen.pieces)).astype(float) @ seen.weight
    return logs


def nothing_explained(seen: Witnesses) -> float:
    """Log P of a push that explains nothing."""
    return float(np.log(np.where(seen.pieces.contact, DOUBT, DOUBT_FREE)) @ seen.weight)


def depth(most: float, seen: Witnesses) -> float:
    """How far below the largest log P the plateau ends."""
    return min(log(10.0), 0.5 * (most - nothing_explained(seen)))


def decide(seen: Witnesses, exists: float) -> Choice:
    """Middle of the plateau.

    Args:
        seen: at least one witness.
        exists: least share of the weight that a push has to explain.
    """
    cells, directions = sphere.whole(COARSE)
    logs = log_probability(directions, seen)
    height = float(logs.max()) - nothing_explained(seen)
    cells = sphere.children(sphere.children(cells[logs >= logs.max() - min(log(100.0), 0.8 * height)]))
    directions = sphere.centres(cells, 4 * COARSE)
    logs = log_probability(directions, seen)
    least = float(logs.max()) - depth(float(logs.max()), seen)
    directions, logs = directions[logs >= least], logs[logs >= least]
    push = unit(np.exp(logs - logs.max()) @ directions)
    share = float(seen.weight @ (explained(push[None], seen.pieces)[0] > EXPLAINED) / seen.weight.sum())
    wide, believed = half_width(directions, push), log_probability(push[None], seen)[0] >= least
    if share < exists or wide > WIDEST or not believed:
        return Choice(None, share, 0.0, 0.0)
    return Choice(push, share, len(directions) * sphere.solid_angle(4 * COARSE), wide)


def half_width(directions: Float, centre: Float) -> float:
    """Largest half width of a set of directions (C, 3) about one (3,) [rad]."""
    tangent = directions - (directions @ centre)[:, None] * centre
    length = norm(tangent)
    angle = np.arctan2(length, directions @ centre)
    flat = tangent * (angle / np.where(length > 0.0, length, 1.0))[:, None]
    along = flat @ np.linalg.eigh(flat.T @ flat)[1][:, -1]
    return float(0.5 * (along.max() - along.min()))


def _apart(vectors: Float) -> Float:
    return np.arccos(np.clip(vectors @ vectors.T, -1.0, 1.0))


def _angle(D: Float32, vectors: Float) -> Float32:
    return np.arccos(np.clip(D @ vectors.T.astype(np.float32), -1.0, 1.0))


def _bell(angle: Float32, sigma: float) -> Float32:
    result: Float32 = np.exp(np.float32(-0.5 / sigma**2) * angle * angle)
    return result

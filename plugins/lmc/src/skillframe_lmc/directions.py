r"""Desired direction as in the papers: intersection of the pyramids of all demonstrations, without outliers.

It decides with `concatenated`, and for a press. A demonstration needs the alpha at which four fifths of its intervals
accept a direction, the 0.8 quantile of their a_k(D) (`sectors`):

    A(D) = max over demonstrations of the quantile of a_k(D),      alpha* = max(8 degrees, min over D of A)

The direction exists if alpha* <= 25 degrees, and maximises

    M(D) = min over demonstrations of mean_k(depth)    among    {A(D) <= 1.25 alpha*}.

After cells of 1.6 degrees, a mean over a disc of 3 degrees, weighted by exp(M / 0.02 rad), removes the cells' effect.
The papers intersect rectangles in a plane of two angles and print no constants; the sphere has no poles.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil, radians

import numpy as np

from skillframe.frames import Float, cross, norm, unit
from skillframe_lmc import sphere
from skillframe_lmc.posterior import Choice, half_width
from skillframe_lmc.sectors import Sectors, misses

ACCEPTED = 0.8  # share of a demonstration's intervals; the rest may be outliers
LEAST_PYRAMID, MOST_PYRAMID, SLACK = radians(8.0), radians(25.0), 1.25
LEVELS = ((32, radians(15.0)), (64, radians(7.0)), (128, 0.0))
"""Resolution, and by how much a parent's need may exceed its best child's (3 x the cell's half diagonal)."""
MOST_CELLS = 700
DISC = (radians(3.0), radians(0.3))  # radius and spacing of the last search
DISC_SCALE = 0.02


def needs(directions: Float, demonstrations: Sequence[Sectors]) -> tuple[Float, Float]:
    """A (C,) and M (C,) of directions (C, 3)."""
    need = np.full(len(directions), -np.inf)
    depth = np.full(len(directions), np.inf)
    for given in demonstrations:
        a, deep = misses(directions, given)
        k = ceil(ACCEPTED * a.shape[1] - 1e-9) - 1
        need = np.maximum(need, np.partition(a, k, axis=1)[:, k])
        depth = np.minimum(depth, deep.mean(axis=1))
    return need, depth


def choose(demonstrations: Sequence[Sectors]) -> Choice:
    """Desired direction of one part, from sectors of at least one interval each."""
    directions, need, depth, resolution = _search(demonstrations)
    angle = max(LEAST_PYRAMID, float(need.min()))
    if angle > MOST_PYRAMID:
        votes = _votes(directions[np.argmin(need)], demonstrations, MOST_PYRAMID)
        return Choice(None, votes, 0.0, 0.0, angle)
    feasible = need <= SLACK * angle
    candidates = directions[feasible]
    best = _polished(candidates[np.argmax(depth[feasible])], demonstrations, SLACK * angle)
    area = float(feasible.sum()) * sphere.solid_angle(resolution)
    return Choice(best, _votes(best, demonstrations, angle), area, half_width(candidates, best), angle)


def _search(demonstrations: Sequence[Sectors]) -> tuple[Float, Float, Float, int]:
    cells, directions = sphere.whole(LEVELS[0][0])
    for level, (resolution, margin) in enumerate(LEVELS):
        if level:
            cells = sphere.children(cells)
            directions = sphere.centres(cells, resolution)
        need, depth = needs(directions, demonstrations)
        bound = SLACK * max(LEAST_PYRAMID, float(need.min())) + margin
        keep = np.flatnonzero(need <= bound)
        if margin:
            cells = cells[keep[np.argsort(need[keep], kind="stable")[:MOST_CELLS]]]
    return directions, need, depth, resolution


def _polished(best: Float, demonstrations: Sequence[Sectors], limit: float) -> Float:
    steps = np.arange(-DISC[0], DISC[0] + 1e-9, DISC[1])
    offsets = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    offsets = offsets[norm(offsets) <= DISC[0]]
    first = unit(np.eye(3)[np.argmin(np.abs(best))] - best[np.argmin(np.abs(best))] * best)
    tangents = np.stack([first, cross(best, first)])
    around = unit(best + offsets @ tangents)
    need, depth = needs(around, demonstrations)
    weight = np.where(need <= limit, np.exp((depth - depth.max()) / DISC_SCALE), 0.0)
    return unit(weight @ around) if weight.sum() > 0.0 else best


def _votes(direction: Float, demonstrations: Sequence[Sectors], angle: float) -> float:
    return min(float((misses(direction[None], given)[0] <= angle + 1e-6).mean()) for given in demonstrations)

r"""The desired direction: intersection of the pyramids of all demonstrations with outlier rejection, on the sphere.

A direction's need in one demonstration is the alpha that makes a share q of its intervals accept it (the rest are
outliers); over demonstrations the largest need counts, so that each has equal weight however long it is:

    A(D) = max over demonstrations of the q-quantile of a_k(D),      alpha* = max(8 degrees, min over D of A)

The direction exists if alpha* <= 25 degrees. It is chosen where it lies deepest, D maximising

    M(D) = min over demonstrations of mean_k(depth) - P(D)    among    {A(D) <= 1.25 alpha*},

where P is what is held against directions that leave the way the demonstrations headed as a whole (`heading`). The
search goes first among cells of 1.6 degrees, then takes the mean over a disc of 3 degrees around the best, weighted by
exp(M / 0.02 rad), which makes the result independent of where the cells lie. The papers intersect rectangles in a plane
of two angles and do not print the constants; votes on the sphere have no poles, and every constant here is ours.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil, radians
from typing import NamedTuple

import numpy as np

from skillframe.frames import Float, cross, norm, unit
from skillframe_lmc import sphere
from skillframe_lmc.heading import NO_HEADING, Heading, doubt
from skillframe_lmc.sectors import Sectors, misses
from skillframe_lmc.settings import Settings

LEVELS = ((32, radians(15.0)), (64, radians(7.0)), (128, 0.0))
"""Resolution, and by how much a parent's need may exceed that of its best child (3 x the cell's half diagonal)."""
MOST_CELLS = 700
DISC = (radians(3.0), radians(0.3))  # radius and spacing of the last search
DISC_SCALE = 0.02


class Choice(NamedTuple):
    """What the votes say.

    Attributes:
        direction: (3,) unit vector, or None if no push explains the demonstrations.
        pyramid_angle: alpha*, the half-opening at which the pyramids begin to share a direction [rad].
        votes: share of intervals whose pyramid at alpha* accepts the direction, in the worst demonstration.
        solid_angle: of all directions accepted at 1.25 alpha* [sr]; 0 if there is no direction.
        half_width: of that set at its widest, seen from the direction [rad].
        widest: (3,) unit tangent vector along which it is widest, or None.
    """

    direction: Float | None
    pyramid_angle: float
    votes: float
    solid_angle: float
    half_width: float
    widest: Float | None


def needs(
    directions: Float, demonstrations: Sequence[Sectors], quantile: float, way: Heading = NO_HEADING
) -> tuple[Float, Float]:
    """A (C,) and M (C,) of directions (C, 3)."""
    need = np.full(len(directions), -np.inf)
    depth = np.full(len(directions), np.inf)
    for given in demonstrations:
        a, deep = misses(directions, given)
        k = ceil(quantile * a.shape[1] - 1e-9) - 1
        need = np.maximum(need, np.partition(a, k, axis=1)[:, k])
        depth = np.minimum(depth, deep.mean(axis=1))
    return need, depth - doubt(directions, way)


def choose(demonstrations: Sequence[Sectors], settings: Settings, way: Heading = NO_HEADING) -> Choice:
    """The desired direction of one part.

    Args:
        demonstrations: sectors of each demonstration, at least one interval each.
        settings: `quantile`, `pyramid_min_rad`, `pyramid_max_rad`, `slack`.
        way: where the demonstrations headed as a whole.
    """
    directions, need, depth, resolution = _search(demonstrations, settings, way)
    angle = max(settings.pyramid_min_rad, way.least_pyramid, float(need.min()))
    if angle > settings.pyramid_max_rad:
        votes = _votes(directions[np.argmin(need)], demonstrations, settings.pyramid_max_rad)
        return Choice(None, angle, votes, 0.0, 0.0, None)
    feasible = need <= settings.slack * angle
    candidates = directions[feasible]
    best = _polished(candidates[np.argmax(depth[feasible])], demonstrations, settings, settings.slack * angle, way)
    half_width, widest = _extent(candidates, best)
    area = float(feasible.sum()) * sphere.solid_angle(resolution)
    return Choice(best, angle, _votes(best, demonstrations, angle), area, half_width, widest)


def _search(demonstrations: Sequence[Sectors], settings: Settings, way: Heading) -> tuple[Float, Float, Float, int]:
    """Needs and depths on the finest level, only where something may be feasible."""
    cells, directions = sphere.whole(LEVELS[0][0])
    for level, (resolution, margin) in enumerate(LEVELS):
        if level:
            cells = sphere.children(cells)
            directions = sphere.centres(cells, resolution)
        need, depth = needs(directions, demonstrations, settings.quantile, way)
        bound = settings.slack * max(settings.pyramid_min_rad, way.least_pyramid, float(need.min())) + margin
        keep = np.flatnonzero(need <= bound)
        if margin:
            cells = cells[keep[np.argsort(need[keep], kind="stable")[:MOST_CELLS]]]
    return directions, need, depth, resolution


def _polished(best: Float, demonstrations: Sequence[Sectors], settings: Settings, limit: float, way: Heading) -> Float:
    """The weighted mean of the directions around the best cell that are feasible too."""
    steps = np.arange(-DISC[0], DISC[0] + 1e-9, DISC[1])
    offsets = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    offsets = offsets[norm(offsets) <= DISC[0]]
    first = unit(np.eye(3)[np.argmin(np.abs(best))] - best[np.argmin(np.abs(best))] * best)
    tangents = np.stack([first, cross(best, first)])
    around = unit(best + offsets @ tangents)
    need, depth = needs(around, demonstrations, settings.quantile, way)
    weight = np.where(need <= limit, np.exp((depth - depth.max()) / DISC_SCALE), 0.0)
    return unit(weight @ around) if weight.sum() > 0.0 else best


def _votes(direction: Float, demonstrations: Sequence[Sectors], angle: float) -> float:
    each = [float((misses(direction[None], given)[0] <= angle + 1e-6).mean()) for given in demonstrations]
    return min(each)


def _extent(candidates: Float, centre: Float) -> tuple[float, Float | None]:
    """Half of the largest width of a set of directions, and the tangent along it."""
    tangent = candidates - (candidates @ centre)[:, None] * centre
    length = norm(tangent)
    angle = np.arctan2(length, candidates @ centre)
    flat = tangent * (angle / np.where(length > 0.0, length, 1.0))[:, None]
    values, vectors = np.linalg.eigh(flat.T @ flat)
    if values[-1] <= 0.0:
        return 0.0, None
    along = flat @ vectors[:, -1]
    return float(0.5 * (along.max() - along.min())), vectors[:, -1]

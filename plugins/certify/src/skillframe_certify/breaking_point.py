r"""Search for the smallest disturbance that makes a skill fail: rays from the nominal point, then local search.

A disturbance's size is its distance from the nominal point, with each quantity in half widths of its range. Widely
spread directions are tried just inside the best radius so far; failing rays are bisected in parallel. While no ray
fails, more follow. Then the three best rays, thirty degrees apart, are varied and shortened in batches: an evolution
strategy with one parent a ray, whose step grows after a hit, shrinks after a miss and restarts when small.

Starts in collision are not trials. The result is confirmed with fresh noise; a smaller disturbance may exist in an
untried direction.
"""

from __future__ import annotations

from collections.abc import Generator, Iterator
from dataclasses import dataclass
from itertools import islice
from typing import NamedTuple

import numpy as np

from skillframe.frames import Float
from skillframe_certify.border import ToTry
from skillframe_certify.engine import Looked, Say

BUDGET = {1: 96, 2: 256, 3: 384, 4: 600, 5: 960, 6: 960}
"""Most trials of a search, by the number of quantities."""
AGAIN = 8
"""Fresh trials at a point to confirm."""
INSIDE = 0.97
"""Share of the smallest radius so far at which a new ray is tried."""
APART = np.cos(np.radians(30.0))
PARENTS, CHILDREN = 3, 8
BEGIN = 0.3
"""First and largest step of a ray's direction, whose length is 1."""
POOL = 14
"""Binary logarithm of the number of candidate directions."""


class BreakingPoints(NamedTuple):
    """Result of a search.

    Attributes:
        trials: of the search.
        undisturbed: failures among `AGAIN` trials at the nominal point.
        points: (k, d) failing points to confirm, smallest first; empty if nothing failed.
    """

    trials: int
    undisturbed: int
    points: Float


@dataclass(slots=True)
class Ray:
    """A direction in which the skill fails at `radius` and works at `works`."""

    direction: Float
    radius: float
    works: float = 0.0
    step: float = BEGIN


def reach(origin: Float, directions: Float) -> Float:
    """Return the lengths (...,) of rays (..., d) from a point to the end of the ranges."""
    with np.errstate(divide="ignore"):
        room = np.where(directions > 0.0, 1.0 - origin, np.where(directions < 0.0, -1.0 - origin, np.inf))
        lengths = np.where(directions != 0.0, room / directions, np.inf)
    result: Float = np.maximum(0.0, lengths.min(axis=-1))
    return result


def directions(dimension: int) -> Float:
    """Return (2^POOL, d) unit vectors, even over the sphere."""
    from scipy.special import ndtri
    from scipy.stats import qmc

    points = qmc.Sobol(dimension, scramble=True, rng=np.random.default_rng(1)).random_base2(POOL)
    normal = ndtri(np.clip(points, 1e-9, 1.0 - 1e-9))
    result: Float = normal / np.sqrt(np.sum(normal**2, axis=1, keepdims=True))
    return result


def spread(origin: Float) -> Iterator[Float]:
    """Yield unit vectors (d,) without end, each far from its predecessors, the longest ray first.

    The next one maximises the angle to its nearest predecessor times the root of its ray's length, because a failing
    region that widens outwards is wider on long rays. Scores are rounded so that all processors pick the same vectors.
    """
    ways = directions(len(origin))
    weights = np.sqrt(reach(origin, ways))
    nearest = np.full(len(ways), np.pi)
    while True:
        score = np.round(nearest * weights, 6)
        if not np.any(score > 0.0):  # all were used; they start over, as noise may decide
            nearest[:] = np.pi
            continue
        way = ways[np.argmax(score)]
        nearest = np.minimum(nearest, np.arccos(np.clip(ways @ way, -1.0, 1.0)))
        yield way


def search(
    seen: Looked, origin: Float, budget: int, say: Say = lambda text: None
) -> Generator[ToTry, Looked, BreakingPoints]:
    """Search failing points: yield points to try, receive their outcomes.

    Args:
        seen: trials so far; failed ones give the first rays.
        origin: (d,) the nominal point.
        budget: trials in all; up to half more if the first failure is met late.
        say: receives the progress.
    """
    ended = yield ToTry(np.tile(origin, (AGAIN, 1)), 0)
    undisturbed, spent = int(np.sum(ended.fails)), AGAIN
    if undisturbed > AGAIN // 2:
        return BreakingPoints(spent, undisturbed, origin[None, :])
    rays = known_rays(seen, origin)
    spent += yield from _rays(rays, origin, budget - _count(len(origin)), say)
    budget = max(budget, spent + budget // 2) if rays else budget  # a first failure may be met late
    number = 0
    while rays and spent + PARENTS * CHILDREN <= budget:
        number += 1
        parents, children = parents_of(rays), list[tuple[Float, float]]()
        for i, ray in enumerate(parents):
            rng = np.random.default_rng([number, i])
            for k, factor in enumerate((0.98, 0.94, 0.88, 0.98, 0.8, 0.98, 0.94, 0.65)):  # of the ray's radius
                way = ray.direction + (ray.step * rng.standard_normal(len(ray.direction)) if k else 0.0)
                children.append((way / np.sqrt(np.sum(way**2)), factor * ray.radius))
        fails = yield from _tried(origin, children)
        for i, ray in enumerate(parents):
            own = slice(i * CHILDREN, (i + 1) * CHILDREN)
            hits = [child for child, failed in zip(children[own], fails[own], strict=True) if failed]
            if hits:
                ray.direction, ray.radius = min(hits, key=lambda child: child[1])
                ray.step = min(1.5 * ray.step, BEGIN)
            else:
                ray.step = ray.step / 1.6 if ray.step > 0.01 else BEGIN
        spent += len(fails)
        say(f"{_smallest(rays)}, about {budget - spent} trials to go")
    best = sorted(rays, key=lambda ray: ray.radius)
    points = np.array([origin + ray.radius * ray.direction for ray in best]).reshape(-1, len(origin))
    return BreakingPoints(spent, undisturbed, points)


def known_rays(seen: Looked, origin: Float) -> list[Ray]:
    """Return rays through failed trials, nearest first and well separated."""
    away = seen.points[seen.fails] - origin
    sizes = np.sqrt(np.sum(away**2, axis=1))
    rays: list[Ray] = []
    for i in np.argsort(sizes, kind="stable"):
        if len(rays) < 16 and sizes[i] > 0.0 and all(away[i] @ ray.direction < APART * sizes[i] for ray in rays):
            rays.append(Ray(away[i] / sizes[i], float(sizes[i])))
    return rays


def _rays(rays: list[Ray], origin: Float, most: int, say: Say) -> Generator[ToTry, Looked, int]:
    """Find and bisect failing rays, and return the number of trials, at most `most` while none fails."""
    best, count = min((ray.radius for ray in rays), default=np.inf), _count(len(origin))
    ways, spent = spread(origin), 0
    while not spent or (not rays and spent + count <= most):
        new = [(way, min(float(reach(origin, way)), INSIDE * best)) for way in islice(ways, count)]
        fails = yield from _tried(origin, new)
        rays += [Ray(way, radius) for (way, radius), failed in zip(new, fails, strict=True) if failed]
        spent += len(new)
    while live := _live(rays):
        middles = [0.5 * (ray.works + ray.radius) for ray in live]
        fails = yield from _tried(origin, [(ray.direction, at) for ray, at in zip(live, middles, strict=True)])
        spent += len(live)
        for ray, at, failed in zip(live, middles, fails, strict=True):
            ray.radius, ray.works = (at, ray.works) if failed else (ray.radius, at)
        say(f"{_smallest(rays)}, on {len(live)} rays")
    return spent


def _count(dimension: int) -> int:
    return 32 if dimension < 4 else 64


def _live(rays: list[Ray]) -> list[Ray]:
    """Rays not yet bisected to 5 % that may still be the best."""
    best = min((ray.radius for ray in rays), default=np.inf)
    return [ray for ray in rays if ray.radius - ray.works > 0.05 * ray.radius and ray.works < INSIDE * best]


def _tried(origin: Float, ways: list[tuple[Float, float]]) -> Generator[ToTry, Looked, list[bool]]:
    points = np.array([origin + radius * way for way, radius in ways])
    ended = yield ToTry(np.clip(points, -1.0, 1.0), 0)
    return [bool(failed) for failed in ended.fails]


def parents_of(rays: list[Ray]) -> list[Ray]:
    """Return the best rays, at least thirty degrees apart."""
    parents: list[Ray] = []
    for ray in sorted(rays, key=lambda ray: ray.radius):
        if len(parents) < PARENTS and all(ray.direction @ other.direction < APART for other in parents):
            parents.append(ray)
    return parents


def _smallest(rays: list[Ray]) -> str:
    return f"smallest disturbance so far {min(ray.radius for ray in rays):.2f} of the half ranges"

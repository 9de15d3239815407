r"""The smallest disturbance that breaks a skill: rays from where it works, then a local search about the best of them.

A disturbance is a point of the declared ranges; its size is its distance from the nominal point, each quantity counted
in half widths of its range. Directions as far apart as can be are tried just inside the best radius found so far,
where most rays work and cost one trial; those that fail are bisected, all side by side. Where none fails, more are
tried until few trials are left: what fails in few directions only is met by chance. Then the three best rays, thirty
degrees apart, are bent at random and shortened, a batch at a time: a step grows after a hit, shrinks after a miss and
begins again once it is small (an evolution strategy with one parent a ray). Batches instead of single trials are our
choice: a batch of 24 takes hardly longer than one trial.

The last point is tried again with fresh noise. What comes out is the smallest disturbance *found*: a smaller one in a
direction that no ray met may exist.
"""

from __future__ import annotations

from collections.abc import Generator, Iterator
from dataclasses import dataclass
from itertools import islice
from typing import NamedTuple

import numpy as np

from skillframe.campaign.claims.border import ToTry
from skillframe.campaign.claims.engine import Looked, Say
from skillframe.frames import Float

BUDGET = {1: 96, 2: 256, 3: 384, 4: 600, 5: 960, 6: 960}
"""Trials after which a search ends, by the number of quantities; ours, from runs on synthetic truths."""
LATE = 2
"""A first failure that is met late is followed for half of the budget all the same, beyond its end."""
AGAIN, MOST_AGAIN = 8, 3
"""Fresh trials at a point that is to be confirmed, and how many points are tried, the smallest first."""
INSIDE, NARROW, FINE = 0.97, 0.05, 0.01
APART = np.cos(np.radians(30.0))
PARENTS, CHILDREN = 3, 8
KNOWN = 16
"""Rays through trials that were seen to fail."""
FACTORS = (0.98, 0.94, 0.88, 0.98, 0.8, 0.98, 0.94, 0.65)
"""Radii of a ray's children over its own."""
BEGIN, GROW, SHRINK = 0.3, 1.5, 1.6
POOL, DECIMALS = 14, 6
"""Binary logarithm of the directions to choose from, and the digits of a score that count."""


class BreakingPoints(NamedTuple):
    """What a search came to.

    Attributes:
        trials: of the search.
        undisturbed: how many of `AGAIN` trials at the nominal point failed.
        points: (k, d) failing points that are worth confirming, the smallest first; none where nothing failed.
    """

    trials: int
    undisturbed: int
    points: Float


@dataclass(slots=True)
class Ray:
    """A direction in which the skill fails at `radius`, and what is known to work below."""

    direction: Float
    radius: float
    works: float = 0.0
    step: float = BEGIN


def reach(origin: Float, directions: Float) -> Float:
    """How far rays (..., d) from a point of the ranges go until they leave them, (...,)."""
    with np.errstate(divide="ignore"):
        room = np.where(directions > 0.0, 1.0 - origin, np.where(directions < 0.0, -1.0 - origin, np.inf))
        lengths = np.where(directions != 0.0, room / directions, np.inf)
    result: Float = np.maximum(0.0, lengths.min(axis=-1))
    return result


def directions(dimension: int) -> Float:
    """(2^POOL, d) unit vectors, even over the sphere."""
    from scipy.special import ndtri
    from scipy.stats import qmc

    points = qmc.Sobol(dimension, scramble=True, rng=np.random.default_rng(1)).random_base2(POOL)
    normal = ndtri(np.clip(points, 1e-9, 1.0 - 1e-9))
    result: Float = normal / np.sqrt(np.sum(normal**2, axis=1, keepdims=True))
    return result


def spread(origin: Float) -> Iterator[Float]:
    """Unit vectors (d,) without end, each as far as can be from those before, that with the longest ray first.

    Of `directions` the next is that whose angle to its nearest predecessor is largest, times the root of how far its
    ray goes: a failure that widens as it goes out is the wider the farther a ray goes. Root and angle are our choice;
    scores are rounded, so that last bits of other processors pick the same.
    """
    ways = directions(len(origin))
    weights = np.sqrt(reach(origin, ways))
    nearest = np.full(len(ways), np.pi)
    while True:
        score = np.round(nearest * weights, DECIMALS)
        if not np.any(score > 0.0):  # all were taken: they begin again, for noise may decide
            nearest[:] = np.pi
            continue
        way = ways[np.argmax(score)]
        nearest = np.minimum(nearest, np.arccos(np.clip(ways @ way, -1.0, 1.0)))
        yield way


def search(
    seen: Looked, origin: Float, budget: int, say: Say = lambda text: None
) -> Generator[ToTry, Looked, BreakingPoints]:
    """Yields what to try and is sent how it ended.

    Args:
        seen: trials so far; those that failed are rays that need not be found.
        origin: (d,) the nominal point.
        budget: trials in all; up to half more where the first failure is met late.
        say: told how far it is.
    """
    ended = yield ToTry(np.tile(origin, (AGAIN, 1)), 0)
    undisturbed, spent = int(np.sum(~ended.works)), AGAIN
    if undisturbed > AGAIN // 2:
        return BreakingPoints(spent, undisturbed, origin[None, :])
    rays = known_rays(seen, origin)
    spent += yield from _rays(rays, origin, budget - _count(len(origin)), say)
    budget = max(budget, spent + budget // LATE) if rays else budget
    number = 0
    while rays and spent + PARENTS * CHILDREN <= budget:
        number += 1
        spent += yield from _local(rays, origin, number)
        say(f"{_smallest(rays)}, about {budget - spent} trials to go")
    best = sorted(rays, key=lambda ray: ray.radius)
    points = np.array([origin + ray.radius * ray.direction for ray in best]).reshape(-1, len(origin))
    return BreakingPoints(spent, undisturbed, points)


def known_rays(seen: Looked, origin: Float) -> list[Ray]:
    """Rays through trials that failed, the nearest first, apart from each other."""
    away = seen.points[~seen.works] - origin
    sizes = np.sqrt(np.sum(away**2, axis=1))
    rays: list[Ray] = []
    for i in np.argsort(sizes, kind="stable"):
        if len(rays) < KNOWN and sizes[i] > 0.0 and all(away[i] @ ray.direction < APART * sizes[i] for ray in rays):
            rays.append(Ray(away[i] / sizes[i], float(sizes[i])))
    return rays


def _rays(rays: list[Ray], origin: Float, most: int, say: Say) -> Generator[ToTry, Looked, int]:
    """Find rays that fail, and how near, of `most` ways while none does. Returns the trials it took."""
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
    """Rays that are not known to `NARROW` and may still be the best."""
    best = min((ray.radius for ray in rays), default=np.inf)
    return [ray for ray in rays if ray.radius - ray.works > NARROW * ray.radius and ray.works < INSIDE * best]


def _tried(origin: Float, ways: list[tuple[Float, float]]) -> Generator[ToTry, Looked, list[bool]]:
    points = np.array([origin + radius * way for way, radius in ways])
    ended = yield ToTry(np.clip(points, -1.0, 1.0), 0)
    return [not works for works in ended.works]


def _local(rays: list[Ray], origin: Float, number: int) -> Generator[ToTry, Looked, int]:
    """One generation about the best rays. Returns the trials it took."""
    parents = parents_of(rays)
    children = [_children(ray, np.random.default_rng([number, i])) for i, ray in enumerate(parents)]
    fails = yield from _tried(origin, [child for group in children for child in group])
    for i, (ray, group) in enumerate(zip(parents, children, strict=True)):
        hits = [child for child, failed in zip(group, fails[i * CHILDREN :], strict=False) if failed]
        if hits:
            ray.direction, ray.radius = min(hits, key=lambda child: child[1])
            ray.step = min(GROW * ray.step, BEGIN)
        else:
            ray.step = ray.step / SHRINK if ray.step > FINE else BEGIN
    return len(fails)


def parents_of(rays: list[Ray]) -> list[Ray]:
    """The best rays, thirty degrees apart."""
    parents: list[Ray] = []
    for ray in sorted(rays, key=lambda ray: ray.radius):
        if len(parents) < PARENTS and all(ray.direction @ other.direction < APART for other in parents):
            parents.append(ray)
    return parents


def _children(ray: Ray, rng: np.random.Generator) -> list[tuple[Float, float]]:
    """Bent and shortened copies of a ray, the first of them not bent."""
    found = []
    for i, factor in enumerate(FACTORS):
        way = ray.direction + (ray.step * rng.standard_normal(len(ray.direction)) if i else 0.0)
        found.append((way / np.sqrt(np.sum(way**2)), factor * ray.radius))
    return found


def _smallest(rays: list[Ray]) -> str:
    return f"smallest disturbance so far {min(ray.radius for ray in rays):.2f} of the half ranges"

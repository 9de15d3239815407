r"""A search trajectory by sampling (seed, Fig. 16b): places drawn from the distribution, visited in a tour.

Samples in the order in which they were drawn waste half of the way; a nearest-neighbour tour, mended by 2-opt
exchanges, visits the same places in a fraction of it. Samples come in rounds (ours), so that every part of the
distribution has been visited early and is visited again later; a round draws as many places as a tour of its share of
the length can take.
"""

from __future__ import annotations

import numpy as np

from skillframe.frames import Float, norm
from skillframe_search.exploration import Exploration

ROUND_M = 0.1  # length of a round's tour
MOST_EXCHANGES = 400


def tour(exploration: Exploration, length: float, rng: np.random.Generator) -> Float:
    """(n, k) places in the order of the visit [m], from the start (zero) on, at least `length` metres along."""
    here, parts, travelled = np.zeros(len(exploration.mean)), [np.zeros((1, len(exploration.mean)))], 0.0
    while travelled < length:
        wanted = min(ROUND_M, length - travelled)
        path = _round(exploration, here, wanted, rng)
        travelled += float(norm(np.diff(np.vstack([here[None], path]), axis=0)).sum())
        parts.append(path)
        here = path[-1]
    return np.concatenate(parts)


def _round(exploration: Exploration, here: Float, length: float, rng: np.random.Generator) -> Float:
    """One tour of about a length: the number of places grows until their tour is that long."""
    count = 8
    places = exploration.draw(rng, count)
    path = shortened(nearest_first(places, here), here)
    while _length(path, here) < length and count < 400:
        more = exploration.draw(rng, max(count // 4, 2))
        places, count = np.concatenate([places, more]), count + len(more)
        path = shortened(nearest_first(places, here), here)
    return path


def _length(path: Float, here: Float) -> float:
    return float(norm(np.diff(np.vstack([here[None], path]), axis=0)).sum())


def nearest_first(places: Float, here: Float) -> Float:
    """The places in the order of always going to the nearest one left."""
    left, order = np.ones(len(places), dtype=bool), []
    while left.any():
        distance = np.where(left, ((places - here) ** 2).sum(axis=1), np.inf)
        nearest = int(np.argmin(distance))
        left[nearest], here = False, places[nearest]
        order.append(nearest)
    return places[order]


def shortened(path: Float, here: Float) -> Float:
    """The path after 2-opt: while some piece is better walked backwards, the best such piece is turned round."""
    path = np.vstack([here[None], path])
    for _ in range(MOST_EXCHANGES):
        apart = norm(path[:, None] - path[None])
        step = np.append(apart[np.arange(len(path) - 1), np.arange(1, len(path))], 0.0)
        # piece i+1 .. j turned round: edges (i, i+1) and (j, j+1) become (i, j) and (i+1, j+1); the end is free
        after = np.zeros_like(apart)
        after[:-1, :-1] = apart[1:, 1:]
        gain = step[:, None] + step[None] - apart - after
        gain = np.triu(gain, 2)
        i, j = np.unravel_index(int(np.argmax(gain)), gain.shape)
        if gain[i, j] <= 1e-9:
            break
        path[i + 1 : j + 1] = path[i + 1 : j + 1][::-1]
    return path[1:]

r"""Search trajectory by sampling: places of the exploration distribution, visited in a short tour.

Nearest-neighbour order with 2-opt exchanges. Samples come in rounds of 60 mm, without those next to the way so far,
from the middle outwards: with effort l and a width w seen, search theory (Koopman 1957) searches within c standard
deviations,

    l w^(k-1) v_(k-1) = v_k c^k |S|^(1/2),    1 <= c <= 3.5,    v_k the volume of the unit ball
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from skillframe.frames import Float, norm
from skillframe_search.exploration import CUT, Exploration

BALL = (1.0, 2.0, np.pi, 4.0 * np.pi / 3.0, 0.5 * np.pi**2, 8.0 * np.pi**2 / 15.0)  # volumes of unit balls
SEEN_M = 0.0008  # nearer than this to the way so far is searched


def tour(exploration: Exploration, length: float, rng: np.random.Generator) -> Float:
    """(n, k) places in the order of the visit [m], from the start (zero), at least `length` metres long."""
    path, travelled = np.zeros((1, len(exploration.mean))), 0.0
    while travelled < length:
        wanted = min(0.06, length - travelled)  # length of a round's tour
        cut = reach(exploration, travelled + wanted)
        added = _round(partial(_unseen, exploration, rng, finely(path), cut), path[-1], wanted)
        travelled += _length(added, path[-1])
        path = np.concatenate([path, added])
    return path


def reach(exploration: Exploration, length: float) -> float:
    """Standard deviations within which a way of a length could search everywhere, 1 to 3.5."""
    k = len(exploration.mean)
    looked = length * SEEN_M ** (k - 1) * BALL[k - 1]
    volume = BALL[k] * float(np.sqrt(np.linalg.det(exploration.spread)))
    return float(np.clip((looked / volume) ** (1.0 / k), 1.0, CUT))


def _unseen(exploration: Exploration, rng: np.random.Generator, seen: Float, cut: float, count: int) -> Float:
    """Samples away from the way so far, or any where most of it has been searched."""
    places = exploration.draw(rng, 4 * count, cut)
    apart = np.sqrt(((places[:, None] - seen[None]) ** 2).sum(axis=2).min(axis=1))
    return np.concatenate([places[apart > SEEN_M], places[apart <= SEEN_M]])[:count]


def finely(path: Float) -> Float:
    """The way through places, a point every 0.4 mm."""
    travelled = np.concatenate([[0.0], np.cumsum(norm(np.diff(path, axis=0)))])
    along = np.arange(0.0, travelled[-1] + 0.0004, 0.0004)  # m
    return np.stack([np.interp(along, travelled, column) for column in path.T], axis=1)


def _round(draw: Callable[[int], Float], here: Float, length: float) -> Float:
    places = draw(8)
    path = shortened(nearest_first(places, here), here)
    while _length(path, here) < length and len(places) < 400:  # of a round
        places = np.concatenate([places, draw(max(len(places) // 4, 2))])
        path = shortened(nearest_first(places, here), here)
    return path


def _length(path: Float, here: Float) -> float:
    return float(norm(np.diff(np.vstack([here[None], path]), axis=0)).sum())


def nearest_first(places: Float, here: Float) -> Float:
    """The places in order, each time the nearest one left."""
    left, order = np.ones(len(places), dtype=bool), []
    while left.any():
        distance = np.where(left, ((places - here) ** 2).sum(axis=1), np.inf)
        nearest = int(np.argmin(distance))
        left[nearest], here = False, places[nearest]
        order.append(nearest)
    return places[order]


def shortened(path: Float, here: Float) -> Float:
    """The path after 2-opt."""
    path = np.vstack([here[None], path])
    for _ in range(400):  # exchanges at most
        apart = norm(path[:, None] - path[None])
        step = np.append(apart[np.arange(len(path) - 1), np.arange(1, len(path))], 0.0)
        # reversing piece i+1 .. j turns edges (i, i+1), (j, j+1) into (i, j), (i+1, j+1); the end is free
        after = np.zeros_like(apart)
        after[:-1, :-1] = apart[1:, 1:]
        gain = step[:, None] + step[None] - apart - after
        gain = np.triu(gain, 2)
        i, j = np.unravel_index(int(np.argmax(gain)), gain.shape)
        if gain[i, j] <= 1e-9:
            break
        path[i + 1 : j + 1] = path[i + 1 : j + 1][::-1]
    return path[1:]

r"""Copies: samples that occur earlier in the same recording, bit for bit.

A run of at least ten repeated samples at one distance is a copy if it lasts 0.25 s and chance does not explain it: with
p the probability that two increments of the channel are equal, \(\sum_v p_v^2\), a run of n samples among N occurs by
chance with probability below \(N^2 p^n\), which has to be below \(10^{-6}\). A held value counts once. The original of
the two stretches is the one with smoother ends.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from skillframe.demonstration.columns import WRENCH
from skillframe.demonstration.faults.fault import COPY, Flaw
from skillframe.demonstration.stalls import LEAST_TIME, POSE, starts
from skillframe.frames import Float

FEWEST = 10
Bits = NDArray[np.uint64]


def copies(time: Float, pose: Float, wrench: Float) -> list[Flaw]:
    """Copies in the whole wrench (T, 6), in one of its channels, and in the pose (T, 7)."""
    found = [Flaw(COPY, POSE, *span) for span in _copied(time, pose)]
    whole = _copied(time, wrench)
    found += [Flaw(COPY, "wrench", *span) for span in whole]
    for i, name in enumerate(WRENCH):
        spans = _copied(time, wrench[:, i : i + 1])
        found += [Flaw(COPY, name, *span) for span in spans if not any(_shared(span, other) for other in whole)]
    return found


def _shared(one: tuple[float, float, float], other: tuple[float, float, float]) -> bool:
    first, last = sorted((one[0], one[2])), sorted((other[0], other[2]))
    length = max(one[1] - one[0], other[1] - other[0])
    return all(abs(a - b) <= length for a, b in zip(first, last, strict=True))


def _copied(time: Float, values: Float) -> list[tuple[float, float, float]]:
    """Start and stop of every copy in (T, n), and the start of its original [s]."""
    fresh = starts(values)
    if len(fresh) < 2 * FEWEST:
        return []
    ends = np.append(fresh[1:], len(time)) - 1
    values, time, until = values[fresh], time[fresh], time[ends]
    bits = _bits(values, ends - fresh)
    ordered = np.sort(bits)
    if not np.any(ordered[1:] == ordered[:-1]):
        return []  # as in nearly every recording
    order = np.argsort(bits, kind="stable")
    equal = bits[order[1:]] == bits[order[:-1]]
    before = np.full(len(bits), -1, dtype=np.intp)  # index of the last earlier equal sample, or -1
    before[order[1:][equal]] = order[:-1][equal]
    distance = np.where(before >= 0, np.arange(len(before)) - before, 0)
    edges = np.concatenate([[0], np.flatnonzero(np.diff(distance)) + 1, [len(distance)]])
    chosen = np.flatnonzero(distance[edges[:-1]] > 0)
    if not len(chosen):
        return []
    chance = 2.0 * np.log(len(values)) - np.log(1e-6)
    rarity = _rarity(values)
    result = []
    for i in chosen:
        first, last, far = int(edges[i]), int(edges[i + 1]) + FEWEST - 2, int(distance[edges[i]])
        if until[last] - time[first] < LEAST_TIME or (last - first) * rarity < chance:
            continue
        a, b = (first - far, last - far), (first, last)
        copy, original = (a, b) if _breaks(values, *a) > _breaks(values, *b) else (b, a)
        result.append((float(time[copy[0]]), float(until[copy[1]]), float(time[original[0]])))
    return result


def _bits(values: Float, held: NDArray[np.intp]) -> Bits:
    """Hash (T - 9,) of every ten rows, held (T,) samples longer. Unequal rows share one with probability 2^-64."""
    raw = np.ascontiguousarray(values + 0.0).view(np.uint64)  # -0.0 is 0.0
    count = len(values) - FEWEST + 1
    row = _mixed(held.astype(np.uint64), raw.T)
    return _mixed(np.zeros(count, dtype=np.uint64), [row[i : i + count] for i in range(FEWEST)])


def _mixed(result: Bits, parts: Iterable[Bits]) -> Bits:
    for part in parts:
        result = (result ^ part) * np.uint64(0x9E3779B97F4A7C15)
        result ^= result >> np.uint64(29)
    return result


def _rarity(values: Float) -> float:
    """-ln of the probability of two equal increments, for the least repetitive column of (T, n)."""
    found = []
    for column in values.T:
        counts = np.unique(np.diff(column), return_counts=True)[1]
        share = np.asarray(counts, dtype=float) / max(1, len(column) - 1)
        found.append(-float(np.log(max(float((share**2).sum()), 1e-300))))
    return max(found)


def _breaks(values: Float, first: int, last: int) -> float:
    """The largest step at a stretch's ends, relative to the typical step of each column."""
    typical = np.maximum(np.median(np.abs(np.diff(values, axis=0)), axis=0), 1e-12)
    ends = [np.abs(values[i + 1] - values[i]) / typical for i in (first - 1, last) if 0 <= i < len(values) - 1]
    return float(np.max(ends)) if ends else 0.0

"""Runs of equal labels."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Labels = NDArray[np.intp]


def starts_of_runs(labels: Labels) -> Labels:
    """Indices where runs begin, the first included."""
    return np.concatenate([[0], np.flatnonzero(np.diff(labels)) + 1]).astype(np.intp)


def without_short(labels: Labels, shortest: int) -> Labels:
    """Labels with runs under `shortest` windows given to their longer neighbour, the shortest first."""
    result = labels.copy()
    while True:
        starts = starts_of_runs(result)
        lengths = np.diff(np.append(starts, len(result)))
        if len(starts) == 1 or lengths.min() >= shortest:
            return result
        i = int(lengths.argmin())
        neighbours = [j for j in (i - 1, i + 1) if 0 <= j < len(starts)]
        chosen = max(neighbours, key=lambda j: int(lengths[j]))
        result[starts[i] : starts[i] + lengths[i]] = result[starts[chosen]]


def in_order(labels: list[Labels]) -> dict[int, int]:
    """New numbers for labels, by first appearance."""
    seen = list(dict.fromkeys(int(x) for each in labels for x in each))
    return {old: new for new, old in enumerate(seen)}

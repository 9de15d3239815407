r"""Baselines that learn nothing of where to look: a spiral and a random walk around the start.

Archimedean spiral: r = pitch t / 2 pi, walked at constant speed; with several layers, one after the other, each at its
own turn about the normal. Random walk: steps of one length in a random direction, drawn again where they would leave a
circle. The seed names both as what a search is compared with; pitch, step and reach are ours.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from skillframe.frames import Float, norm, unit

FINE = 2e-4  # m between the spiral's points


def spiral(dimensions: int, pitch: float, length: float, layers: Sequence[float] = (0.0,)) -> Float:
    """(n, k) places [m]: each layer takes its share of the length. A layer is an offset of the last coordinate."""
    share = length / len(layers)
    last = np.sqrt(4.0 * np.pi * share / pitch)  # the length up to angle t is p t^2 / 4 pi, but for the first turn
    angle = np.sqrt(np.linspace(0.0, last**2, max(round(share / FINE), 16)))
    flat = (pitch * angle / (2.0 * np.pi))[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    parts = []
    for layer in layers:
        part = np.zeros((len(flat), dimensions))
        part[:, :2] = flat[:, : min(2, dimensions)]
        if dimensions > 2:
            part[:, -1] = layer
        parts.append(part)
    return np.concatenate([np.zeros((1, dimensions)), *parts])


def random_walk(dimensions: int, step: float, reach: float, length: float, rng: np.random.Generator) -> Float:
    """(n, k) places [m] of a walk of at least `length`, never farther than `reach` from the start."""
    path = [np.zeros(dimensions)]
    while (len(path) - 1) * step < length:
        there = path[-1] + step * unit(rng.standard_normal(dimensions))
        if norm(there) <= reach:
            path.append(there)
    return np.array(path)

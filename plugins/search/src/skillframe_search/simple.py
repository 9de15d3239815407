r"""Baseline searches around the start: an Archimedean spiral and a random walk.

Spiral: r = pitch t / 2 pi at constant speed, layers at their own turn about the normal. Random walk: steps of one
length within a circle. A spiral with a radius returns reversed, each pass with 0.6 of the pitch and 0.8 of the speed,
at v = min(v_max, sqrt(a r)), slow enough for inner turns.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from skillframe.frames import Float, norm, unit

FINE = 2e-4  # m between points
FINER = 0.6  # of the pitch, each further pass


def spiral(dimensions: int, pitch: float, length: float, layers: Sequence[float] = (0.0,)) -> Float:
    """(n, k) places [m], where each layer offsets the last coordinate and takes its share of the length."""
    share = length / len(layers)
    last = np.sqrt(4.0 * np.pi * share / pitch)  # length up to angle t is p t^2 / 4 pi, except in the first turn
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


def there_and_back(
    pitch: float, radius: float, speed: float, acceleration: float, passes: int, step: float, inner: float = 0.0
) -> Float:
    """(n, 2) places [m] every `step` seconds: a spiral to a radius, and finer ones in and out again.

    If `inner` is not 0, that radius is covered out and in first.
    """
    parts = [np.zeros((1, 2))]
    # even, so that the wide ones begin in the middle
    for reach, count in ((inner, 2 if inner else 0), (radius, passes)):
        for k in range(count):
            way = _outwards(pitch * FINER**k, reach, speed * 0.8**k, acceleration, step)
            parts.append(way if k % 2 == 0 else way[::-1] @ _turned(way[-1], parts[-1][-1]))
    return np.concatenate(parts)


def _outwards(pitch: float, radius: float, speed: float, acceleration: float, step: float) -> Float:
    """(n, 2) places of a spiral from the middle to a radius, at the module's speed."""
    angle = np.linspace(0.0, 2.0 * np.pi * radius / pitch, max(round(np.pi * radius**2 / pitch / FINE), 64))
    r = pitch * angle / (2.0 * np.pi)
    rate = np.minimum(speed, np.sqrt(acceleration * np.maximum(r, pitch / (2.0 * np.pi))))
    along = np.hypot(pitch / (2.0 * np.pi), r) / rate  # seconds per radian
    time = np.concatenate([[0.0], np.cumsum(0.5 * (along[1:] + along[:-1]) * np.diff(angle))])
    at = np.interp(np.arange(0.0, time[-1], step), time, angle)
    places: Float = (pitch * at / (2.0 * np.pi))[:, None] * np.stack([np.cos(at), np.sin(at)], axis=1)
    return places


def _turned(from_: Float, to: Float) -> Float:
    """(2, 2) rotation of rows from the bearing of one place to that of another."""
    angle = np.arctan2(to[1], to[0]) - np.arctan2(from_[1], from_[0])
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, s], [-s, c]])


def random_walk(dimensions: int, step: float, reach: float, length: float, rng: np.random.Generator) -> Float:
    """(n, k) places [m] of a walk of at least `length`, within `reach` of the start."""
    path = [np.zeros(dimensions)]
    while (len(path) - 1) * step < length:
        there = path[-1] + step * unit(rng.standard_normal(dimensions))
        if norm(there) <= reach:
            path.append(there)
    return np.array(path)

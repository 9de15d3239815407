r"""Trajectory of a search: places, rates and the feedforward wrench.

    x_d(t) = x_0 + d(t),    R_d(t) = exp(r(t)) R_0,    F_ff(t) = - E[w | v(t)] F_push / E[w_n | v(t)]          eq. (1)

The model takes the *desired* rate, so nothing is fed back. A document and a number always give the same trajectory, in
a batch, alone and on a retry.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from skillframe.extend import Document
from skillframe.frames import Float, norm
from skillframe_search.contact import surface_axes
from skillframe_search.ergodic import ergodic
from skillframe_search.exploration import COORDINATES, CUT, LEVER
from skillframe_search.phase import Dither, Phase, read_phase
from skillframe_search.simple import random_walk, spiral, there_and_back
from skillframe_search.smoothing import SLACK, STEP_S, Motion, smoothed
from skillframe_search.tour import tour

NUMBERS = 256


class Plan(NamedTuple):
    """A trajectory on a grid of `STEP_S`, in the search frame.

    Attributes:
        place: (T, 6) displacement and rotation vector [m, rad].
        rate: (T, 6) constant until the next [m/s, rad/s].
        feedforward: (T, 6) wrench on the environment at the learning point [N, Nm].
        length: of the way along the surface [m].
    """

    place: Float
    rate: Float
    feedforward: Float
    length: float


@lru_cache(maxsize=2 * NUMBERS)
def plan(phase: _Hashed, number: int) -> Plan:
    """The trajectory of a number, 0 to 255."""
    settings = phase.phase
    motion, scale = _motion(settings, np.random.default_rng([21, number]))
    columns = [COORDINATES.index(name) for name in settings.searched]
    axes = surface_axes(np.array(settings.push.direction))
    full = np.zeros((5, 6))
    full[:2, :3], full[2:, 3:] = axes[:2], axes
    spread = full[columns] / scale[:, None]
    length = float(norm(np.diff(motion.place[:, : sum(c < 2 for c in columns)], axis=0)).sum())
    wrench = exerted(settings, motion.rate)
    wrench[:, 3:] += dithered(settings.dither, axes, len(wrench))
    return Plan(motion.place @ spread, motion.rate @ spread, wrench, length)


def dithered(dither: Dither, axes: Float, count: int) -> Float:
    """(count, 3) torque that rotates in the surface and about its normal, every `STEP_S` [Nm]."""
    time = np.arange(count) * STEP_S
    tilt, turn = 2.0 * np.pi * dither.tilt_hz * time, 2.0 * np.pi * dither.turn_hz * time
    rocking = dither.tilt_nm * np.stack([np.cos(tilt), np.sin(tilt)], axis=1) @ axes[:2]
    result: Float = rocking + dither.turn_nm * np.sin(turn)[:, None] * axes[2]
    return result


def exerted(phase: Phase, rate: Float) -> Float:
    """(T, 6) wrench to exert on the environment at rates (T, k) [m/s through the lever]."""
    push = np.array(phase.push.direction)
    if phase.forces is None:
        return np.tile(np.concatenate([phase.push.force * push, np.zeros(3)]), (len(rate), 1))
    wrench = -phase.forces.wrench(rate)
    along = wrench[:, :3] @ push
    largest = float(np.median(along)) if len(along) else phase.push.force
    # of the push: forces of a model that expects less are not scaled up further
    scale = phase.push.force / np.maximum(along, 0.3 * max(largest, 1e-9))
    result: Float = scale[:, None] * wrench
    result[:, :3] += (phase.push.force - result[:, :3] @ push)[:, None] * push
    return result


def _motion(phase: Phase, rng: np.random.Generator) -> tuple[Motion, Float]:
    """Motion (T, k) [m, m/s], and metres per unit of each coordinate (k,)."""
    path, time = phase.path, phase.stop.time_s
    if path.kind != "spiral" or not path.radius:
        places, scale = _places(phase, rng)
        return smoothed(places, path.speed, path.acceleration, time), scale
    flat = there_and_back(
        path.pitch, path.radius, path.speed, path.acceleration, path.passes, STEP_S, path.inner
    )  # fmt: skip
    flat = flat[: round(time / STEP_S) + 1]
    place = np.concatenate([flat, np.zeros((len(flat), len(phase.searched) - 2))], axis=1)
    rate = np.concatenate([np.diff(place, axis=0) / STEP_S, np.zeros((1, place.shape[1]))])
    return Motion(place, rate), np.ones(place.shape[1])


def _places(phase: Phase, rng: np.random.Generator) -> tuple[Float, Float]:
    """Polygon of places (n, k) [m], and metres per unit of each coordinate (k,)."""
    path, k = phase.path, len(phase.searched)
    length = path.speed / SLACK * phase.stop.time_s
    scale = np.array([LEVER if COORDINATES.index(name) >= 2 else 1.0 for name in phase.searched])
    if path.kind == "spiral":
        return spiral(k, path.pitch, length, [turn * LEVER for turn in path.layers]), scale
    if path.kind == "random_walk":
        return random_walk(k, path.step, path.reach, length, rng), scale
    assert phase.exploration is not None
    if path.kind == "ergodic":
        return ergodic(phase.exploration, path.speed / SLACK, phase.stop.time_s), scale
    return tour(phase.exploration, length, rng), scale


class _Hashed:
    """A phase hashed by its text for the cache."""

    def __init__(self, phase: Phase) -> None:
        self.phase, self._text = phase, repr(phase)

    def __hash__(self) -> int:
        return hash(self._text)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Hashed) and self._text == other._text


def keyed(phase: Phase) -> _Hashed:
    """The phase as `plan` takes it."""
    return _Hashed(phase)


def area(document: Document) -> Float:
    """(2, 3) corners of the reachable box against the start, in the search frame [m]."""
    phase = read_phase(document)
    axes = surface_axes(np.array(phase.push.direction))
    if phase.exploration is None:
        radius = phase.path.reach
        if phase.path.kind == "spiral":
            radius = phase.path.radius or float(
                np.sqrt(phase.path.speed * phase.stop.time_s * phase.path.pitch / np.pi)
            )
        middle, deviation = np.zeros(3), radius * np.sqrt((axes[:2] ** 2).sum(axis=0))
    else:
        rows = [axes[c] for c in phase.exploration.columns if c < 2]
        n = len(rows)
        across = np.array(rows).reshape(n, 3)
        middle = phase.exploration.center[:n] @ across
        spread = across.T @ phase.exploration.spread[:n, :n] @ across
        deviation = CUT * np.sqrt(np.maximum(np.diag(spread), 0.0))
    return np.stack([middle - deviation, middle + deviation])

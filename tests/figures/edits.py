"""Damage done to a sound recording on purpose, drawn by a seed, with what ought to be said of it.

Each edit takes a recording and a random generator and returns another recording and where the damage lies [s].
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from plugins.recordings.tests.test_lateness import late as shifted
from skillframe.demonstration.record import Demonstration
from skillframe.frames import Float, cross, norm, rotate, rotate_spatial


class Edited(NamedTuple):
    """A damaged recording, and where [s], or by how much."""

    demonstration: Demonstration
    start: float
    stop: float


Edit = Callable[[Demonstration, np.random.Generator], Edited]


def span(d: Demonstration, rng: np.random.Generator, low: float, high: float) -> tuple[int, int]:
    """First and last sample of a stretch of a drawn length, anywhere."""
    length = rng.uniform(low, min(high, 0.3 * d.duration))
    start = rng.uniform(d.time[0] + 0.2, d.time[-1] - length - 0.2)
    return int(np.searchsorted(d.time, start)), int(np.searchsorted(d.time, start + length)) - 1


def _of(d: Demonstration, rows: tuple[int, int], **changed: Float) -> Edited:
    return Edited(replace(d, **changed), float(d.time[rows[0]]), float(d.time[rows[1]]))  # type: ignore[arg-type]


def stall(d: Demonstration, rng: np.random.Generator) -> Edited:
    """The wrench repeats one value for 0.4 to 3 s."""
    a, b = span(d, rng, 0.4, 3.0)
    wrench = d.wrench.copy()
    wrench[a : b + 1] = wrench[a]
    return _of(d, (a, b), wrench=wrench)


def stall_of_a_channel(d: Demonstration, rng: np.random.Generator) -> Edited:
    """One channel repeats one value for 1.2 to 3 s."""
    a, b = span(d, rng, 1.2, 3.0)
    wrench = d.wrench.copy()
    i = rng.integers(6)
    wrench[a : b + 1, i] = wrench[a, i]
    return _of(d, (a, b), wrench=wrench)


def late(d: Demonstration, rng: np.random.Generator) -> Edited:
    """The wrench comes 0.05 to 0.5 s late or early."""
    seconds = rng.choice([-1.0, 1.0]) * rng.uniform(0.05, 0.5)
    return Edited(shifted(d, seconds), seconds, seconds)


def saturate(d: Demonstration, rng: np.random.Generator) -> Edited:
    """The range of the sensor ends at 0.4 to 0.9 of the largest force of a channel."""
    most = rng.uniform(0.4, 0.9) * np.abs(d.wrench[:, :3]).max()
    wrench = d.wrench.copy()
    wrench[:, :3] = np.clip(wrench[:, :3], -most, most)
    rows = np.flatnonzero(np.any(wrench != d.wrench, axis=1))
    return _of(d, (int(rows[0]), int(rows[-1])), wrench=wrench)


def _places(d: Demonstration, rng: np.random.Generator) -> tuple[int, int, int]:
    """Where 0.4 to 2 s are copied from, where to, and how many samples."""
    a, b = span(d, rng, 0.4, 2.0)
    count = b - a + 1
    while True:
        to = int(rng.integers(1, len(d) - count - 1))
        if abs(to - a) > count:
            return a, to, count


def paste(d: Demonstration, rng: np.random.Generator) -> Edited:
    """0.4 to 2 s of the wrench are pasted elsewhere."""
    a, to, count = _places(d, rng)
    wrench = d.wrench.copy()
    wrench[to : to + count] = d.wrench[a : a + count]
    return _of(d, (to, to + count - 1), wrench=wrench)


def paste_a_channel(d: Demonstration, rng: np.random.Generator) -> Edited:
    """0.4 to 2 s of one channel are pasted elsewhere."""
    a, to, count = _places(d, rng)
    i, wrench = rng.integers(6), d.wrench.copy()
    wrench[to : to + count, i] = d.wrench[a : a + count, i]
    return _of(d, (to, to + count - 1), wrench=wrench)


def paste_the_pose(d: Demonstration, rng: np.random.Generator) -> Edited:
    """0.4 to 2 s of the pose are pasted elsewhere, as positions and attitudes."""
    a, to, count = _places(d, rng)
    position, quaternion = d.position.copy(), d.quaternion.copy()
    position[to : to + count], quaternion[to : to + count] = d.position[a : a + count], d.quaternion[a : a + count]
    return _of(d, (to, to + count - 1), position=position, quaternion=quaternion)


def hold(d: Demonstration, rng: np.random.Generator) -> Edited:
    """The pose stands still for 0.3 to 1.5 s while the tool goes on, by 3 mm or more."""
    for _ in range(1000):
        a, b = span(d, rng, 0.3, 1.5)
        if norm(d.position[b + 1] - d.position[a]) > 3e-3:
            break
    position, quaternion = d.position.copy(), d.quaternion.copy()
    position[a : b + 1], quaternion[a : b + 1] = position[a], quaternion[a]
    return _of(d, (a, b), position=position, quaternion=quaternion)


def slow_pose(d: Demonstration, rng: np.random.Generator) -> Edited:
    """The pose of a recorder at 8 to 15 Hz is held between its samples."""
    stride = max(2, round(d.rate / rng.uniform(8.0, 15.0)))
    rows = np.arange(len(d)) // stride * stride
    return _of(d, (0, len(d) - 1), position=d.position[rows].copy(), quaternion=d.quaternion[rows].copy())


def jump(d: Demonstration, rng: np.random.Generator) -> Edited:
    """From one sample on the tool point is 10 to 60 mm elsewhere."""
    k = int(np.searchsorted(d.time, rng.uniform(d.time[0] + 0.2, d.time[-1] - 0.2)))
    position, way = d.position.copy(), rng.normal(size=3)
    position[k:] += rng.uniform(0.01, 0.06) * way / norm(way)
    return _of(d, (k - 1, k), position=position)


def step(d: Demonstration, rng: np.random.Generator) -> Edited:
    """The bias of a force channel steps by 1 to 5 N, for good or for 1 to 3 s."""
    a, b = span(d, rng, 1.0, 3.0)
    b = len(d) - 1 if rng.random() < 0.5 else b
    wrench = d.wrench.copy()
    wrench[a : b + 1, rng.integers(3)] += rng.choice([-1.0, 1.0]) * rng.uniform(1.0, 5.0)
    return _of(d, (a, b), wrench=wrench)


def weigh(d: Demonstration, rng: np.random.Generator) -> Edited:
    """A tool of 0.3 to 1.5 kg is left in the wrench, its centre of mass 20 to 80 mm off."""
    return Edited(replace(d, wrench=d.wrench + _weight(d, rng)), 0.0, 0.0)


def weigh_tared(d: Demonstration, rng: np.random.Generator) -> Edited:
    """The same, of a sensor that was tared in the first attitude: it reads nothing there."""
    weight = rotate_spatial(np.swapaxes(d.pose.rotation, -1, -2), _weight(d, rng))
    return Edited(replace(d, wrench=d.wrench + rotate_spatial(d.pose.rotation, weight - weight[0])), 0.0, 0.0)


def _weight(d: Demonstration, rng: np.random.Generator) -> Float:
    force = np.array([0.0, 0.0, -9.81 * rng.uniform(0.3, 1.5)])
    com = rotate(d.pose.rotation, np.array([0.0, 0.0, rng.uniform(0.02, 0.08)]))
    result: Float = np.concatenate([np.broadcast_to(force, com.shape), cross(com, force)], axis=1)
    return result


def quaternion_order(d: Demonstration, rng: np.random.Generator) -> Edited:
    """The quaternion is w-first and read w-last."""
    return Edited(replace(d, quaternion=d.quaternion[:, [3, 0, 1, 2]].copy()), 0.0, 0.0)


def frame(d: Demonstration, rng: np.random.Generator) -> Edited:
    """The wrench is in tool axes and read as in base axes, with a bias of 0.5 to 3 N a channel that nobody removed."""
    bias = np.concatenate([rng.uniform(0.5, 3.0, 3) * rng.choice([-1.0, 1.0], 3), np.zeros(3)])
    wrench = rotate_spatial(np.swapaxes(d.pose.rotation, -1, -2), d.wrench) + bias
    return Edited(replace(d, wrench=wrench), 0.0, 0.0)


def sign(d: Demonstration, rng: np.random.Generator) -> Edited:
    """The wrench is the tool's on the environment."""
    return Edited(replace(d, wrench=-d.wrench), 0.0, 0.0)

r"""Align demonstrations on one clock: dynamic time warping onto the one of median length.

States at 100 Hz are matched by the path of least total cost (Sakoe and Chiba 1978), the squared distance of (distance
to the own end, angle to the own end, |F|), each over its largest value. These features are equal from either side of a
task. The path is smoothed over 0.1 s against jerk.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from skillframe.demonstration import Demonstration
from skillframe.errors import InputError
from skillframe.frames import (
    Float,
    Pose,
    matrix_from_quaternion,
    move_wrench,
    norm,
    rotation_matrix,
    rotation_vector,
)
from skillframe_baselines.common import RATE, moving_average, resampled, state_of

SMOOTH = 0.1  # s


class Recorded(NamedTuple):
    """Demonstrations as states y relative to their common goal, at 100 Hz, each on its own clock.

    Attributes:
        goal: mean final pose of the learning point.
        time: per demonstration, (T,) from 0 [s].
        state: per demonstration, (T, 6).
        wrench: per demonstration, (T, 6) environment on tool at the learning point, base axes.
    """

    goal: Pose
    time: list[Float]
    state: list[Float]
    wrench: list[Float]


class Aligned(NamedTuple):
    """Demonstrations on one clock: time (T,), state and wrench (D, T, 6)."""

    goal: Pose
    time: Float
    state: Float
    wrench: Float


def common_goal(ends: Sequence[Pose]) -> Pose:
    """Mean of the demonstrations' final poses.

    Raises:
        InputError: they ended more than a right angle apart.
    """
    first = ends[0].rotation
    turns = np.stack([rotation_vector(end.rotation @ first.T) for end in ends])
    if norm(turns).max() > np.pi / 2:
        raise InputError("demonstrations", "end in orientations more than 90 degrees apart", "give those of one task")
    return Pose(np.mean([end.position for end in ends], axis=0), rotation_matrix(turns.mean(0)) @ first)


def recorded(demonstrations: Sequence[Demonstration], at: Float) -> Recorded:
    """States and wrenches of the learning point (3,), tool frame [m].

    Raises:
        InputError: demonstrations that end too far apart, or turn too far.
    """
    poses, wrenches, times = [], [], []
    for demonstration in demonstrations:
        sampled = {name: np.asarray(value) for name, value in resampled(demonstration).items()}
        tool = Pose(sampled["position"], matrix_from_quaternion(sampled["quaternion"]))
        pose = tool.at(at)
        poses.append(pose)
        wrenches.append(move_wrench(sampled["wrench"], pose.position - tool.position))
        times.append(sampled["time"])
    goal = common_goal([Pose(pose.position[-1], pose.rotation[-1]) for pose in poses])
    states = [moving_average(state_of(pose, goal), round(SMOOTH * RATE)) for pose in poses]
    largest_turn = 2.5  # rad from the goal's orientation, the limit of a rotation vector
    for demonstration, state in zip(demonstrations, states, strict=True):
        if norm(state[:, 3:]).max() > largest_turn:
            raise InputError(
                demonstration.source or "demonstration",
                f"turns by more than {np.rad2deg(largest_turn):.0f} degrees from its end",
                "cut it into phases, or use replay",
            )
    return Recorded(goal, times, states, wrenches)


def aligned(recordings: Recorded) -> Aligned:
    """All demonstrations warped onto the one of median length, over their mean duration."""
    order = np.argsort([len(state) for state in recordings.state], kind="stable")
    reference = int(order[len(order) // 2])
    rows = [
        np.stack([norm(s[:, :3] - s[-1, :3]), norm(s[:, 3:] - s[-1, 3:]), norm(w[:, :3])], axis=1)
        for s, w in zip(recordings.state, recordings.wrench, strict=True)
    ]
    floor = np.array([1e-3, 1e-2, 1.0])  # m, rad, N: less variation has no weight
    scale = np.maximum(np.max([row.max(0) for row in rows], axis=0), floor)
    features = [row / scale for row in rows]
    states, wrenches = [], []
    for i, (state, wrench) in enumerate(zip(recordings.state, recordings.wrench, strict=True)):
        index = np.arange(len(state), dtype=float)
        if i != reference:
            index = warp(features[reference], features[i])
        states.append(_at(state, index))
        wrenches.append(_at(wrench, index))
    duration = float(np.mean([time[-1] for time in recordings.time]))
    time = np.linspace(0.0, duration, len(recordings.state[reference]))
    return Aligned(recordings.goal, time, np.stack(states), np.stack(wrenches))


def _at(values: Float, index: Float) -> Float:
    samples = np.arange(len(values))
    return np.stack([np.interp(index, samples, column) for column in values.T], axis=1)


def warp(reference: Float, other: Float) -> Float:
    """Increasing fractional rows of `other` (T', d), 0 to T' - 1, that match the rows of `reference` (T, d)."""
    stride = round(RATE / 25.0)  # matched at 25 Hz, faster than a teacher's pace changes
    i, j = _sparse(len(reference), stride), _sparse(len(other), stride)
    path = np.array(_path(((reference[i][:, None] - other[j][None]) ** 2).sum(-1)))
    matched = np.array([j[path[path[:, 0] == row, 1]].mean() for row in range(len(i))])
    index = np.interp(np.arange(len(reference)), i, matched)
    smooth = moving_average(index[:, None], round(SMOOTH * RATE))[:, 0]
    smooth[0], smooth[-1] = 0.0, len(other) - 1.0
    result: Float = np.maximum.accumulate(np.clip(smooth, 0.0, len(other) - 1.0))
    return result


def _sparse(count: int, stride: int) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    return np.unique(np.append(np.arange(0, count, stride), count - 1))


def _path(cost: Float) -> list[tuple[int, int]]:
    rows, columns = cost.shape
    total = np.full((rows + 1, columns + 1), np.inf)
    total[0, 0] = 0.0
    for i in range(rows):
        above, here, line = total[i].tolist(), total[i + 1], cost[i].tolist()
        left = np.inf
        for j in range(columns):
            left = line[j] + min(left, above[j], above[j + 1])
            here[j + 1] = left
    path, (i, j) = [], (rows, columns)
    while i > 0 and j > 0:
        path.append((i - 1, j - 1))
        i, j = min(((i - 1, j - 1), (i - 1, j), (i, j - 1)), key=lambda cell: total[cell])
    return path[::-1]

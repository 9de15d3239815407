r"""Motion that goes round and round, as a wipe, which no linear motion with compliance explains.

Contact lets a phase move by M d with M positive semidefinite, so it never opposes its desired direction:

    d . v = d^T M d >= 0,   hence   d . (x_j - x_i) = sum d . v h > 0        for all that moves along d at all.

Windows i to j are a round if the tool

    comes back:            |x_j - x_i| < path / 4, in base and in the tool's axes, which a crank turns along,
    goes round something:  4 pi area > 0.3 path^2 (of a circle 1, of a square 0.8, of there and back 0),
    turns all the time:    at least half of its windows turn by more than half of the mean, 2 pi / (j - i),
    moves, and widely:     |u| > 1/2 in nine windows of ten, and 2 area / path, a circle's radius, is over 5 mm.

Only the tightest rounds count, joined to stretches of time of at least a quarter of the longest; most demonstrations
must have one.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float, dot, norm, unit
from skillframe_segmenter.features import Features
from skillframe_segmenter.settings import WINDOW_S
from skillframe_segmenter.windows import Windows

Mask = NDArray[np.bool_]


def rounds(cut: Sequence[Windows], seen: Sequence[Features]) -> list[Mask] | None:
    """Windows of each demonstration that go round, or None if that is no phase."""
    found = [going_round(w, f) for w, f in zip(cut, seen, strict=True)]
    return found if 2 * sum(bool(each.any()) for each in found) > len(found) else None


def going_round(cut: Windows, seen: Features) -> Mask:
    """Windows (W,) of a demonstration in a round."""
    step = WINDOW_S * cut.motion[:, :3]
    turn = _turning(unit(step))
    path = _Path(step, np.einsum("tji,tj->ti", cut.rotation, step), norm(seen.motion[:, :3]) > 0.5)
    result, count = np.zeros(cut.size, dtype=bool), cut.size
    first_end = np.full(count + 1, 2 * count)  # of the rounds that begin here or later
    length, longest = 6, min(400, count)  # windows
    while length <= longest:
        starts = path.comes_back(length)
        starts, axis = path.loops(starts[first_end[starts] > starts + length], length)
        if len(starts):
            inside = starts[:, None] + np.arange(length - 1)
            steady = dot(turn[inside], axis[:, None]) > np.pi / length
            for i in starts[steady.mean(axis=1) >= 0.5].tolist():
                result[i : i + length] = True
                first_end[: i + 1] = np.minimum(first_end[: i + 1], i + length)
        length = longest + 1 if length == longest else min(longest, length + max(1, length // 20))
    edges = np.flatnonzero(np.diff(np.concatenate([[0], result.astype(np.intp), [0]])))
    begins, stops = edges[::2], edges[1::2]
    for begin, stop in zip(begins.tolist(), stops.tolist(), strict=True):
        result[begin:stop] = stop - begin >= 0.25 * (stops - begins).max()  # of the longest stretch
    return result


class _Path:
    """A path as running sums, which give any stretch quickly."""

    def __init__(self, step: Float, step_of_tool: Float, moving: Mask) -> None:
        """Steps (W, 3) in base axes, the same in the tool's, and whether it moves (W,)."""
        self._place, self._place_of_tool = _running(step), _running(step_of_tool)
        self._area = _running(0.5 * np.cross(self._place[:-1], step))
        self._length = _running(norm(step))
        self._moving = _running(moving.astype(float))
        self._axes = np.ascontiguousarray(self._place.T), np.ascontiguousarray(self._place_of_tool.T)

    def comes_back(self, length: int) -> NDArray[np.intp]:
        """Starts of stretches of `length` windows that end near where they began."""
        near = 0.25 * (self._length[length:] - self._length[:-length])
        back = [sum((x[length:] - x[:-length]) ** 2 for x in axes) for axes in self._axes]
        return np.flatnonzero(np.maximum(*back) < near * near)

    def loops(self, starts: NDArray[np.intp], length: int) -> tuple[NDArray[np.intp], Float]:
        """Those that go round widely, and their axis (S, 3)."""
        back, area, path, moving = (
            x[starts + length] - x[starts] for x in (self._place, self._area, self._length, self._moving)
        )
        area = area - 0.5 * np.cross(self._place[starts], back)
        size = norm(area)
        fine = (2.0 * size > 0.005 * path) & (4.0 * np.pi * size > 0.3 * path * path) & (moving >= 0.9 * length)
        return starts[fine], area[fine] / size[fine, None]


def _running(x: Float) -> Float:
    return np.concatenate([np.zeros((1, *x.shape[1:])), np.cumsum(x, axis=0)])


def _turning(direction: Float) -> Float:
    """(W - 1, 3) rotation vectors from each direction (W, 3) to the next."""
    one, two = direction[:-1], direction[1:]
    axis = np.cross(one, two)
    size = norm(axis)
    angle = np.arctan2(size, dot(one, two))
    result: Float = axis * (angle / np.maximum(size, 1e-12))[:, None]
    return result

r"""Cut a recording into windows of 50 ms: mean velocity, angular velocity, force and torque.

    v_i = (p_{i+1} - p_i) / h,    w_i = log(R_{i+1} R_i^T) / h,    F_i, T_i = mean over the window

where \(p_i, R_i\) are means over half a window on both sides of edge i. Positions are relative to the first one and
rounded to 10 nm, so that the task's place has no effect. Windows of 10 ms follow noise, of 100 ms lose short phases.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.demonstration import Demonstration, resolve_point
from skillframe.document import common_frames
from skillframe.errors import InputError
from skillframe.frames import (
    Float,
    Pose,
    continuous,
    matrix_from_quaternion,
    move_wrench,
    norm,
    rotate,
    rotation_vector,
)
from skillframe_segmenter.settings import WINDOW_S


class Windows(NamedTuple):
    """A demonstration in W windows.

    Attributes:
        start: time of the first edge [s]; edge i lies at start + i h.
        motion: (W, 6) velocity and angular velocity [m/s, rad/s].
        wrench: (W, 6) mean wrench of the environment on the tool [N, Nm].
        position: (W, 3) of the point [m], for the pose-driven baseline.
        rotation: (W, 3, 3) orientation, likewise.
    """

    start: float
    motion: Float
    wrench: Float
    position: Float
    rotation: Float

    @property
    def size(self) -> int:
        """Number of windows."""
        return len(self.motion)

    def edges(self, indices: Sequence[int]) -> list[float]:
        """Times of edges [s]."""
        return [self.start + i * WINDOW_S for i in indices]


def windows(demonstration: Demonstration, at: Float, axes: str) -> Windows:
    """The windows of a demonstration.

    Args:
        demonstration: as read.
        at: (3,) observed point of the tool frame.
        axes: "base", or "phase_start": the tool's orientation at the start of the demonstration.

    Raises:
        InputError: values that are not finite, or a recording too short to have phases.
    """
    where = demonstration.source or "demonstration"
    relative = np.round((demonstration.position - demonstration.position[0]) / 1e-8) * 1e-8  # to 10 nm
    pose = Pose(relative, matrix_from_quaternion(demonstration.quaternion))
    point = pose.at(at)
    wrench = move_wrench(demonstration.wrench, rotate(pose.rotation, np.broadcast_to(at, point.position.shape)))
    values = np.column_stack([point.position, continuous(demonstration.quaternion), wrench])
    if not np.all(np.isfinite(values)):
        raise InputError(where, "holds values that are not finite", "run skillframe check on it")
    elapsed = demonstration.time - demonstration.time[0]
    count = int(np.floor(elapsed[-1] / WINDOW_S + 1e-6))
    if count < 8:
        raise InputError(
            where, f"is only {demonstration.duration:.2f} s long, too short to have phases", "record more of the motion"
        )
    cut = _cut(elapsed, values, count, float(demonstration.time[0]), pose.rotation[0], axes)
    return cut._replace(position=cut.position + demonstration.position[0])


def _cut(elapsed: Float, values: Float, count: int, start: float, first: Float, axes: str) -> Windows:
    at_edges = _bin_means(np.rint(elapsed / WINDOW_S), values[:, :7], count + 1)
    rotation = matrix_from_quaternion(at_edges[:, 3:7] / norm(at_edges[:, 3:7])[:, None])
    velocity = np.diff(at_edges[:, :3], axis=0) / WINDOW_S
    turning = rotation_vector(rotation[1:] @ np.swapaxes(rotation[:-1], -1, -2)) / WINDOW_S
    wrench = _bin_means(np.floor(elapsed / WINDOW_S + 1e-6), values[:, 7:], count)
    parts = [velocity, turning, wrench[:, :3], wrench[:, 3:]]
    if axes == "phase_start":
        parts = [part @ first for part in parts]
    middle = 0.5 * (at_edges[1:, :3] + at_edges[:-1, :3])
    return Windows(start, np.hstack(parts[:2]), np.hstack(parts[2:]), middle, rotation[1:])


def _bin_means(index: Float, values: Float, count: int) -> Float:
    """Means of the samples in each of `count` bins, empty ones interpolated."""
    kept = (index >= 0) & (index < count)
    chosen: NDArray[np.intp] = index[kept].astype(np.intp)
    starts = np.concatenate([[0], np.flatnonzero(np.diff(chosen)) + 1])
    sizes = np.diff(np.append(starts, len(chosen)))
    means = np.add.reduceat(values[kept], starts, axis=0) / sizes[:, None]
    bins = chosen[starts]
    if len(bins) == count:
        return means
    every = np.arange(count)
    return np.column_stack([np.interp(every, bins, column) for column in means.T])


def cut_all(demonstrations: Sequence[Demonstration], at: str | None, axes: str) -> tuple[list[Windows], Float]:
    """Windows of all demonstrations, and the observed point of the tool frame (3,).

    Raises:
        InputError: no demonstration, demonstrations of different tools, or one that cannot be cut.
        UnknownName: the point is no frame of the tool.
    """
    point = resolve_point(at, common_frames(demonstrations))
    return [windows(d, point, axes) for d in demonstrations], point

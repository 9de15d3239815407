r"""Contact, motion and forces of blind demonstrations in a common frame.

The **search frame** is aligned at the starts: x_k - x_0 in base axes, or R_0^T (x_k - x_0) in the tool's axes at the
start. Samples are means over bins of 40 ms, longer than sensor noise and shorter than a dwell.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.demonstration import Demonstration
from skillframe.errors import InputError
from skillframe.frames import Float, cross, move_wrench, norm, rotate, rotate_spatial, rotation_vector, unit

BIN_S = 0.04


class Samples(NamedTuple):
    """Bins of one demonstration, or of all, in the search frame at the learning point.

    Attributes:
        place: (n, 6) displacement and rotation vector since the start [m, rad].
        rate: (n, 6) their rates [m/s, rad/s].
        wrench: (n, 6) of the environment on the tool [N, Nm].
    """

    place: Float
    rate: Float
    wrench: Float

    def rows(self, keep: NDArray[np.bool_]) -> Samples:
        """The selected bins."""
        return Samples(self.place[keep], self.rate[keep], self.wrench[keep])


def samples(demonstration: Demonstration, at: Float, in_start_orientation: bool) -> Samples:
    """All of a demonstration in bins.

    Raises:
        InputError: shorter than ten bins.
    """
    pose = demonstration.pose.at(at)
    turned = pose.rotation @ pose.rotation[0].T
    place = np.concatenate([pose.position - pose.position[0], rotation_vector(turned)], axis=1)
    wrench = move_wrench(demonstration.wrench, rotate(demonstration.pose.rotation, at))
    if in_start_orientation:
        back = np.broadcast_to(pose.rotation[0].T, (len(place), 3, 3))
        place, wrench = rotate_spatial(back, place), rotate_spatial(back, wrench)
    index = ((demonstration.time - demonstration.time[0]) / BIN_S).astype(int)
    count = int(index[-1])
    if count < 10:
        raise InputError(
            demonstration.source or "demonstration", "is too short to learn a search from", "record longer"
        )
    place, wrench = (_means(values, index, count) for values in (place, wrench))
    return Samples(place, np.gradient(place, BIN_S, axis=0), wrench)


def _means(values: Float, index: NDArray[np.int64], count: int) -> Float:
    keep = index < count
    number = np.bincount(index[keep], minlength=count)
    total = np.stack([np.bincount(index[keep], column[keep], count) for column in values.T], axis=1)
    full = number > 0
    grid = np.arange(count)
    return np.stack([np.interp(grid, grid[full], c[full] / number[full]) for c in total.T], axis=1)


def push_direction(demonstrations: Sequence[Samples], least: float) -> Float:
    """(3,) unit vector of the teacher's push, opposite to the mean contact force, in which friction averages out.

    Raises:
        InputError: no force above `least` [N].
    """
    forces = np.concatenate([s.wrench[:, :3] for s in demonstrations])
    felt = forces[norm(forces) > least]
    if len(felt) < 10 or norm(felt.mean(axis=0)) < 0.5 * least:
        largest = float(norm(forces).max())
        raise InputError(
            "search", f"the demonstrations never press on a surface (largest force {largest:.1f} N)",
            "record searches in contact, or check the sign of the wrench",
        )  # fmt: skip
    return -unit(felt.mean(axis=0))


def in_contact(found: Samples, push: Float, least: float) -> Samples:
    """Bins in contact, up to shortly before the tool falls in."""
    pressed = -(found.wrench[:, :3] @ push) > least
    depth = found.place[:, :3] @ push
    if pressed.any():
        fallen = np.flatnonzero(depth > np.median(depth[pressed]) + 0.002)  # 2 mm below the surface is in the hole
        if len(fallen):
            pressed[max(int(fallen[0]) - round(0.2 / BIN_S), 0) :] = False  # 0.2 s before that are cut, too
    return found.rows(pressed)


def surface_axes(push: Float) -> Float:
    """(3, 3) rows: two axes along the surface, the first nearest to the search frame's x, and the normal."""
    seed = np.eye(3)[0 if abs(push[0]) < 0.9 else 1]
    first = unit(seed - (seed @ push) * push)
    return np.stack([first, cross(-push, first), -push])

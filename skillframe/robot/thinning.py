"""Meshes of very many triangles as few points that span nearly the same hull. Our choice.

Of each cell of a grid of 1/400 of the mesh's size one corner is kept, so that the time that a mesh takes is that of
reading it. Of those a coarse grid keeps some thousand, and besides the farthest along each of 500 directions, which lie
on the hull. So the hull is right to about a cell, 1 mm for a link of 0.4 m.
"""

from __future__ import annotations

import numpy as np

from skillframe.frames import Float

FINE, MOST, DIRECTIONS = 400, 5000, 500
"""Cells along the largest extent, points that are kept besides the farthest ones, directions of those."""


def thinned(points: Float) -> Float:
    """Some of many points (P, 3): at most `MOST` spread over all of them, and the farthest along many directions."""
    size = float(np.ptp(points, axis=0).max())
    if not size > 0.0:
        return points[:1]
    fine = one_per_cell(points, size / FINE)
    spread, cell = fine, size / FINE
    while len(spread) > MOST:
        cell *= 1.5
        spread = one_per_cell(fine, cell)
    farthest = fine[np.unique([np.argmax(fine @ way) for way in _directions()])]  # at once it would take a gigabyte
    return np.unique(np.concatenate([spread, farthest]), axis=0)


def one_per_cell(points: Float, cell: float) -> Float:
    """The first of the points (P, 3) in each cell of a cubic grid."""
    index = np.floor((points - points.min(axis=0)) / cell).astype(np.int64)
    side = index.max(axis=0) + 1
    _, first = np.unique((index[:, 0] * side[1] + index[:, 1]) * side[2] + index[:, 2], return_index=True)
    return np.asarray(points[np.sort(first)])


def _directions() -> Float:
    """(D, 3) unit vectors spread evenly over the sphere: a Fibonacci lattice."""
    k = np.arange(DIRECTIONS)
    z = 1.0 - (2.0 * k + 1.0) / DIRECTIONS
    turn = k * np.pi * (3.0 - np.sqrt(5.0))
    around = np.sqrt(1.0 - z**2)
    return np.stack([around * np.cos(turn), around * np.sin(turn), z], axis=-1)

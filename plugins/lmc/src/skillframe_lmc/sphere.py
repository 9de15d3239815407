"""Cells of equal area on the unit sphere, in levels where each cell has four children.

The octahedral equal-area map (Clarberg 2008) takes the square [-1, 1]^2 to the sphere: with d = 1 - |u| - |v|, r = 1 -
|d| and phi = pi/4 ((|v| - |u|)/r + 1), a point has z = sign(d) (1 - r^2) and lies at r sqrt(2 - r^2) from the axis.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float

Cells = NDArray[np.int64]


def solid_angle(resolution: int) -> float:
    """Area of one cell of a resolution x resolution level [sr]."""
    return float(4.0 * np.pi / resolution**2)


@lru_cache(maxsize=4)
def whole(resolution: int) -> tuple[Cells, Float]:
    """All cells of a level: indices (C, 2) and unit vectors of their centres (C, 3)."""
    index = np.indices((resolution, resolution)).reshape(2, -1).T
    return index, centres(index, resolution)


def children(cells: Cells) -> Cells:
    """The four children (4 C, 2) of cells (C, 2), at twice the resolution."""
    offsets = np.array([[0, 0], [0, 1], [1, 0], [1, 1]])
    result: Cells = (2 * cells[:, None, :] + offsets).reshape(-1, 2)
    return result


def centres(cells: Cells, resolution: int) -> Float:
    """Unit vectors (C, 3) of the centres of cells (C, 2)."""
    uv = (cells + 0.5) * (2.0 / resolution) - 1.0
    size = np.abs(uv)
    outside = 1.0 - size.sum(-1)
    radius = 1.0 - np.abs(outside)
    angle = 0.25 * np.pi * ((size[:, 1] - size[:, 0]) / np.where(radius > 0.0, radius, 1.0) + 1.0)
    planar = radius * np.sqrt(2.0 - radius**2)
    z = np.copysign(1.0 - radius**2, outside)
    return np.column_stack(
        [np.copysign(planar * np.cos(angle), uv[:, 0]), np.copysign(planar * np.sin(angle), uv[:, 1]), z]
    )

"""A part of any shape prepared for contact: its signed distance on a grid, its points, and how exact both are.

The grid's cells are as small as three million of them allow, and not below 0.12 mm: a fine grid where the two parts can
meet, and a coarse one of the whole part. How exact it is is measured, not assumed: distance as contacts see it against
that of every triangle, at points near the surface, most of them near edges. Where the two take a point for inside and
outside, the winding number decides: normals of edges at which more than two triangles meet do not tell,

    w(p) = sum of the triangles' solid angles at p / 4 pi,    inside where |w| > 1/2  (Jacobson et al., TOG 32(4), 2013)

which is -1 in a lobe of a surface that crosses itself.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from skillframe.frames import Float, cross, norm
from skillframe.parts.points import points_of
from skillframe.parts.solid import arrays_of
from skillframe.world.surfaces import DistanceGrid, Surface, Triangles, exact_distances, grid_of, triangles_of

LEAST_CELL, MOST_NODES = 1.2e-4, 3e6
_COARSE_NODES = 2e5
_MARGIN = 4.37  # cells around the part, as narrow_phase.c knows; no node is to lie on a face
_APART = 0.8  # of the spacing of points
_LOOKED_AT, _NEAR = 3000, 1e-4  # points, and how far from the surface [m]


def surface_of(solid: Any, low: Float, high: Float) -> Surface:
    """A solid's surface, in its own frame, dense within the box in which the other part can come."""
    vertices, faces = arrays_of(solid)
    triangles = triangles_of(vertices, faces)
    least, most = vertices.min(axis=0), vertices.max(axis=0)
    inner = np.maximum(low, least), np.minimum(high, most)
    grids = [_grid(triangles, *inner, MOST_NODES)]
    if not (np.isclose(inner[0], least, atol=1e-9) & np.isclose(inner[1], most, atol=1e-9)).all():
        grids.append(_grid(triangles, least, most, _COARSE_NODES))
    found = points_of(vertices, faces, low, high)
    return Surface(
        triangles=triangles, grids=tuple(grids), points=found.points, first=found.first, balls=found.balls,
        group=found.group, around=found.around, apart=_APART * found.spacing, turn=np.eye(3), shift=np.zeros(3),
    )  # fmt: skip


def _grid(triangles: Triangles, low: Float, high: Float, nodes: float) -> DistanceGrid:
    cell = max(LEAST_CELL, float(np.prod(high - low + 8.0 * LEAST_CELL) / nodes) ** (1.0 / 3.0))
    margin = _MARGIN * cell
    return grid_of(triangles, low - margin, high + margin, cell)


def error_of(surface: Surface, low: Float, high: Float) -> float:
    """Largest difference of a surface's distance from the exact one [m], within a box, where either sees contact."""
    points = surface.points[((surface.points > low) & (surface.points < high)).all(axis=1)]
    if not len(points):
        return 0.0
    draw = np.random.default_rng(0)
    some = points[draw.integers(len(points), size=_LOOKED_AT)]
    points = some + draw.uniform(-_NEAR, _NEAR, some.shape)
    exact, seen = exact_distances(surface.triangles, points), surface.look_up(points)
    for i in np.flatnonzero((exact < 0.0) != (seen < 0.0)).tolist():
        exact[i] = abs(exact[i]) * (-1.0 if abs(winding_number(surface.triangles, points[i])) > 0.5 else 1.0)
    touches = (np.minimum(exact, seen) < 0.0) & (np.abs(exact) < _NEAR)
    return float(np.abs(seen - exact)[touches].max(initial=0.0))


def winding_number(triangles: Triangles, point: Float) -> float:
    """How often a closed mesh goes round a point (3,): 1 inside, 0 outside.

    Solid angles are those of A. van Oosterom and J. Strackee, IEEE TBME 30(2), 1983.
    """
    a, b, c = (triangles.corners[:, k] - point for k in range(3))
    one, two, three = norm(a), norm(b), norm(c)
    up = (a * cross(b, c)).sum(axis=1)
    over = one * two * three + (a * b).sum(axis=1) * three + (b * c).sum(axis=1) * one + (c * a).sum(axis=1) * two
    return float(np.arctan2(up, over).sum() / (2.0 * np.pi))


def memory_of(surface: Surface) -> int:
    """Bytes that a surface takes."""
    of_grid = ("value", "gap", "listed", "before", "start", "triangle")
    grids = [getattr(grid, name) for grid in surface.grids for name in of_grid]
    own = [surface.points, surface.balls, surface.triangles.corners, surface.triangles.normals]
    return sum(array.nbytes for array in (*grids, *own))

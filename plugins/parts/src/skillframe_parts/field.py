"""Contact surface of a part of any shape: signed distance on grids, sample points, and their measured error.

Cells are as small as three million nodes allow, at least 0.12 mm, and coarse where the parts cannot meet. The error is
measured against exact distances near the surface. Where both disagree on inside and outside, the winding number
decides, because normals are ambiguous at edges of more than two triangles:

    w(p) = sum of the triangles' solid angles at p / 4 pi,    inside where |w| > 1/2  (Jacobson et al., TOG 32(4), 2013)

Sample points lie on edges, which touch first, and on faces, denser where the other part can come. Edges between faces
that turn by more than 20 degrees get a point every half spacing, faces one per cube of the spacing. Blocks of points,
and groups of blocks, have bounding balls.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float, cross, norm
from skillframe.world import DistanceGrid, Surface, Triangles, exact_distances, grid_of, triangles_of
from skillframe_parts.solid import Faces, arrays_of

MOST_NODES, _COARSE_NODES = 3e6, 2e5
"""Nodes of the grid where the parts can meet, and of the one around a whole part."""


def surface_of(solid: Any, low: Float, high: Float) -> Surface:
    """A solid's surface in its own frame, dense within the box that the other part can reach."""
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
        group=found.group, around=found.around, apart=0.8 * found.spacing, turn=np.eye(3), shift=np.zeros(3),
    )  # fmt: skip


def _grid(triangles: Triangles, low: Float, high: Float, nodes: float) -> DistanceGrid:
    least = 1.2e-4  # m
    cell = max(least, float(np.prod(high - low + 8.0 * least) / nodes) ** (1.0 / 3.0))
    margin = 4.37 * cell  # as in narrow_phase.c; keeps nodes off faces
    return grid_of(triangles, low - margin, high + margin, cell)


def error_of(surface: Surface, low: Float, high: Float) -> float:
    """Largest error of a surface's distance [m], within a box, where it or the exact one shows contact."""
    points = surface.points[((surface.points > low) & (surface.points < high)).all(axis=1)]
    if not len(points):
        return 0.0
    draw, near = np.random.default_rng(0), 1e-4  # m from the surface
    some = points[draw.integers(len(points), size=3000)]
    points = some + draw.uniform(-near, near, some.shape)
    exact, seen = exact_distances(surface.triangles, points), surface.look_up(points)
    for i in np.flatnonzero((exact < 0.0) != (seen < 0.0)).tolist():
        exact[i] = abs(exact[i]) * (-1.0 if abs(winding_number(surface.triangles, points[i])) > 0.5 else 1.0)
    touches = (np.minimum(exact, seen) < 0.0) & (np.abs(exact) < near)
    return float(np.abs(seen - exact)[touches].max(initial=0.0))


def winding_number(triangles: Triangles, point: Float) -> float:
    """Winding number of a closed mesh about a point (3,): 1 inside, 0 outside.

    Solid angles are those of A. van Oosterom and J. Strackee, IEEE TBME 30(2), 1983.
    """
    a, b, c = (triangles.corners[:, k] - point for k in range(3))
    one, two, three = norm(a), norm(b), norm(c)
    up = (a * cross(b, c)).sum(axis=1)
    over = one * two * three + (a * b).sum(axis=1) * three + (b * c).sum(axis=1) * one + (c * a).sum(axis=1) * two
    return float(np.arctan2(up, over).sum() / (2.0 * np.pi))


def memory_of(surface: Surface) -> int:
    """Memory of a surface [bytes]."""
    of_grid = ("value", "gap", "listed", "before", "start", "triangle")
    grids = [getattr(grid, name) for grid in surface.grids for name in of_grid]
    own = [surface.points, surface.balls, surface.triangles.corners, surface.triangles.normals]
    return sum(array.nbytes for array in (*grids, *own))


class SurfacePoints(NamedTuple):
    """Points (P, 3) [m] and their `spacing` [m].

    Blocks begin at `first` (B + 1,) and lie in `balls` (B, 4), centre and radius. Groups of blocks begin at `group` (G
    + 1,) and lie in the balls `around` (G, 4).
    """

    points: Float
    first: NDArray[np.int64]
    balls: Float
    group: NDArray[np.int64]
    around: Float
    spacing: float


def points_of(vertices: Float, faces: Faces, low: Float, high: Float) -> SurfacePoints:
    """Points on a closed mesh (V, 3), (F, 3), dense within a box."""
    middle = vertices[faces].mean(axis=1)
    inside = ((middle > low) & (middle < high)).all(axis=1)
    area = 0.5 * norm(
        cross(vertices[faces[:, 1]] - vertices[faces[:, 0]], vertices[faces[:, 2]] - vertices[faces[:, 0]])
    )
    near_area = float(area[inside].sum()) if inside.any() else float(area.sum())
    spacing = float(np.clip(np.sqrt(near_area / 1500), 4e-4, 2e-3))  # for some 1500 points; m
    edges = _on_edges(vertices, faces, spacing)
    found = np.concatenate([edges, _on_faces(vertices, faces, area, spacing)])
    near = ((found > low) & (found < high)).all(axis=1)
    on_edge, sparse = np.arange(len(found)) < len(edges), 4.0 * spacing  # outside the other part's reach
    kept = np.concatenate([
        _thinned(found, near & on_edge, 0.5 * spacing), _thinned(found, near & ~on_edge, spacing),
        _thinned(found, ~near & on_edge, 0.5 * sparse), _thinned(found, ~near & ~on_edge, sparse),
    ])  # fmt: skip
    points = found[kept]
    place = np.floor(points / (4.0 * spacing)).astype(np.int64)
    wide = place // 3  # blocks along each side of a group
    order = np.lexsort((*place.T[::-1], *wide.T[::-1]))  # by groups, then blocks
    points = np.ascontiguousarray(points[order])
    first, of_group = _begins(place[order]), _begins(wide[order])
    group = np.searchsorted(first, of_group).astype(np.int64)
    return SurfacePoints(points, first, _balls(points, first), group, _balls(points, of_group), spacing)


def _on_edges(vertices: Float, faces: Faces, spacing: float) -> Float:
    """Corners first, so that they are kept, then points along edges."""
    raw = cross(vertices[faces[:, 1]] - vertices[faces[:, 0]], vertices[faces[:, 2]] - vertices[faces[:, 0]])
    normal = raw / np.maximum(norm(raw), 1e-300)[:, None]
    ends = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)
    order = np.lexsort((ends[:, 1], ends[:, 0]))
    pairs = order.reshape(-1, 2)  # two triangles per edge of a closed mesh
    sharp = (normal[pairs[:, 0] // 3] * normal[pairs[:, 1] // 3]).sum(axis=1) < np.cos(np.radians(20.0))
    edges = vertices[ends[pairs[sharp, 0]]]
    if not len(edges):
        return np.zeros((0, 3))
    count = np.ceil(norm(edges[:, 1] - edges[:, 0]) / (0.5 * spacing)).astype(int)
    which = np.repeat(np.arange(len(edges)), count)
    along = (np.arange(len(which)) - np.repeat(np.cumsum(count) - count, count)) / count[which]
    between = edges[which, 0] + along[:, None] * (edges[which, 1] - edges[which, 0])
    return np.concatenate([edges.reshape(-1, 3), between[along > 0.0]])


def _on_faces(vertices: Float, faces: Faces, area: Float, spacing: float) -> Float:
    """Eight candidates for each point, by M. Roberts' sequence R2: x_n = n / p, y_n = n / p^2, modulo 1."""
    count, plastic = int(8.0 * area.sum() / spacing**2), 1.324717957244746
    place = (np.arange(count) + 0.5) * (area.sum() / count)
    face = np.minimum(np.searchsorted(np.cumsum(area), place), len(faces) - 1)
    a, b = (np.arange(count)[:, None] / np.array([plastic, plastic**2]) % 1.0).T
    a, b = np.where(a + b > 1.0, 1.0 - a, a)[:, None], np.where(a + b > 1.0, 1.0 - b, b)[:, None]
    p, q, r = (vertices[faces[face, k]] for k in range(3))
    found: Float = p + a * (q - p) + b * (r - p)
    return found


def _thinned(points: Float, chosen: NDArray[np.bool_], size: float) -> NDArray[np.int64]:
    index = np.flatnonzero(chosen)
    _, first = np.unique(np.floor(points[index] / size).astype(np.int64), axis=0, return_index=True)
    return index[np.sort(first)]


def _begins(places: NDArray[np.int64]) -> NDArray[np.int64]:
    change = (places[1:] != places[:-1]).any(axis=1)
    return np.concatenate([[0], 1 + np.flatnonzero(change), [len(places)]]).astype(np.int64)


def _balls(points: Float, first: NDArray[np.int64]) -> Float:
    """Balls (B, 4), centre and radius, around points that begin at first (B + 1,)."""
    low, high = (f.reduceat(points, first[:-1], axis=0) for f in (np.minimum, np.maximum))
    return np.ascontiguousarray(np.column_stack([0.5 * (low + high), 0.5 * norm(high - low)]))

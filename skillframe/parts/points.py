"""Points on a part's surface: on its edges, which touch first, and on its faces.

They are denser where the other part can come. Edges are where faces turn by more than 20 degrees. They get their
corners and a point every half spacing; faces get one point a cube of the spacing. Blocks of
neighbouring points have a ball around them, and so have groups of blocks, so that a call passes over most.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float, cross, norm
from skillframe.parts.solid import Faces

_SHARP = np.cos(np.radians(20.0))
_POINTS = 1500
_SPACING = (4e-4, 2e-3)  # m
_SPARSE = 4.0  # times the spacing, where the other part cannot come
_WIDE = 3  # blocks along each side of a group
_OVER = 8.0  # points tried for each that is kept on faces
_PLASTIC = 1.324717957244746  # M. Roberts' sequence R2: x_n = n / p, y_n = n / p^2, modulo 1


class SurfacePoints(NamedTuple):
    """Points (P, 3) [m] and the `spacing` that they have [m].

    Blocks of them begin at `first` (B + 1,) and lie in `balls` (B, 4), centre and radius. Groups of blocks begin at
    `group` (G + 1,) and lie in the balls `around` (G, 4).
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
    spacing = float(np.clip(np.sqrt(_clipped(area, inside) / _POINTS), *_SPACING))
    found = np.concatenate([_on_edges(vertices, faces, spacing), _on_faces(vertices, faces, area, spacing)])
    edges = len(_on_edges(vertices, faces, spacing))
    near = ((found > low) & (found < high)).all(axis=1)
    on_edge = np.arange(len(found)) < edges
    kept = np.concatenate([
        _thinned(found, near & on_edge, 0.5 * spacing), _thinned(found, near & ~on_edge, spacing),
        _thinned(found, ~near & on_edge, 0.5 * _SPARSE * spacing), _thinned(found, ~near & ~on_edge, _SPARSE * spacing),
    ])  # fmt: skip
    return _in_blocks(found[kept], 4.0 * spacing, spacing)


def _clipped(area: Float, inside: NDArray[np.bool_]) -> float:
    return float(area[inside].sum()) if inside.any() else float(area.sum())


def _on_edges(vertices: Float, faces: Faces, spacing: float) -> Float:
    """Corners first, so that they are kept, then points along each edge."""
    raw = cross(vertices[faces[:, 1]] - vertices[faces[:, 0]], vertices[faces[:, 2]] - vertices[faces[:, 0]])
    normal = raw / np.maximum(norm(raw), 1e-300)[:, None]
    ends = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)
    order = np.lexsort((ends[:, 1], ends[:, 0]))
    pairs = order.reshape(-1, 2)  # in a closed mesh every edge has two triangles
    sharp = (normal[pairs[:, 0] // 3] * normal[pairs[:, 1] // 3]).sum(axis=1) < _SHARP
    edges = vertices[ends[pairs[sharp, 0]]]
    if not len(edges):
        return np.zeros((0, 3))
    count = np.ceil(norm(edges[:, 1] - edges[:, 0]) / (0.5 * spacing)).astype(int)
    which = np.repeat(np.arange(len(edges)), count)
    along = (np.arange(len(which)) - np.repeat(np.cumsum(count) - count, count)) / count[which]
    between = edges[which, 0] + along[:, None] * (edges[which, 1] - edges[which, 0])
    return np.concatenate([edges.reshape(-1, 3), between[along > 0.0]])


def _on_faces(vertices: Float, faces: Faces, area: Float, spacing: float) -> Float:
    count = int(_OVER * area.sum() / spacing**2)
    place = (np.arange(count) + 0.5) * (area.sum() / count)
    face = np.minimum(np.searchsorted(np.cumsum(area), place), len(faces) - 1)
    a, b = (np.arange(count)[:, None] / np.array([_PLASTIC, _PLASTIC**2]) % 1.0).T
    a, b = np.where(a + b > 1.0, 1.0 - a, a)[:, None], np.where(a + b > 1.0, 1.0 - b, b)[:, None]
    p, q, r = (vertices[faces[face, k]] for k in range(3))
    found: Float = p + a * (q - p) + b * (r - p)
    return found


def _thinned(points: Float, chosen: NDArray[np.bool_], size: float) -> NDArray[np.int64]:
    """The first of the chosen points in every cube, as indices."""
    index = np.flatnonzero(chosen)
    _, first = np.unique(np.floor(points[index] / size).astype(np.int64), axis=0, return_index=True)
    return index[np.sort(first)]


def _in_blocks(points: Float, size: float, spacing: float) -> SurfacePoints:
    place = np.floor(points / size).astype(np.int64)
    wide = place // _WIDE
    # by groups first, so that the blocks of each follow each other
    order = np.lexsort((*place.T[::-1], *wide.T[::-1]))
    points = np.ascontiguousarray(points[order])
    first, of_group = _begins(place[order]), _begins(wide[order])
    group = np.searchsorted(first, of_group).astype(np.int64)
    return SurfacePoints(points, first, _balls(points, first), group, _balls(points, of_group), spacing)


def _begins(places: NDArray[np.int64]) -> NDArray[np.int64]:
    """Where runs of equal rows begin, and their number of rows last."""
    change = (places[1:] != places[:-1]).any(axis=1)
    return np.concatenate([[0], 1 + np.flatnonzero(change), [len(places)]]).astype(np.int64)


def _balls(points: Float, first: NDArray[np.int64]) -> Float:
    """Balls (B, 4), centre and radius, around points that begin at first (B + 1,)."""
    low, high = (f.reduceat(points, first[:-1], axis=0) for f in (np.minimum, np.maximum))
    return np.ascontiguousarray(np.column_stack([0.5 * (low + high), 0.5 * norm(high - low)]))

"""Cross-sections of a closed mesh between the heights of its corners, cut into convex polygons that move with height.

Between two neighbouring heights no corner lies, so that each corner of a cross-section runs along one edge of the mesh,
straight, from the lower to the upper level. A cross-section is triangulated, and triangles are joined while what comes
out is convex (Hertel and Mehlhorn, "Fast triangulation of simple polygons", 1983: at most four times as many pieces as
needed), here convex at the lower level, in the middle and at the upper one.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from skillframe.frames import Float, cross, unit
from skillframe.parts.solid import Faces

SAME_LEVEL = 2e-6  # m; corners whose heights differ by less lie on one level
_FLAT = 1.0 - 5e-7  # cosine of the angle between normals of triangles that are one face: 1 mrad
_STRAIGHT = 1e-13  # m2; a corner that turns inwards by less is straight


class CutSlab(NamedTuple):
    """A slab's convex polygons: corners (V, 2) at its lower and upper level [m], and polygons as their indices."""

    low: float
    high: float
    lower: Float
    upper: Float
    polygons: list[list[int]]


def levels_of(heights: Float) -> Float:
    """The different heights among corners (V,), ascending."""
    ordered = np.sort(heights)
    found: Float = ordered[np.concatenate([[True], np.diff(ordered) > SAME_LEVEL])]
    return found


def section(vertices: Float, faces: Faces, low: float, high: float) -> CutSlab:
    """The convex polygons of a mesh between two neighbouring levels of its corners.

    Args:
        vertices: (V, 3) of a closed mesh [m]; the slab lies across its z axis.
        faces: (F, 3), turned outwards.
        low: the lower level [m].
        high: the upper one.
    """
    edges, loops = _loops(vertices, faces, 0.5 * (low + high))
    if not loops:
        return CutSlab(low, high, np.zeros((0, 2)), np.zeros((0, 2)), [])
    ends = vertices[edges]
    at = [_at(ends, height) for height in (low, 0.5 * (low + high), high)]
    return CutSlab(low, high, at[0], at[2], _convex(at, loops))


def _at(ends: Float, height: float) -> Float:
    """Where edges (E, 2, 3) pass a height, (E, 2)."""
    rise = ends[:, 1, 2] - ends[:, 0, 2]
    share = np.clip((height - ends[:, 0, 2]) / rise, 0.0, 1.0)[:, None]
    found: Float = ends[:, 0, :2] + share * (ends[:, 1, :2] - ends[:, 0, :2])
    return found


def _loops(vertices: Float, faces: Faces, height: float) -> tuple[Faces, list[list[int]]]:
    """The edges (E, 2) that a plane meets, and the closed ways around the material, which lies to the left.

    Corners between triangles of one flat face are left out.
    """
    above = vertices[:, 2] > height
    a, b = faces, np.roll(faces, -1, axis=1)
    rises, falls = ~above[a] & above[b], above[a] & ~above[b]
    met = rises.any(axis=1)
    normal = _normals(vertices, faces[met])
    enters = np.stack([a[falls], b[falls]], axis=1)  # row by row: one per triangle that is met
    leaves = np.stack([b[rises], a[rises]], axis=1)
    edges, number = np.unique(np.concatenate([enters, leaves]), axis=0, return_inverse=True)
    begins, ends = np.split(number.reshape(-1), 2)
    following = dict(zip(begins.tolist(), ends.tolist(), strict=True))
    before = {int(e): normal[i] for i, e in enumerate(ends)}
    after = {int(e): normal[i] for i, e in enumerate(begins)}
    bent = {e for e in following if e in before and float(before[e] @ after[e]) < _FLAT}
    loops = []
    while following:
        here, loop = next(iter(following)), []
        while here in following:
            if here in bent:
                loop.append(here)
            here = following.pop(here)
        if len(loop) > 2:
            loops.append(loop)
    return edges, loops


def _normals(vertices: Float, faces: Faces) -> Float:
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return unit(cross(b - a, c - a))


def _convex(at: list[Float], loops: list[list[int]]) -> list[list[int]]:
    """Convex polygons, counter-clockwise, that fill loops of corners at three heights (V, 2)."""
    import manifold3d

    order = [corner for loop in loops for corner in loop]
    triangles: Any = manifold3d.triangulate([np.ascontiguousarray(at[1][loop]) for loop in loops])
    polygons = {i: [order[k] for k in triangle] for i, triangle in enumerate(np.asarray(triangles).tolist())}
    owner = {(p[k], p[(k + 1) % 3]): i for i, p in polygons.items() for k in range(3)}
    inner = [edge for edge in owner if edge[0] < edge[1] and edge[::-1] in owner]
    inner.sort(key=lambda edge: -float(np.sum((at[1][edge[0]] - at[1][edge[1]]) ** 2)))
    for edge in inner:  # the longest first: what is left is compact
        one, two = owner[edge], owner[edge[::-1]]
        joined = _joined(polygons[one], polygons[two], edge)
        if one != two and all(_is_convex(points[joined]) for points in at):
            polygons[one] = joined
            del polygons[two]
            for k, corner in enumerate(joined):
                owner[corner, joined[(k + 1) % len(joined)]] = one
    return list(polygons.values())


def _joined(one: list[int], two: list[int], edge: tuple[int, int]) -> list[int]:
    """Two polygons as one without the edge that they share, which the first runs through as given."""
    i, k = one.index(edge[1]), two.index(edge[0])
    return [*one[i:], *one[:i], *two[k + 1 :], *two[: max(k - 1, 0)]] if k else [*one[i:], *one[:i], *two[1:-1]]


def _is_convex(points: Float) -> bool:
    along = np.roll(points, -1, axis=0) - points
    following = np.roll(along, -1, axis=0)
    turn = along[:, 0] * following[:, 1] - along[:, 1] * following[:, 0]
    return bool((turn > -_STRAIGHT).all())

"""Cross-sections of a closed mesh between the heights of its corners, cut into convex polygons.

Between neighbouring heights each corner of a cross-section moves straight along one edge of the mesh. Triangles of a
section are joined while convex (Hertel and Mehlhorn, "Fast triangulation of simple polygons", 1983: at most four times
the minimum number of pieces), here at the lower level, in the middle and at the upper one.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from skillframe.frames import Float, cross, unit
from skillframe_parts.solid import Faces


class CutSlab(NamedTuple):
    """A slab's convex polygons: corners (V, 2) at its lower and upper level [m], and polygons as their indices."""

    low: float
    high: float
    lower: Float
    upper: Float
    polygons: list[list[int]]


def levels_of(heights: Float) -> Float:
    """The different heights of corners (V,), ascending, where those within 2 um are one level."""
    ordered = np.sort(heights)
    found: Float = ordered[np.concatenate([[True], np.diff(ordered) > 2e-6])]  # m
    return found


def section(vertices: Float, faces: Faces, low: float, high: float) -> CutSlab:
    """Convex polygons of a closed mesh (V, 3) [m] between two neighbouring levels of its corners [m].

    Faces (F, 3) are oriented outwards, the slab is normal to z.
    """
    edges, loops = _loops(vertices, faces, 0.5 * (low + high))
    if not loops:
        return CutSlab(low, high, np.zeros((0, 2)), np.zeros((0, 2)), [])
    foot, head, at = vertices[edges[:, 0]], vertices[edges[:, 1]], []
    for height in (low, 0.5 * (low + high), high):
        share = np.clip((height - foot[:, 2]) / (head[:, 2] - foot[:, 2]), 0.0, 1.0)[:, None]
        at.append(foot[:, :2] + share * (head[:, :2] - foot[:, :2]))
    return CutSlab(low, high, at[0], at[2], _convex(at, loops))


def _loops(vertices: Float, faces: Faces, height: float) -> tuple[Faces, list[list[int]]]:
    """Edges (E, 2) that meet a plane, and closed loops with the material to the left.

    Corners within a flat face are omitted.
    """
    above = vertices[:, 2] > height
    a, b = faces, np.roll(faces, -1, axis=1)
    rises, falls = ~above[a] & above[b], above[a] & ~above[b]
    met = rises.any(axis=1)
    p, q, r = (vertices[faces[met, k]] for k in range(3))
    normal = unit(cross(q - p, r - p))
    enters = np.stack([a[falls], b[falls]], axis=1)  # one row per triangle that is met
    leaves = np.stack([b[rises], a[rises]], axis=1)
    edges, number = np.unique(np.concatenate([enters, leaves]), axis=0, return_inverse=True)
    begins, ends = np.split(number.reshape(-1), 2)
    following = dict(zip(begins.tolist(), ends.tolist(), strict=True))
    before = {int(e): normal[i] for i, e in enumerate(ends)}
    after = {int(e): normal[i] for i, e in enumerate(begins)}
    flat = 1.0 - 5e-7  # cosine of the angle between normals of one face: 1 mrad
    bent = {e for e in following if e in before and float(before[e] @ after[e]) < flat}
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


def _convex(at: list[Float], loops: list[list[int]]) -> list[list[int]]:
    """Counter-clockwise convex polygons that fill loops of corners at three heights (V, 2)."""
    import manifold3d

    order = [corner for loop in loops for corner in loop]
    triangles: Any = manifold3d.triangulate([np.ascontiguousarray(at[1][loop]) for loop in loops])
    polygons = {i: [order[k] for k in triangle] for i, triangle in enumerate(np.asarray(triangles).tolist())}
    owner = {(p[k], p[(k + 1) % 3]): i for i, p in polygons.items() for k in range(3)}
    inner = [edge for edge in owner if edge[0] < edge[1] and edge[::-1] in owner]
    inner.sort(key=lambda edge: -float(np.sum((at[1][edge[0]] - at[1][edge[1]]) ** 2)))
    for edge in inner:  # longest first, for compact polygons
        one, two = owner[edge], owner[edge[::-1]]
        a, b = polygons[one], polygons[two]
        i, k = a.index(edge[1]), b.index(edge[0])  # the edge is in the direction of the first
        joined = [*a[i:], *a[:i], *b[k + 1 :], *b[: max(k - 1, 0)]] if k else [*a[i:], *a[:i], *b[1:-1]]
        if one != two and all(_is_convex(points[joined]) for points in at):
            polygons[one] = joined
            del polygons[two]
            for k, corner in enumerate(joined):
                owner[corner, joined[(k + 1) % len(joined)]] = one
    return list(polygons.values())


def _is_convex(points: Float) -> bool:
    along = np.roll(points, -1, axis=0) - points
    following = np.roll(along, -1, axis=0)
    turn = along[:, 0] * following[:, 1] - along[:, 1] * following[:, 0]
    return bool((turn > -1e-13).all())  # m2; a smaller inward turn is straight

"""Convex decomposition: slabs along one axis, cross-sections cut into convex polygons (`sections`), and hulls.

It is exact for extrusions and plane faces without twist. Pieces of neighbouring slabs are joined if convex together.
The error is measured at corners and middles of the difference D of part and union:

    error = max over p of D of max(d(p, surface of the part), d(p, surface of the union)).

If exact pieces are too many, the mesh is simplified within a share of the allowed error.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from skillframe.frames import Float, cross, norm
from skillframe.robot import SMALLEST, Hull, hull_of
from skillframe_parts.sections import levels_of, section
from skillframe_parts.solid import arrays_of, solid_of, united

MOST_PIECES = 150
"""Most pieces of a part; each takes about 3 us per simulation step."""
EXACT_M = 1e-5
"""Error below which pieces count as exact."""
_AXES = {"z": (0, 1, 2), "x": (1, 2, 0), "y": (2, 0, 1)}
_MORE = 1e-8  # m; tolerated mean thickness of a joint hull beyond its pieces


class ConvexPieces(NamedTuple):
    """A part's pieces.

    Attributes:
        hulls: convex, in the part's frame.
        error: of their union [m]; infinite if there are too many.
        axis: of the slabs, "x", "y" or "z"; "" for convex parts.
        thinned: whether the mesh was simplified.
    """

    hulls: list[Hull]
    error: float
    axis: str
    thinned: bool


def pieces_of(solid: Any, allowed: float, most: int = MOST_PIECES) -> ConvexPieces:
    """The fewest pieces of a part within an error, or the best available.

    `allowed` is the error of simplification [m], 0 for exact pieces only (`EXACT_M`); `most` the number of useful
    pieces.
    """
    found = _along_all(solid, most)
    if found is not None and len(found[0]) <= most:
        error = error_of(found[0], solid, np.inf if allowed else EXACT_M)
        return ConvexPieces(found[0], error, found[1], False)
    for share in (0.5, 1.0) if allowed else ():
        thinner = _along_all(solid.simplify(share * allowed), most)
        if thinner is not None and (found is None or len(thinner[0]) < len(found[0])):
            found = thinner
        if found is not None and len(found[0]) <= most:
            break
    if found is None:
        return ConvexPieces([], np.inf, "", bool(allowed))
    few = len(found[0]) <= most
    return ConvexPieces(found[0], error_of(found[0], solid) if few else np.inf, found[1], bool(allowed))


def _along_all(solid: Any, most: int) -> tuple[list[Hull], str] | None:
    bodies = solid.decompose()
    whole = [(hull_of(arrays_of(body)[0]), body) for body in bodies]
    convex = [h for h, body in whole if h is not None and h.volume - body.volume() < _MORE * body.surface_area()]
    if len(convex) == len(bodies):
        return convex, ""
    tried = [(found, axis) for axis in _AXES if (found := _along(solid, axis, most)) is not None]
    return min(tried, key=lambda one: len(one[0]), default=None)


def _along(solid: Any, axis: str, most: int) -> list[Hull] | None:
    vertices, faces = arrays_of(solid)
    order = _AXES[axis]
    turned = vertices[:, [order[0], order[1], order[2]]]
    levels = levels_of(turned[:, 2])
    if len(levels) > 120:  # slabs
        return None
    stacks: list[list[Hull]] = []
    for low, high in pairwise(levels):
        slab, stack = section(turned, faces, float(low), float(high)), []
        for polygon in slab.polygons:
            lower, upper = (
                np.column_stack([points[polygon], np.full(len(polygon), height)])
                for points, height in ((slab.lower, slab.low), (slab.upper, slab.high))
            )
            hull = hull_of(np.concatenate([lower, upper]))
            # m3; MuJoCo refuses meshes below 1e-15
            if hull is not None and hull.volume > 1e-14 and np.ptp(hull.vertices, axis=0).max() > 1.01 * SMALLEST:
                stack.append(hull)
        stacks.append(stack)
        if sum(map(len, stacks)) > 4 * most:  # before they are joined
            return None
    back, made = np.argsort(order), []
    for hull in _joined(stacks):
        renamed = hull_of(hull.vertices[:, back])
        assert renamed is not None  # valid before renaming axes
        made.append(renamed)
    return made


def _joined(stacks: list[list[Hull]]) -> list[Hull]:
    done: list[Hull] = []
    growing: dict[bytes, list[Hull]] = {}
    for slab in stacks:
        following: dict[bytes, list[Hull]] = {}
        for hull in slab:
            under, both = growing.get(_end(hull, np.min), []), hull
            for index, low in enumerate(under):
                found = hull_of(np.concatenate([low.vertices, hull.vertices]))
                if found is None:
                    continue
                a, b, c = (found.vertices[found.faces[:, k]] for k in range(3))
                surface = 0.5 * float(norm(cross(b - a, c - a)).sum())
                if found.volume - low.volume - hull.volume < _MORE * surface:
                    both = found
                    del under[index]
                    break
            following.setdefault(_end(both, np.max), []).append(both)
        done += [hull for left in growing.values() for hull in left]
        growing = following
    return done + [hull for left in growing.values() for hull in left]


def _end(hull: Hull, side: Callable[[Float], Any]) -> bytes:
    """Bounding box of a piece's lower or upper end, to a micrometre."""
    heights = hull.vertices[:, 2]
    end = hull.vertices[np.abs(heights - side(heights)) < 1e-9]
    return (np.round(np.concatenate([end.min(axis=0), end.max(axis=0)]) / 1e-6) + 0.0).tobytes()


def error_of(hulls: list[Hull], solid: Any, useful: float = np.inf) -> float:
    """Largest deviation of the union of hulls from a solid [m], in both directions.

    If the mean thickness 2 V / A of a difference exceeds `useful` [m], it is returned as a lower bound.
    """
    whole = united([solid_of(hull.vertices, hull.faces) for hull in hulls])
    bodies = [body for difference in (whole - solid, solid - whole) for body in difference.decompose()]
    more = [body for body in bodies if 2.0 * body.volume() >= _MORE * body.surface_area()]  # less is rounding
    if not more:
        return 0.0
    thickest = max(2.0 * float(body.volume()) / float(body.surface_area()) for body in more)
    if thickest > useful:
        return thickest
    looked_at = []
    for vertices, faces in map(arrays_of, more):
        corners = vertices[faces]
        middles = 0.5 * (corners + np.roll(corners, 1, axis=1)).reshape(-1, 3)
        some = np.concatenate([vertices, middles, corners.mean(axis=1)])
        looked_at.append(np.unique(np.round(some / _MORE), axis=0) * _MORE)
    points = np.concatenate(looked_at)
    surfaces = (_Triangles(vertices[faces]) for vertices, faces in map(arrays_of, (solid, whole)))
    return max(float(surface.distances(points).max()) for surface in surfaces)


def distances(points: Float, triangles: Float) -> Float:
    """Distance of points (P, 3) from the nearest of triangles (F, 3, 3), (P,) [m]."""
    return _Triangles(triangles).distances(points)


class _Triangles:
    """Triangles (F, 3, 3) [m], with bounding spheres and a tree of their corners."""

    def __init__(self, triangles: Float) -> None:
        from scipy.spatial import cKDTree

        self._scale = 1.0 / float(np.ptp(triangles.reshape(-1, 3), axis=0).max())  # trimesh's tolerances are absolute
        self._triangles = self._scale * triangles
        self._centres = self._triangles.mean(axis=1)
        self._radii = norm(self._triangles - self._centres[:, None]).max(axis=1)
        self._corners = cKDTree(self._triangles.reshape(-1, 3))

    def distances(self, points: Float) -> Float:
        """Distances of points (P, 3), (P,) [m].

        Triangles are culled by their spheres, against the nearest corner of each point and of a ball around several
        points.
        """
        from scipy.spatial import cKDTree
        from trimesh.triangles import closest_point

        points = self._scale * points
        nearest: Float = self._corners.query(points)[0]
        at_once = 64
        order = cKDTree(points, leafsize=at_once).indices  # neighbours are near each other
        for some in np.split(order, range(at_once, len(order), at_once)):
            low, high = points[some].min(axis=0), points[some].max(axis=0)
            reach = (1.0 + 1e-9) * (0.5 * norm(high - low) + nearest[some].max())
            close = np.flatnonzero(norm(self._centres - 0.5 * (low + high)) - self._radii <= reach)
            near = norm(points[some, None] - self._centres[close]) - self._radii[close] <= nearest[some, None]
            point, triangle = np.nonzero(near)
            there = points[some[point]]
            away = norm(there - closest_point(self._triangles[close[triangle]], there))
            np.minimum.at(nearest, some[point], away)
        return nearest / self._scale

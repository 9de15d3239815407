"""A part as convex pieces: slabs along one axis, each cross-section cut into convex polygons (`sections`), and hulls.

Exact for extrusions and for whatever plane faces bound, if no piece twists: the hull of a polygon at a slab's lower
level and at its upper one. Pieces of neighbouring slabs that are convex together are joined. How far the union of all
pieces is from the part is measured, not assumed. With D what one of the two has and the other has not,

    error = max over p of D of max(d(p, surface of the part), d(p, surface of the union)),

where p are the corners of D, the middles of its edges and those of its triangles.

Where exact pieces are too many, the mesh is thinned within a share of the error that is allowed, and then measured.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from skillframe.frames import Float, cross, norm
from skillframe.parts.sections import CutSlab, levels_of, section
from skillframe.parts.solid import Faces, arrays_of, solid_of, united
from skillframe.robot.convexity import SMALLEST, Hull, hull_of

MOST_PIECES = 150
"""Of one part; ours: the loop takes about 3 us more a step for each (measured on rings of boxes)."""
EXACT_M = 1e-5
"""Pieces that are off by no more count as exact: surfaces are off by 3 to 18 um on AutoMate's parts (ours)."""
_MOST_SLABS, _CUT = 120, 4  # slabs along an axis; pieces before neighbouring slabs are joined, for each at most
_SHARES = (0.5, 1.0)
_AXES = {"z": (0, 1, 2), "x": (1, 2, 0), "y": (2, 0, 1)}
_MORE = 1e-8  # m; mean thickness of what the hull of several pieces may hold beyond them
_TOUCHING, _GRID = 1e-9, 1e-6  # m
_LEAST_VOLUME = 1e-14  # m3; MuJoCo takes no mesh of less than 1e-15
_AT_ONCE = 64  # points


class ConvexPieces(NamedTuple):
    """A part's pieces.

    Attributes:
        hulls: convex, in the part's frame.
        error: how far their union is from the part [m]; infinite, and not measured, where there are too many.
        axis: along which the slabs lie, "x", "y" or "z"; "" for parts that are convex themselves.
        thinned: whether the mesh was thinned first.
    """

    hulls: list[Hull]
    error: float
    axis: str
    thinned: bool


def pieces_of(solid: Any, allowed: float, most: int = MOST_PIECES) -> ConvexPieces:
    """The fewest pieces that were found for a part within an error, or the best there are: the caller judges.

    Args:
        solid: a `manifold3d.Manifold` [m].
        allowed: error of what is thinned [m]; 0: nothing is thinned, and only what is exact is of use (`EXACT_M`).
        most: pieces that are of use.
    """
    found = _along_all(solid, most)
    if found is not None and len(found[0]) <= most:
        error = error_of(found[0], solid, np.inf if allowed else EXACT_M)
        return ConvexPieces(found[0], error, found[1], False)
    for share in _SHARES if allowed else ():
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
    """The hulls of the axis that takes the fewest, and the axis. None where each takes far too many."""
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
    if len(levels) > _MOST_SLABS:
        return None
    stacks: list[list[Hull]] = []
    cut = 0
    for low, high in pairwise(levels):
        stacks.append(_hulls(section(turned, faces, float(low), float(high))))
        cut += len(stacks[-1])
        if cut > _CUT * most:
            return None
    back = np.argsort(order)
    return [_turned(hull, back) for hull in _joined(stacks)]


def _turned(hull: Hull, order: Any) -> Hull:
    made = hull_of(hull.vertices[:, order])
    assert made is not None  # it was one before its axes were renamed
    return made


def _hulls(slab: CutSlab) -> list[Hull]:
    found = []
    for polygon in slab.polygons:
        lower, upper = (
            np.column_stack([points[polygon], np.full(len(polygon), height)])
            for points, height in ((slab.lower, slab.low), (slab.upper, slab.high))
        )
        hull = hull_of(np.concatenate([lower, upper]))
        if hull is not None and hull.volume > _LEAST_VOLUME and np.ptp(hull.vertices, axis=0).max() > 1.01 * SMALLEST:
            found.append(hull)
    return found


def _joined(stacks: list[list[Hull]]) -> list[Hull]:
    """Pieces of neighbouring slabs that are convex together as one piece."""
    done: list[Hull] = []
    growing: dict[bytes, list[Hull]] = {}
    for slab in stacks:
        following: dict[bytes, list[Hull]] = {}
        for hull in slab:
            under = growing.get(_end(hull, np.min), [])
            tried = ((k, _together(low, hull)) for k, low in enumerate(under))
            index, both = next(((k, found) for k, found in tried if found is not None), (None, hull))
            if index is not None:
                del under[index]
            following.setdefault(_end(both, np.max), []).append(both)
        done += [hull for left in growing.values() for hull in left]
        growing = following
    return done + [hull for left in growing.values() for hull in left]


def _end(hull: Hull, side: Callable[[Float], Any]) -> bytes:
    """Where the lower or upper end of a piece lies: the box around it, to a micrometre."""
    heights = hull.vertices[:, 2]
    end = hull.vertices[np.abs(heights - side(heights)) < _TOUCHING]
    return (np.round(np.concatenate([end.min(axis=0), end.max(axis=0)]) / _GRID) + 0.0).tobytes()


def _together(low: Hull, high: Hull) -> Hull | None:
    """The hull of two pieces, one on top of the other, or None where it holds more than they do."""
    both = hull_of(np.concatenate([low.vertices, high.vertices]))
    return both if both is not None and both.volume - low.volume - high.volume < _MORE * _surface(both) else None


def _surface(hull: Hull) -> float:
    a, b, c = (hull.vertices[hull.faces[:, k]] for k in range(3))
    return 0.5 * float(norm(cross(b - a, c - a)).sum())


def error_of(hulls: list[Hull], solid: Any, useful: float = np.inf) -> float:
    """How far the union of hulls is from a solid [m], the larger of what is too much and what is missing.

    An error of more than `useful` [m] is not measured where the mean thickness 2 V / A of a difference tells of it:
    that is returned, which is less.
    """
    whole = united([solid_of(hull.vertices, hull.faces) for hull in hulls])
    bodies = [body for difference in (whole - solid, solid - whole) for body in difference.decompose()]
    more = [body for body in bodies if 2.0 * body.volume() >= _MORE * body.surface_area()]  # less is rounding
    if not more:
        return 0.0
    thickest = max(2.0 * float(body.volume()) / float(body.surface_area()) for body in more)
    if thickest > useful:
        return thickest
    points = np.concatenate([_looked_at(*arrays_of(body)) for body in more])
    surfaces = (_Triangles(vertices[faces]) for vertices, faces in map(arrays_of, (solid, whole)))
    return max(float(surface.distances(points).max()) for surface in surfaces)


def _looked_at(vertices: Float, faces: Faces) -> Float:
    """The corners of a mesh, the middles of its edges and of its triangles, each once."""
    corners = vertices[faces]
    middles = 0.5 * (corners + np.roll(corners, 1, axis=1)).reshape(-1, 3)
    points = np.concatenate([vertices, middles, corners.mean(axis=1)])
    found: Float = np.unique(np.round(points / _MORE), axis=0) * _MORE
    return found


def distances(points: Float, triangles: Float) -> Float:
    """Distance of points (P, 3) from the nearest of triangles (F, 3, 3), (P,) [m]."""
    return _Triangles(triangles).distances(points)


class _Triangles:
    """Triangles (F, 3, 3) [m], each with its bounding sphere, and a tree of their corners."""

    def __init__(self, triangles: Float) -> None:
        from scipy.spatial import cKDTree

        self._scale = 1.0 / float(np.ptp(triangles.reshape(-1, 3), axis=0).max())  # trimesh's tolerances are absolute
        self._triangles = self._scale * triangles
        self._centres = self._triangles.mean(axis=1)
        self._radii = norm(self._triangles - self._centres[:, None]).max(axis=1)
        self._corners = cKDTree(self._triangles.reshape(-1, 3))

    def distances(self, points: Float) -> Float:
        """Of points (P, 3), (P,) [m].

        A triangle is looked at where its sphere comes nearer to a point than the nearest corner of all is, and before
        that, where it comes as near to a ball around some points as the farthest of their corners does.
        """
        from scipy.spatial import cKDTree
        from trimesh.triangles import closest_point

        points = self._scale * points
        nearest: Float = self._corners.query(points)[0]
        order = cKDTree(points, leafsize=_AT_ONCE).indices  # those that follow each other lie near each other
        for some in np.split(order, range(_AT_ONCE, len(order), _AT_ONCE)):
            low, high = points[some].min(axis=0), points[some].max(axis=0)
            reach = (1.0 + 1e-9) * (0.5 * norm(high - low) + nearest[some].max())
            close = np.flatnonzero(norm(self._centres - 0.5 * (low + high)) - self._radii <= reach)
            near = norm(points[some, None] - self._centres[close]) - self._radii[close] <= nearest[some, None]
            point, triangle = np.nonzero(near)
            there = points[some[point]]
            away = norm(there - closest_point(self._triangles[close[triangle]], there))
            np.minimum.at(nearest, some[point], away)
        return nearest / self._scale

r"""Is a mesh convex? MuJoCo collides with a mesh's convex hull, so a hole in it is filled without a word.

The dent of a mesh is the largest depth of a corner, a triangle's centroid or an edge's middle below the hull's faces,
\(\max_p \min_k -(n_k \cdot p + d_k)\). It is zero for a convex mesh and for no other: a centroid of three corners on
the hull lies on the hull only if one face holds all three. It sees a small hole in a large plate, which a ratio of
volumes does not. Volumes are
\(V = \frac{1}{6} \left| \sum v_1 \cdot (v_2 \times v_3) \right|\) over the triangles (divergence theorem). Tolerances
are our choice, because contacts sink by some 0.05 mm (measured) and STL files round to 1e-7 of their size.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float, cross

DENT = 5e-5  # m; what a contact sinks by
ROUNDING = 1e-6  # of the mesh's size: single precision, some triangles deep
SMALLEST = 2e-4  # m; a part of 0.2 m read a thousand times too small
LARGEST = 10.0  # m; a part of 10 mm read a thousand times too large
_CHUNK = 4_000_000  # pairs of a point and a face at a time: 32 MB


class Hull(NamedTuple):
    """The convex hull of points: corners (V, 3), triangles (F, 3) of them, planes (F, 4) with n p + d <= 0 inside."""

    vertices: Float
    faces: NDArray[np.int64]
    planes: Float
    volume: float


def hull_of(vertices: Float) -> Hull | None:
    """The hull of points (V, 3), or None where they lie in one plane."""
    from scipy.spatial import ConvexHull, QhullError

    size = float(np.ptp(vertices, axis=0).max()) if len(vertices) else 0.0
    if len(vertices) < 4 or not size > 0.0:
        return None
    centred = vertices - vertices.mean(axis=0)
    if np.linalg.svd(centred, compute_uv=False)[-1] <= ROUNDING * size * np.sqrt(len(vertices)):
        return None
    try:
        hull = ConvexHull(vertices)
    except QhullError:
        return None
    renumbered = np.full(len(vertices), -1)
    renumbered[hull.vertices] = np.arange(len(hull.vertices))
    faces = renumbered[hull.simplices]
    corners = vertices[hull.simplices]
    turned = cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    inward = np.sum(turned * hull.equations[:, :3], axis=1) < 0.0
    faces[inward] = faces[inward][:, ::-1]
    return Hull(vertices[hull.vertices], faces, np.unique(hull.equations.round(12), axis=0), float(hull.volume))


def volume_of(vertices: Float, faces: NDArray[np.int64]) -> float:
    """Volume [m^3] that a closed mesh encloses, whichever way its triangles are turned."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return abs(float(np.sum(a * cross(b, c)))) / 6.0


def open_edges(vertices: Float, faces: NDArray[np.int64]) -> int:
    """Number of edges that do not have two triangles, or an even number of them. Equal vertices count as one."""
    _, same = np.unique(vertices, axis=0, return_inverse=True)
    merged = same.reshape(-1)[faces]
    whole = (merged[:, 0] != merged[:, 1]) & (merged[:, 1] != merged[:, 2]) & (merged[:, 2] != merged[:, 0])
    edges = np.sort(merged[whole][:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    _, count = np.unique(edges, axis=0, return_counts=True)
    return int(np.sum(count % 2))


def dent(vertices: Float, faces: NDArray[np.int64], hull: Hull, enough: float = np.inf) -> float:
    """How deep the surface lies inside its hull at worst [m], looked at in corners, centroids and halves of edges.

    Once it is deeper than `enough`, nothing more is looked at.
    """
    corners = vertices[faces]
    halves = 0.5 * (corners + np.roll(corners, 1, axis=1)).reshape(-1, 3)
    points = np.concatenate([vertices[np.unique(faces)], corners.mean(axis=1), halves])
    step = max(1, _CHUNK // len(hull.planes))
    deepest = 0.0
    for start in range(0, len(points), step):
        part = points[start : start + step] @ hull.planes[:, :3].T + hull.planes[:, 3]
        deepest = max(deepest, float((-part.max(axis=1)).max()))
        if deepest > enough:
            break
    return deepest


def is_convex(vertices: Float, faces: NDArray[np.int64], hull: Hull) -> bool:
    """Does a mesh fill its hull but for rounding?"""
    allowed = DENT + ROUNDING * float(np.ptp(vertices, axis=0).max())
    return dent(vertices, faces, hull, allowed) <= allowed


def unfit_to_collide(vertices: Float, faces: NDArray[np.int64] | None) -> tuple[str, str] | None:
    """What keeps a mesh from being collided with as it is drawn, and what to do, or None if nothing does.

    A mesh without triangles stands for the hull of its vertices.
    """
    points = np.ascontiguousarray(vertices, dtype=float)
    triangles = None if faces is None else np.ascontiguousarray(faces, dtype=np.int64)
    return _unfit(points.tobytes(), None if triangles is None else triangles.tobytes())


@lru_cache(maxsize=256)
def _unfit(points: bytes, triangles: bytes | None) -> tuple[str, str] | None:
    vertices = np.frombuffer(points).reshape(-1, 3)
    if not np.isfinite(vertices).all():
        return "holds numbers that are not finite", "correct its vertices"
    hull = hull_of(vertices)
    if hull is None:
        return "is flat: its vertices lie in one plane", "give it a thickness, or take a box"
    size = float(np.ptp(vertices, axis=0).max())
    if not SMALLEST <= size <= LARGEST:
        why = "are its vertices in millimetres?" if size > LARGEST else "was it scaled to metres twice?"
        return f"is {size:.3g} m long ({why})", "give its vertices in metres"
    if triangles is None:
        return None
    faces = np.frombuffer(triangles, dtype=np.int64).reshape(-1, 3)
    if not len(faces) or faces.min() < 0 or faces.max() >= len(vertices):
        return "has triangles of vertices that it does not have", "correct its faces"
    return _unfit_surface(vertices, faces, hull)


def _unfit_surface(vertices: Float, faces: NDArray[np.int64], hull: Hull) -> tuple[str, str] | None:
    if count := open_edges(vertices, faces):
        text = f"is not closed ({count} open edges): what is inside it cannot be told"
        return text, "close it, or leave its faces out to take the hull of its vertices"
    if is_convex(vertices, faces, hull):
        return None
    deep = 1000.0 * dent(vertices, faces, hull)
    filled = 100.0 * (hull.volume / max(volume_of(vertices, faces), 1e-30) - 1.0)
    more = f"{filled:.2g} % more, up to {deep:.3g} mm deep"
    text = f"is not convex: its hull holds {more}; a peg would stand on air there"
    return text, "split it into convex pieces, one Geom each, or give it collide = False to be seen only"

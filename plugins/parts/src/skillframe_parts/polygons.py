"""Triangulation of plane polygons, and a reader of OBJ files, whose faces are such polygons.

A fan would leave a polygon that is not convex (an L, or a face joined to its hole), as in trimesh's reader of OBJ;
manifold3d cuts it in its best plane.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float, cross, norm

Faces = NDArray[np.int64]


def area_vector(points: Float) -> Float:
    """Area vector of rings (..., N, 3): area times normal of the best plane (Newell's method)."""
    middle = points - points.mean(axis=-2, keepdims=True)
    found: Float = 0.5 * cross(middle, np.roll(middle, -1, axis=-2)).sum(axis=-2)
    return found


def cut(points: Float) -> Faces:
    """Triangles (N - 2, 3) over a ring (N, 3), as indices of its points."""
    import manifold3d

    up = area_vector(points)
    if norm(up) < 1e-9 * float(np.ptp(points, axis=0).max()) ** 2:
        return _fan(len(points))  # no area: a point on a neighbour's edge
    up = up / norm(up)
    right = np.cross(up, np.eye(3)[np.argmin(np.abs(up))])
    right = right / norm(right)
    flat = np.stack([points @ right, points @ np.cross(up, right)], axis=1)
    found = np.asarray(manifold3d.triangulate([flat]), dtype=np.int64).reshape(-1, 3)
    return found if len(found) == len(points) - 2 else _fan(len(points))


def read_obj(raw: bytes) -> tuple[Float, Faces]:
    """Used vertices (V, 3) and triangles (T, 3) of an OBJ file.

    Raises:
        ValueError: an invalid number, or a face with a missing vertex.
    """
    vertices: list[list[bytes]] = []
    polygons: dict[int, list[list[int]]] = {}
    for line in raw.replace(b"\\\r\n", b" ").replace(b"\\\n", b" ").splitlines():
        words = line.partition(b"#")[0].split()
        if words[:1] == [b"v"]:
            vertices.append(words[1:4])
        elif words[:1] == [b"f"] and len(words) > 3:
            corner = [int(word.partition(b"/")[0]) for word in words[1:]]
            polygons.setdefault(len(corner), []).append([i - 1 if i > 0 else len(vertices) + i for i in corner])
    points = np.array(vertices, dtype=float).reshape(-1, 3)
    faces = np.concatenate(
        [_triangles(points, np.array(each)) for each in polygons.values()] or [np.zeros((0, 3), int)]
    )
    used, faces = np.unique(faces, return_inverse=True)
    return points[used], faces.reshape(-1, 3)


def _triangles(points: Float, polygons: Faces) -> Faces:
    """Triangles (T, 3) of polygons (M, N) with N corners."""
    count = polygons.shape[1]
    if polygons.min() < 0 or polygons.max() >= len(points):
        raise ValueError("a face has a vertex that is not there")
    if count == 3:
        return polygons
    rings = points[polygons]
    along = np.roll(rings, -1, axis=1) - rings
    turns, up = cross(along, np.roll(along, -1, axis=1)), area_vector(rings)
    lengths = norm(along) * norm(np.roll(along, -1, axis=1)) * norm(up)[:, None]
    straight = 1e-9  # least sine of the angle at a corner
    concave = ((turns * up[:, None]).sum(axis=-1) < -straight * lengths).any(axis=1)
    found = [polygons[~concave][:, _fan(count)].reshape(-1, 3)]
    return np.concatenate(found + [polygon[cut(points[polygon])] for polygon in polygons[concave]])


def _fan(count: int) -> Faces:
    return np.array([[0, k, k + 1] for k in range(1, count - 1)], dtype=np.int64)

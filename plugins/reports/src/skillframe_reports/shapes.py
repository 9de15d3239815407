"""Geometries of a trace as triangle meshes: surfaces of revolution, creased normals, sections.

A section keeps the half space \\(n \\cdot (x - p) \\le 0\\) of a closed mesh and caps the cut, which shows the tool
inside a fixture.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float, cross, matrix_from_quaternion, unit

SEGMENTS = 32


class Mesh(NamedTuple):
    """Triangles with a normal and a colour per vertex.

    Attributes:
        vertices, normals: (V, 3).
        faces: (F, 3) indices, counter-clockwise seen from outside.
        colors: (V, 4) red, green, blue, opacity in 0..1.
    """

    vertices: Float
    normals: Float
    faces: NDArray[np.int64]
    colors: Float

    def placed(self, position: Float, quaternion: Float) -> Mesh:
        """Return the mesh in the frame in which it has this pose (3,), (4,)."""
        rotation = matrix_from_quaternion(quaternion)
        return self._replace(vertices=self.vertices @ rotation.T + position, normals=self.normals @ rotation.T)

    def painted(self, rgba: Sequence[float]) -> Mesh:
        """Return the mesh in one colour."""
        return self._replace(colors=np.tile(np.asarray(rgba, dtype=float), (len(self.vertices), 1)))


EMPTY = Mesh(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64), np.zeros((0, 4)))


def merge(meshes: Sequence[Mesh]) -> Mesh:
    """Return several meshes as one."""
    if not meshes:
        return EMPTY
    starts = np.cumsum([0, *(len(m.vertices) for m in meshes[:-1])])
    return Mesh(
        np.concatenate([m.vertices for m in meshes]),
        np.concatenate([m.normals for m in meshes]),
        np.concatenate([m.faces + start for m, start in zip(meshes, starts, strict=True)]),
        np.concatenate([m.colors for m in meshes]),
    )


def mesh_of(geom: Mapping[str, Any]) -> Mesh:
    """Return a geometry of a trace in its body's frame. Unknown kinds are empty."""
    kind, size = geom.get("kind", ""), [float(s) for s in geom.get("size") or ()]
    if kind == "mesh":
        mesh = creased(np.array(geom["vertices"], dtype=float), np.array(geom["faces"], dtype=np.int64))
    elif kind in _MAKERS:
        mesh = _MAKERS[kind](size)
    else:
        return EMPTY
    rgba = geom.get("rgba") or (0.6, 0.65, 0.7, 1.0)
    position, quaternion = geom.get("position") or (0.0, 0.0, 0.0), geom.get("quaternion") or (0.0, 0.0, 0.0, 1.0)
    return mesh.painted(rgba).placed(np.array(position, dtype=float), np.array(quaternion, dtype=float))


def revolve(profile: Sequence[tuple[float, float, float, float]]) -> Mesh:
    """Return a surface of revolution about z from points (r, z, normal r, normal z), bottom to top."""
    points = np.array(profile)
    angle = np.linspace(0.0, 2.0 * np.pi, SEGMENTS + 1)[:-1]
    c, s = np.cos(angle)[None], np.sin(angle)[None]
    ones = np.ones_like(c)
    vertices = np.stack([points[:, :1] * c, points[:, :1] * s, points[:, 1:2] * ones], axis=-1)
    normals = np.stack([points[:, 2:3] * c, points[:, 2:3] * s, points[:, 3:] * ones], axis=-1)
    faces = []
    for row in range(len(points) - 1):
        if np.abs(points[row + 1, :2] - points[row, :2]).max() > 0.0:
            for i in range(SEGMENTS):
                a, b = row * SEGMENTS + i, row * SEGMENTS + (i + 1) % SEGMENTS
                faces += [(a, b, b + SEGMENTS), (a, b + SEGMENTS, a + SEGMENTS)]
    mesh = Mesh(vertices.reshape(-1, 3), normals.reshape(-1, 3), np.array(faces, dtype=np.int64), np.zeros((0, 4)))
    return mesh


def _cylinder(size: Sequence[float]) -> Mesh:
    r, h = size[0], size[1]
    return revolve([(0, -h, 0, -1), (r, -h, 0, -1), (r, -h, 1, 0), (r, h, 1, 0), (r, h, 0, 1), (0, h, 0, 1)])


def _capsule(size: Sequence[float]) -> Mesh:
    r, h = size[0], size[1] if len(size) > 1 else 0.0
    arc = np.linspace(-np.pi / 2, 0.0, 7)
    low = [(r * np.cos(a), r * np.sin(a) - h, np.cos(a), np.sin(a)) for a in arc]
    return revolve([*low, *[(x, -z, n, -m) for x, z, n, m in reversed(low)]])


def _box(size: Sequence[float]) -> Mesh:
    half = np.array(size[:3])
    vertices: list[Float] = []
    normals: list[Float] = []
    faces: list[tuple[int, int, int]] = []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            n = np.zeros(3)
            n[axis] = sign
            u, v = np.roll(np.abs(n), 1), np.roll(np.abs(n), 2) * sign
            start = len(vertices)
            vertices += [half * (n - u - v), half * (n + u - v), half * (n + u + v), half * (n - u + v)]
            normals += [n] * 4
            faces += [(start, start + 1, start + 2), (start, start + 2, start + 3)]
    return Mesh(np.array(vertices), np.array(normals), np.array(faces), np.zeros((0, 4)))


def _plane(size: Sequence[float]) -> Mesh:
    x, y = (s if 0.0 < s < 1.0 else 1.0 for s in (*size[:2], 0.0, 0.0)[:2])  # infinite ones are drawn 1 m to each side
    vertices = np.array([(-x, -y, 0.0), (x, -y, 0.0), (x, y, 0.0), (-x, y, 0.0)])
    return Mesh(vertices, np.tile([0.0, 0.0, 1.0], (4, 1)), np.array([(0, 1, 2), (0, 2, 3)]), np.zeros((0, 4)))


_MAKERS = {
    "box": _box,
    "sphere": lambda size: _capsule([size[0], 0.0]),
    "capsule": _capsule,
    "cylinder": _cylinder,
    "plane": _plane,
}


def face_normals(vertices: Float, faces: NDArray[np.int64]) -> Float:
    """Return area-weighted normals (F, 3) of triangles."""
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    return cross(b - a, c - a)


def creased(vertices: Float, faces: NDArray[np.int64]) -> Mesh:
    """Return a mesh with smooth normals except at edges sharper than 35 degrees."""
    weighted = face_normals(vertices, faces)
    flat = unit(weighted)
    corner_face, corner_vertex = np.repeat(np.arange(len(faces)), 3), faces.reshape(-1)
    order = np.argsort(corner_vertex, kind="stable")
    normals = np.empty((len(order), 3))
    for group in np.split(order, np.flatnonzero(np.diff(corner_vertex[order])) + 1):
        near = flat[corner_face[group]] @ flat[corner_face[group]].T >= np.cos(np.radians(35.0))
        normals[group] = near @ weighted[corner_face[group]]
    corners: Float = np.hstack([vertices[corner_vertex], unit(normals)])
    rows = corners.round(6)
    unique, index = np.unique(rows, axis=0, return_inverse=True)
    return Mesh(unique[:, :3], unit(unique[:, 3:]), index.reshape(-1, 3), np.zeros((0, 4)))


def section(mesh: Mesh, point: Float, normal: Float) -> Mesh:
    """Return the part of a closed mesh behind a plane, with a darker cap."""
    height = (mesh.vertices - point) @ normal
    if len(height) == 0 or height.max() <= 1e-9:
        return mesh
    if height.min() >= -1e-9:
        return EMPTY
    soup = _clipped(mesh, height)
    cap = _cap(soup, point, normal, mesh.colors[0])
    return merge([soup, cap])


def _clipped(mesh: Mesh, height: Float) -> Mesh:
    vertices: list[Float] = []
    normals: list[Float] = []
    colors: list[Float] = []
    faces: list[tuple[int, int, int]] = []
    in_plane = (np.abs(height[mesh.faces]) < 1e-9).all(axis=1)  # the cap covers them
    for face in mesh.faces[~in_plane]:
        loop = _clip_face(mesh, face, height)
        start = len(vertices)
        vertices += [v for v, _ in loop]
        normals += [n for _, n in loop]
        colors += [mesh.colors[face[0]]] * len(loop)
        faces += [(start, start + i, start + i + 1) for i in range(1, len(loop) - 1)]
    if not faces:
        return EMPTY
    return Mesh(np.array(vertices), unit(np.array(normals)), np.array(faces, dtype=np.int64), np.array(colors))


def _clip_face(mesh: Mesh, face: NDArray[np.int64], height: Float) -> list[tuple[Float, Float]]:
    """Vertices with normals of a triangle clipped by one plane (Sutherland-Hodgman)."""
    loop = []
    for i, j in zip(face, np.roll(face, -1), strict=True):
        if height[i] <= 0.0:
            loop.append((mesh.vertices[i], mesh.normals[i]))
        if (height[i] <= 0.0) != (height[j] <= 0.0):
            share = height[i] / (height[i] - height[j])
            loop.append(tuple(a[i] + share * (a[j] - a[i]) for a in (mesh.vertices, mesh.normals)))
    return loop if len(loop) > 2 else []


def _cap(soup: Mesh, point: Float, normal: Float, color: Float) -> Mesh:
    """The cross section of a closed mesh in its cut plane, in strips between edge ends."""
    side = unit(cross(normal, np.roll(np.abs(normal), 1)))
    up = cross(normal, side)
    on = np.abs((soup.vertices[soup.faces] - point) @ normal) < 1e-9
    two = on.sum(axis=1) == 2
    edges: Float = soup.vertices[soup.faces[two][on[two]].reshape(-1, 2)]  # (E, 2, 3) in the plane, along its side
    back = (edges[:, 1] - edges[:, 0]) @ side < 0.0
    edges[back] = edges[back, ::-1]
    across, along = (edges - point) @ side, (edges - point) @ up  # (E, 2) each
    ends = np.unique(across.round(9))
    corners: list[Float] = []
    for low, high in pairwise(ends.tolist()):
        at = np.array([low, high])
        met = (across[:, 0] < 0.5 * (low + high)) & (across[:, 1] > 0.5 * (low + high))
        share = (at - across[met, :1]) / np.diff(across[met], axis=1)
        heights = along[met, :1] + share * np.diff(along[met], axis=1)  # of each edge at both ends of the strip
        order = np.argsort(heights.sum(axis=1), kind="stable")
        for under, over in zip(order[::2], order[1::2], strict=False):
            (a, b), (c, d) = heights[under], heights[over]
            corners.append(np.array([[low, a], [high, b], [high, d], [low, c]]))
    if not corners:
        return EMPTY
    flat = np.concatenate(corners)
    vertices = point + flat[:, :1] * side + flat[:, 1:] * up
    faces = np.array([(i, i + 1, i + 2) if k else (i, i + 2, i + 3) for i in range(0, len(flat), 4) for k in (1, 0)])
    shaded = np.array([*(0.78 * color[:3]), color[3]])  # the cap is darker
    return Mesh(vertices, np.tile(normal, (len(flat), 1)), faces, np.tile(shaded, (len(flat), 1)))

"""Closed parts whose faces share no edge: each face divides its rim by its own draw, so that seams have T-junctions."""

from __future__ import annotations

import manifold3d
import numpy as np


def ring(radius, sides, turn=0.0):
    """Corners (N, 2) on a circle, counter-clockwise."""
    angle = turn + 2.0 * np.pi * np.arange(sides) / sides
    return radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)


def gear(root, tip, teeth):
    """A wheel of straight teeth."""
    angle = np.linspace(0.0, 2.0 * np.pi, 4 * teeth, endpoint=False)
    radius = np.where(np.arange(4 * teeth) % 4 < 2, tip, root)
    return radius[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)


def _divided(line, draw, most):
    """A closed line (N, 3) with up to `most` further points on each side."""
    found = []
    for a, b in zip(line, np.roll(line, -1, axis=0), strict=True):
        share = np.sort(draw.uniform(0.05, 0.95, draw.integers(0, most + 1)))
        found += [a, *(a + s * (b - a) for s in share)]
    return np.array(found)


def _face(rings, u, v, draw, most):
    """Triangles (T, 3, 3) of a plane face between rings (N, 3), in axes u and v of its plane."""
    lines = [_divided(line, draw, most) for line in rings]
    points = np.concatenate(lines)
    flat = [np.stack([line @ u, line @ v], axis=1) for line in lines]
    return points[np.asarray(manifold3d.triangulate(flat))]


def prism(outer, inner, low, high, bottom, draw, most=5):
    """Triangles of an upright block with a hole from its top down to `bottom`, or through where that is None."""
    x, y, z = np.eye(3)

    def at(flat, height):
        return np.column_stack([flat, np.full(len(flat), float(height))])

    holes = [] if inner is None else [inner]
    below = [] if bottom is not None else holes
    found = [_face([at(outer, high), *(at(h[::-1], high) for h in holes)], x, y, draw, most),
             _face([at(outer[::-1], low), *(at(h, low) for h in below)], y, x, draw, most)]  # fmt: skip
    if inner is not None and bottom is not None:
        found.append(_face([at(inner, bottom)], x, y, draw, most))
    walls = [(outer, low, high)] + [(h[::-1], low if bottom is None else bottom, high) for h in holes]
    for line, start, end in walls:
        for a, b in zip(line, np.roll(line, -1, axis=0), strict=True):
            corners = np.array([[*a, start], [*b, start], [*b, end], [*a, end]])
            found.append(_face([corners], np.array([*(b - a), 0.0]) / np.linalg.norm(b - a), z, draw, most))
    return np.concatenate(found)


def volume_of(triangles):
    a, b, c = np.moveaxis(np.asarray(triangles, dtype=float), 1, 0)
    return float(np.sum(a * np.cross(b, c))) / 6.0


def stl(triangles):
    """A binary STL, in single precision as every STL."""
    record = np.zeros(len(triangles), dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("rest", "<u2")])
    record["corners"] = triangles
    return b"\0" * 80 + len(triangles).to_bytes(4, "little") + record.tobytes()

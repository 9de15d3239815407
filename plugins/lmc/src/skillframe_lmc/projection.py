r"""Azimuthal equidistant projection of directions about a centre, in degrees.

A direction at the angle a from the centre is drawn at the distance a, up to 180 degrees.
"""

from __future__ import annotations

import numpy as np

from skillframe.frames import Float, cross, norm, unit


class Plane:
    """A projection plane.

    Attributes:
        centre: (3,) direction drawn at the origin.
        right, up: (3,) unit tangents: the projected axes of the frame nearest to the plane.
        labels: their names.
    """

    def __init__(self, centre: Float) -> None:
        self.centre = centre
        order = np.argsort(np.abs(centre), kind="stable")
        a, b = sorted(order[:2].tolist())
        self.right = unit(np.eye(3)[a] - centre[a] * centre)
        self.up = cross(centre, self.right)
        self.up = self.up * np.copysign(1.0, self.up[b])
        self.labels = "xyz"[a], "xyz"[b]

    def to_plane(self, directions: Float) -> Float:
        """Points (C, 2) in degrees of directions (C, 3)."""
        flat = np.stack([directions @ self.right, directions @ self.up], axis=-1)
        length = norm(flat)
        angle = np.degrees(np.arctan2(length, directions @ self.centre))
        result: Float = flat * (angle / np.where(length > 1e-12, length, 1.0))[..., None]
        return result

    def to_sphere(self, points: Float) -> Float:
        """Directions (C, 3) of points (C, 2) in degrees."""
        angle = norm(points)
        flat = points / np.where(angle > 1e-12, angle, 1.0)[..., None]
        tangent = flat[..., :1] * self.right + flat[..., 1:] * self.up
        radians = np.radians(angle)[..., None]
        result: Float = np.cos(radians) * self.centre + np.sin(radians) * tangent
        return result


def outline(v: Float, m: Float, contact: bool, alpha: float, count: int = 24) -> Float:
    """Directions (C, 3) around the pyramid of one interval: a strip along its sector, or a cone where free."""
    beta = max(np.radians(5.0), alpha / 3.0)
    if not contact:
        first = unit(np.eye(3)[np.argmin(np.abs(v))] - v[np.argmin(np.abs(v))] * v)
        turn = np.linspace(0.0, 2.0 * np.pi, 2 * count)[:, None]
        edge = np.cos(turn) * first + np.sin(turn) * cross(v, first)
        return unit(np.cos(alpha + beta) * v + np.sin(alpha + beta) * edge)
    n = unit(cross(v, m))
    e = cross(n, v)
    angle = np.linspace(-beta, float(np.arctan2(m @ e, m @ v)) + beta, count)[:, None]
    along = np.cos(angle) * v + np.sin(angle) * e
    upper, lower = np.cos(alpha) * along + np.sin(alpha) * n, np.cos(alpha) * along - np.sin(alpha) * n
    return np.concatenate([upper, lower[::-1]])

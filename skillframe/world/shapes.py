"""Parametric shapes of fixtures and tools, as primitives and convex meshes, in the frame named by each function."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float, quaternion_from_matrix, rotation_matrix
from skillframe.world.scene import Geom

TOOL_COLOUR = (0.85, 0.45, 0.15, 1.0)
"""Red, green, blue and opacity of tools."""
FIXTURE_COLOUR = (0.55, 0.62, 0.70, 1.0)


def quaternion_about(axis: str, angle: float) -> tuple[float, float, float, float]:
    """Quaternion x, y, z, w of a rotation about "x", "y" or "z" [rad]."""
    vector = np.zeros(3)
    vector["xyz".index(axis)] = angle
    x, y, z, w = quaternion_from_matrix(rotation_matrix(vector))
    return (float(x), float(y), float(z), float(w))


def surface_of_revolution(profile: Float, segments: int) -> tuple[Float, NDArray[np.int64]]:
    """Vertices and triangles of a profile turned about z.

    Args:
        profile: (P, 2) radius and height from the lower to the upper end [m]; the ends are closed by flat lids.
        segments: number of vertices per ring, on the circle (the polygon is inscribed).
    """
    angle = 2.0 * np.pi * np.arange(segments) / segments
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    rings = [np.column_stack([radius * circle, np.full(segments, height)]) for radius, height in profile]
    vertices = np.concatenate(rings)
    faces: list[tuple[int, int, int]] = []
    for ring in range(len(profile) - 1):
        for i in range(segments):
            a, b = ring * segments + i, ring * segments + (i + 1) % segments
            faces += [(a, b, b + segments), (a, b + segments, a + segments)]
    top = (len(profile) - 1) * segments
    faces += [(0, i + 1, i) for i in range(1, segments - 1)]
    faces += [(top, top + i, top + i + 1) for i in range(1, segments - 1)]
    return vertices, np.array(faces, dtype=np.int64)


def filleted_peg(radius: float, length: float, fillet: float, segments: int, tip_height: float) -> Geom:
    """A peg along +z with a rounded lower edge at its tip: convex mesh with the tip face at z = `tip_height`.

    The fillet is an arc of 6 steps. In the tool frame the peg points along +z, so its tip is its upper end.
    """
    arc = np.linspace(0.0, 0.5 * np.pi, 7)
    rounded = np.column_stack([radius - fillet + fillet * np.cos(arc), tip_height - fillet + fillet * np.sin(arc)])
    profile = np.vstack([[radius, tip_height - length], rounded])
    vertices, faces = surface_of_revolution(profile, segments)
    return Geom(kind="mesh", vertices=vertices, faces=faces, rgba=TOOL_COLOUR)


def hole(radius: float, depth: float, boxes: int, wall: float) -> tuple[Geom, ...]:
    """A blind hole opening at z = 0 around the z axis: a ring of boxes tangent to the circle, and a bottom.

    The ring is circumscribed, so that the play is never less than stated; it exceeds it at the corners by
    radius (1/cos(pi/boxes) - 1), 0.08 mm for 16.75 mm and 32 boxes.
    """
    half_width = (radius + wall) * np.tan(np.pi / boxes)
    ring = []
    for k in range(boxes):
        angle = 2.0 * np.pi * k / boxes
        centre = (radius + 0.5 * wall) * np.array([np.cos(angle), np.sin(angle)])
        ring.append(
            Geom(
                kind="box", size=(0.5 * wall, float(half_width), 0.5 * depth), rgba=FIXTURE_COLOUR,
                position=(float(centre[0]), float(centre[1]), -0.5 * depth), quaternion=quaternion_about("z", angle),
            )
        )  # fmt: skip
    bottom = Geom(
        kind="box", size=(radius + wall, radius + wall, 0.01), position=(0.0, 0.0, -depth - 0.01), rgba=FIXTURE_COLOUR
    )
    return (*ring, bottom)


def slope(angle: float, azimuth: float, length: float, width: float, thickness: float = 0.02) -> Geom:
    """A plate whose upper surface rises from the origin at `angle` towards `azimuth` (both [rad], fixture frame)."""
    along = np.array([np.cos(angle), 0.0, np.sin(angle)])
    normal = np.array([-np.sin(angle), 0.0, np.cos(angle)])
    turn = rotation_matrix(np.array([0.0, 0.0, azimuth]))
    axes = turn @ np.column_stack([along, [0.0, 1.0, 0.0], normal])
    centre = turn @ (0.5 * length * along - 0.5 * thickness * normal)
    x, y, z, w = quaternion_from_matrix(axes)
    return Geom(
        kind="box", size=(0.5 * length, 0.5 * width, 0.5 * thickness), rgba=FIXTURE_COLOUR,
        position=(float(centre[0]), float(centre[1]), float(centre[2])),
        quaternion=(float(x), float(y), float(z), float(w)),
    )  # fmt: skip


def shaft(radius: float, start: float, stop: float, visible: bool = True) -> Geom:
    """A capsule along z from `start` to `stop` that is drawn and touches nothing (a handle, a mount)."""
    return Geom(
        kind="capsule", size=(radius, 0.5 * (stop - start)), position=(0.0, 0.0, 0.5 * (start + stop)),
        rgba=(0.35, 0.37, 0.42, 1.0), collide=False, visible=visible,
    )  # fmt: skip

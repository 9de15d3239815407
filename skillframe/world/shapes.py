"""Parametric primitives and convex meshes of fixtures and tools, and common parts of scenes: a tool, goals, checks."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skillframe.config import require_ranges
from skillframe.errors import InputError
from skillframe.frames import Float, norm, quaternion_from_matrix, rotation_matrix
from skillframe.world.scene import Geom, State, Tool, Way

TOOL_COLOUR = (0.85, 0.45, 0.15, 1.0)
"""RGBA of tools."""
FIXTURE_COLOUR = (0.55, 0.62, 0.70, 1.0)  #: red, green, blue, opacity


def quaternion_about(axis: str, angle: float) -> tuple[float, float, float, float]:
    """Quaternion x, y, z, w of a rotation about "x", "y" or "z" [rad]."""
    vector = np.zeros(3)
    vector["xyz".index(axis)] = angle
    x, y, z, w = quaternion_from_matrix(rotation_matrix(vector))
    return (float(x), float(y), float(z), float(w))


def surface_of_revolution(profile: Float, segments: int) -> tuple[Float, NDArray[np.int64]]:
    """Vertices and triangles of a profile (P, 2) of radius and height [m], closed by lids and rotated about z."""
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
    """Convex mesh of a peg along +z with a filleted edge at its tip, z = `tip_height`."""
    arc = np.linspace(0.0, 0.5 * np.pi, 7)
    rounded = np.column_stack([radius - fillet + fillet * np.cos(arc), tip_height - fillet + fillet * np.sin(arc)])
    profile = np.vstack([[radius, tip_height - length], rounded])
    vertices, faces = surface_of_revolution(profile, segments)
    return Geom(kind="mesh", vertices=vertices, faces=faces, rgba=TOOL_COLOUR)


def hole(radius: float, depth: float, boxes: int, wall: float) -> tuple[Geom, ...]:
    """A blind hole that opens at z = 0 around the z axis: a ring of boxes tangent to the circle, and a bottom."""
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
    """A plate whose upper surface rises from the origin at `angle` towards `azimuth` (both [rad])."""
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


def shaft(radius: float, start: float, stop: float) -> Geom:
    """A drawn capsule along z from `start` to `stop` without contact."""
    return Geom(
        kind="capsule", size=(radius, 0.5 * (stop - start)), position=(0.0, 0.0, 0.5 * (start + stop)),
        rgba=(0.35, 0.37, 0.42, 1.0), collide=False,
    )  # fmt: skip


TOOL_DOWN = (1.0, 0.0, 0.0, 0.0)
"""Orientation in the fixture frame of a tool that points down (tool z = fixture -z)."""
WRIST_TO_TIP = 0.2  #: length of the tools of the test worlds [m]
TOOL_MASS = 0.6
FLOOR = 0.002
"""Clearance [m] outside a hole's floor or edge, more than contacts penetrate."""


def tool(geoms: tuple[Geom, ...], tip: float = WRIST_TO_TIP, hand: str = "wrist") -> Tool:
    """A 0.6 kg tool along +z with its tip `tip` metres from the wrist and its mass centred half way."""
    inertia = TOOL_MASS * tip**2 / 12.0 / 2.0
    return Tool(
        geoms=geoms, mass=TOOL_MASS, center_of_mass=(0.0, 0.0, 0.5 * tip), inertia=(inertia, inertia, 2e-4),
        frames={"wrist": (0.0, 0.0, 0.0), "tip": (0.0, 0.0, tip), "grip": (0.0, 0.0, tip - 0.04)}, hand=hand,
    )  # fmt: skip


def tilt_of(state: State) -> Float:
    """Angle (N,) [rad] between the tool's axis and the fixture's -z."""
    axis = state.tip.rotation[..., :, 2]
    return np.arctan2(norm(axis[..., :2]), -axis[..., 2])


def insertion(depth: float, radius: float) -> Way:
    """Depth of the tip in a hole of depth and peg radius [m] that opens upwards at the fixture's origin."""

    def reached(state: State) -> Float:
        tip = state.tip.position
        inside: Float = np.where(norm(tip[..., :2]) < radius, np.clip(-tip[..., 2], 0.0, None), 0.0)
        return inside

    return Way("inserted", depth, reached)


def no_error(state: State) -> tuple[Float, Float]:
    """Zero errors of a scene without a goal."""
    zero = np.zeros(len(state.tip.position))
    return zero, zero


def anywhere(state: State) -> NDArray[np.bool_]:
    """Always True: the goal of a scene that has none."""
    return np.ones(len(state.tip.position), dtype=bool)


def require(world: str, checks: dict[str, bool], params: Any = None) -> None:
    """Refuse invalid parameters, by results of rules and ranges of a dataclass.

    Raises:
        InputError: names the value or rule.
    """
    require_ranges(params, f"world {world}")
    for text, fine in checks.items():
        if not fine:
            raise InputError(f"world {world}", f"needs {text}", "change the parameter with --set world.KEY=VALUE")


Lift = Callable[[Float, Float], Float]


def tilt_lift(radius: float) -> Lift:
    """Lift by which the tilted edge of a tool of radius r [m] clears the plate: r |sin tilt|."""
    return lambda offset, tilt: radius * np.abs(np.sin(norm(tilt)))

"""Content of a scene: boxes, cylinders, meshes and moving bodies, in its own frame [m, rad]."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from skillframe.errors import InputError
from skillframe.frames import Float, rotation_matrix


@dataclass(frozen=True, slots=True, kw_only=True)
class Shape:
    """A box, cylinder or mesh of a scene.

    Attributes:
        name: for messages.
        kind: "box", "cylinder" (along its z) or "mesh".
        size: edges of a box, radius and length of a cylinder, scale of a mesh file.
        rotation: (3, 3) of the shape in the scene; origin: (3,) [m].
        file: of a mesh, or None where `vertices` (V, 3) and `faces` (F, 3) are given.
    """

    name: str
    kind: str
    size: tuple[float, ...] = ()
    rotation: Float
    origin: Float
    file: Path | None = None
    vertices: Float = field(default_factory=lambda: np.zeros((0, 3)))
    faces: NDArray[np.int64] = field(default_factory=lambda: np.zeros((0, 3), dtype=np.int64))


@dataclass(frozen=True, slots=True, kw_only=True)
class Moving:
    """A moving body of a scene, with the keys of a `SecondPart`, in the scene's frame."""

    name: str
    joint: str
    shapes: tuple[Shape, ...]
    mass: float | None = None
    anchor: Float = field(default_factory=lambda: np.zeros(3))
    axis: Float = field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))
    range: tuple[float, float] | None = None
    stiffness: float = 0.0
    rest: float = 0.0
    damping: float = 0.0
    friction: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class DrawnScene:
    """Content of a scene file: fixed shapes, moving bodies, and names of mesh files."""

    fixed: tuple[Shape, ...]
    moving: tuple[Moving, ...]
    meshes: tuple[Path, ...]


def turned(rpy: tuple[float, float, float]) -> Float:
    """Rotation (3, 3) of roll, pitch and yaw about fixed x, y, z."""
    roll, pitch, yaw = (rotation_matrix(angle * np.eye(3)[k]) for k, angle in enumerate(rpy))
    found: Float = yaw @ pitch @ roll
    return found


def refuse(path: Path, element: ET.Element | str, why: str = "is not read") -> InputError:
    """Return an error that names an element."""
    said = element if isinstance(element, str) else f"<{element.tag}>"
    return InputError(path, f"{said} {why}", "leave it out; boxes, cylinders and meshes on joints are read")

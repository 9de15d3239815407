"""A drawn scene, MJCF or SDFormat, as what stands in it and what moves: boxes, cylinders and meshes on joints.

Lengths are metres, angles radians, and all places are in the scene's own frame as it stands at the start. Friction and
contact are the fixture file's. What only shows (visuals, lights, cameras, sensors) is passed over; what would change
how things move and is not read here is refused by name.
"""

from __future__ import annotations

import dataclasses
import xml.etree.ElementTree as ET
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from skillframe.errors import InputError
from skillframe.frames import Float, rotation_matrix
from skillframe.robot.urdf import parse_xml, read_bytes

if TYPE_CHECKING:
    from skillframe.parts.second_declared import MeshPlace, SecondPart

ENDINGS = (".xml", ".mjcf", ".sdf")


@dataclass(frozen=True, slots=True, kw_only=True)
class Shape:
    """A box, cylinder or mesh of a scene.

    Attributes:
        name: for messages.
        kind: "box", "cylinder" (along its z) or "mesh".
        size: edges of a box, radius and length of a cylinder, scale of a mesh file.
        rotation: (3, 3) of the shape in the scene; origin: (3,) [m].
        file: of a mesh that is still to be read, or None where `vertices` (V, 3) and `faces` (F, 3) are given.
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
    """A body of a scene that moves. Keys as those of a `SecondPart`, in the scene's frame."""

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
    """What a file holds.

    Attributes:
        fixed: shapes that stand; moving: bodies that do not; meshes: the files that it names.
    """

    fixed: tuple[Shape, ...]
    moving: tuple[Moving, ...]
    meshes: tuple[Path, ...]


def is_scene(name: str) -> bool:
    """Whether a part's file is a scene, by its ending."""
    return Path(name).suffix.lower() in ENDINGS


def read_scene(path: Path) -> DrawnScene:
    """A scene by what is in its file.

    Raises:
        InputError: it cannot be read, or holds what is not read here; names the element.
    """
    from skillframe.parts.mjcf import read_mjcf
    from skillframe.parts.sdformat import read_sdformat

    root = parse_xml(path, read_bytes(path, "a scene"), text=True)
    readers = {"mujoco": read_mjcf, "sdf": read_sdformat}
    if root.tag not in readers:
        what = f"is an XML file of <{root.tag}>, no scene"
        raise InputError(path, what, "give MJCF (<mujoco>) or SDFormat (<sdf>)")
    return readers[root.tag](path, root)


def standing(path: Path) -> tuple[Shape, ...]:
    """The shapes of a scene that stand.

    Raises:
        InputError: as `read_scene`, or nothing stands.
    """
    found = read_scene(path)
    if not found.fixed:
        fix = "leave out a body's joint, or in SDFormat say <static>true</static>"
        raise InputError(path, "has nothing that stands and collides", fix)
    return found.fixed


def one_piece(path: Path) -> tuple[Shape, ...]:
    """The shapes of a scene that is one part: all that stands, or the one body that is free.

    Raises:
        InputError: as `read_scene`, or it is more than one piece.
    """
    found = read_scene(path)
    bodies = [*([found.fixed] if found.fixed else []), *(each.shapes for each in found.moving)]
    if len(bodies) != 1 or any(each.joint != "free" for each in found.moving):
        raise InputError(path, "is not one piece, as the held part is", "leave one body in it, without joints")
    return bodies[0]


def with_bodies(declared: tuple[SecondPart, ...], path: Path, scene: str, place: MeshPlace) -> tuple[SecondPart, ...]:
    """Second parts, with the bodies of a scene that move. One of joint "scene" gives such a body its goal.

    Args:
        declared: as the fixture file says.
        path: of the fixture file.
        scene: name of the scene relative to it.
        place: where the scene lies.

    Raises:
        InputError: as `read_scene`, or there is no such body.
    """
    moving = {each.name: each for each in read_scene(path.parent / scene).moving}
    goals = {part.name: part.goal for part in declared if part.joint == "scene"}
    for index, part in enumerate(declared):
        if part.joint == "scene" and part.name not in moving:
            what = f"{scene} has no body {part.name!r} that moves (there are: {', '.join(moving) or 'none'})"
            raise InputError(f"{path}: second[{index}].name", what, "give the name of one of them")
    own = tuple(part for part in declared if part.joint != "scene")
    return own + tuple(_declared(each, scene, place, goals.get(each.name)) for each in moving.values())


def _declared(body: Moving, scene: str, place: MeshPlace, goal: tuple[float, float] | None) -> SecondPart:
    from skillframe.parts.second_declared import SecondPart

    turn = turned(place.rpy)
    jointed = {"anchor": turn @ body.anchor + np.array(place.xyz)} if body.joint == "hinge" else {}
    jointed |= {"axis": turn @ body.axis} if body.joint != "free" else {}
    kept = {name: getattr(body, name) for name in ("mass", "range", "stiffness", "rest", "damping", "friction")}
    made = SecondPart(name=body.name, joint="fixed", mesh=scene, pose=place, goal=goal)
    given = {key: tuple(float(x) for x in value) for key, value in jointed.items()}
    return dataclasses.replace(made, joint=body.joint, **kept, **given)  # type: ignore[arg-type]


def turned(rpy: tuple[float, float, float]) -> Float:
    """The rotation (3, 3) of roll, pitch and yaw about fixed x, y, z."""
    roll, pitch, yaw = (rotation_matrix(angle * np.eye(3)[k]) for k, angle in enumerate(rpy))
    found: Float = yaw @ pitch @ roll
    return found


def refuse(path: Path, element: ET.Element | str, why: str = "is not read") -> InputError:
    """One sentence that names an element, to be raised."""
    said = element if isinstance(element, str) else f"<{element.tag}>"
    return InputError(path, f"{said} {why}", "leave it out; boxes, cylinders and meshes on joints are read")

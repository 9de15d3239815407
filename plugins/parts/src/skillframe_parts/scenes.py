"""Reads a scene, MJCF or SDFormat: boxes, cylinders and meshes that stand or move on joints.

Units are metres and radians, poses are in the scene's frame at the start. Friction and contact are the fixture file's.
Visuals, lights, cameras and sensors are ignored; unsupported elements that affect motion are refused.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from skillframe.errors import InputError
from skillframe.files.documents import parse_xml, read_bytes
from skillframe_parts.mjcf import read_mjcf
from skillframe_parts.sdformat import read_sdformat
from skillframe_parts.shapes import DrawnScene, Shape, turned

if TYPE_CHECKING:
    from skillframe_parts.second_declared import MeshPlace, SecondPart

ENDINGS = (".xml", ".mjcf", ".sdf")


def is_scene(name: str) -> bool:
    """Whether a part's file is a scene, by its suffix."""
    return Path(name).suffix.lower() in ENDINGS


def read_scene(path: Path) -> DrawnScene:
    """A scene, by the content of its file.

    Raises:
        InputError: it cannot be read, or has an unsupported element.
    """
    root = parse_xml(path, read_bytes(path, "a scene"), text=True)
    readers = {"mujoco": read_mjcf, "sdf": read_sdformat}
    if root.tag not in readers:
        what = f"is an XML file of <{root.tag}>, no scene"
        raise InputError(path, what, "give MJCF (<mujoco>) or SDFormat (<sdf>)")
    return readers[root.tag](path, root)


def standing(path: Path) -> tuple[Shape, ...]:
    """The fixed shapes of a scene.

    Raises:
        InputError: as `read_scene`, or there are none.
    """
    found = read_scene(path)
    if not found.fixed:
        fix = "leave out a body's joint, or in SDFormat say <static>true</static>"
        raise InputError(path, "has nothing that stands and collides", fix)
    return found.fixed


def one_piece(path: Path) -> tuple[Shape, ...]:
    """The shapes of a scene that is one part: everything fixed, or one free body.

    Raises:
        InputError: as `read_scene`, or it is more than one piece.
    """
    found = read_scene(path)
    bodies = [*([found.fixed] if found.fixed else []), *(each.shapes for each in found.moving)]
    if len(bodies) != 1 or any(each.joint != "free" for each in found.moving):
        raise InputError(path, "is not one piece, as the held part is", "leave one body in it, without joints")
    return bodies[0]


def with_bodies(declared: tuple[SecondPart, ...], path: Path, scene: str, place: MeshPlace) -> tuple[SecondPart, ...]:
    """Second parts with the moving bodies of a scene. One of joint "scene" gives such a body its goal.

    Raises:
        InputError: as `read_scene`, or there is no such body.
    """
    from skillframe_parts.second_declared import SecondPart

    moving = {each.name: each for each in read_scene(path.parent / scene).moving}
    goals = {part.name: part.goal for part in declared if part.joint == "scene"}
    for index, part in enumerate(declared):
        if part.joint == "scene" and part.name not in moving:
            what = f"{scene} has no body {part.name!r} that moves (there are: {', '.join(moving) or 'none'})"
            raise InputError(f"{path}: second[{index}].name", what, "give the name of one of them")
    turn, own = turned(place.rpy), [part for part in declared if part.joint != "scene"]
    for body in moving.values():
        jointed = {"anchor": turn @ body.anchor + np.array(place.xyz)} if body.joint == "hinge" else {}
        jointed |= {"axis": turn @ body.axis} if body.joint != "free" else {}
        kept = {name: getattr(body, name) for name in ("mass", "range", "stiffness", "rest", "damping", "friction")}
        made = SecondPart(name=body.name, joint="fixed", mesh=scene, pose=place, goal=goals.get(body.name))
        given = {key: tuple(float(x) for x in value) for key, value in jointed.items()}
        own.append(dataclasses.replace(made, joint=body.joint, **kept, **given))  # type: ignore[arg-type]
    return tuple(own)

"""What a robot looks like: the primitive visuals of its URDF, as geoms of the bodies that joints move.

Meshes are left out: a URDF's links that are only meshes are drawn as capsules between their joints.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Container, Iterator, Mapping

import numpy as np
import pinocchio as pin

from skillframe.frames import norm, quaternion_from_matrix
from skillframe.robot.model import RobotModel
from skillframe.world.scene import Geom

LINK_COLOUR = (0.86, 0.87, 0.89, 1.0)


def link_geoms(robot: RobotModel) -> dict[str, tuple[Geom, ...]]:
    """Geoms by joint name (the name of the body that the joint moves), in that body's frame."""
    model = robot.model
    found: dict[str, list[Geom]] = {name: [] for name in model.names}
    root = ET.parse(robot.spec.urdf).getroot()
    materials = {material.get("name", ""): material for material in root.findall("material")}
    for link in root.findall("link"):
        name = link.get("name", "")
        if not model.existBodyName(name):
            continue
        frame = model.frames[model.getBodyId(name)]
        for visual in link.findall("visual"):
            geom = placed_geom(visual, frame.placement, materials)
            if geom is not None:
                found[model.names[frame.parentJoint]].append(geom)
    for name, bone in bones(model, {name for name, geoms in found.items() if geoms}):
        found[name].append(bone)
    return {name: tuple(geoms) for name, geoms in found.items()}


def bones(model: pin.Model, shaped: Container[str]) -> Iterator[tuple[str, Geom]]:
    """A capsule from its joint to the next for every body that has no shape, by name of the joint that moves it."""
    boned: set[str] = set()
    for joint in range(2, model.njoints):
        parent = model.names[model.parents[joint]]
        reach = np.array(model.jointPlacements[joint].translation)
        if parent not in shaped and parent not in boned and norm(reach) > 0.02:
            boned.add(parent)
            yield parent, _bone(reach)


def placed_geom(visual: ET.Element, placement: pin.SE3, materials: Mapping[str, ET.Element]) -> Geom | None:
    """The primitive of a `<visual>` or `<collision>` of a link that is placed so in its body, or None for a mesh."""
    shape = visual.find("geometry")
    child = None if shape is None else next(iter(shape), None)
    if child is None:
        return None
    origin = visual.find("origin")
    at = placement * _origin(origin)
    size: tuple[float, ...]
    if child.tag == "box":
        kind, size = "box", tuple(0.5 * float(v) for v in child.get("size", "0 0 0").split())
    elif child.tag == "sphere":
        kind, size = "sphere", (float(child.get("radius", 0)),)
    elif child.tag in ("cylinder", "capsule"):
        kind, size = child.tag, (float(child.get("radius", 0)), 0.5 * float(child.get("length", 0)))
    else:
        return None
    x, y, z, w = (float(v) for v in quaternion_from_matrix(at.rotation))
    px, py, pz = (float(v) for v in at.translation)
    return Geom(
        kind=kind,
        size=size,
        position=(px, py, pz),
        quaternion=(x, y, z, w),
        rgba=_colour(visual, materials),
        collide=False,
    )


def _origin(origin: ET.Element | None) -> pin.SE3:
    if origin is None:
        return pin.SE3.Identity()
    xyz = np.array([float(v) for v in origin.get("xyz", "0 0 0").split()])
    roll, pitch, yaw = (float(v) for v in origin.get("rpy", "0 0 0").split())
    return pin.SE3(pin.rpy.rpyToMatrix(roll, pitch, yaw), xyz)


def _colour(visual: ET.Element, materials: Mapping[str, ET.Element]) -> tuple[float, float, float, float]:
    """Of the visual's own material, or of the robot's material of that name."""
    material = visual.find("material")
    colour = None if material is None else material.find("color")
    if colour is None and material is not None and material.get("name", "") in materials:
        colour = materials[material.get("name", "")].find("color")
    if colour is None:
        return LINK_COLOUR
    r, g, b, a = (float(v) for v in colour.get("rgba", "0.8 0.8 0.8 1").split())
    return (r, g, b, a)


def _bone(reach: np.ndarray) -> Geom:
    """A capsule from the body's origin to its child joint."""
    rotation = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), reach / norm(reach)).matrix()
    x, y, z, w = (float(v) for v in quaternion_from_matrix(rotation))
    middle = 0.5 * reach
    return Geom(
        kind="capsule", size=(0.04, float(0.5 * norm(reach))), position=(middle[0], middle[1], middle[2]),
        quaternion=(x, y, z, w), rgba=LINK_COLOUR, collide=False,
    )  # fmt: skip

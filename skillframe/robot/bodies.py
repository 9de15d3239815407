r"""Rigid bodies of a URDF, links joined by fixed joints, and their sizes.

A body's size is the distance from its joint to child joints and geometry.
"""

from __future__ import annotations

import copy
import xml.etree.ElementTree as ET
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from skillframe.frames import Float, Pose, rotation_matrix
from skillframe.robot.meshes import mesh_vertices, resolve_mesh
from skillframe.robot.urdf import Joint, Urdf, numbers

_ZERO3 = (0.0, 0.0, 0.0)


@dataclass(slots=True, kw_only=True)
class Body:
    """A rigid body.

    Attributes:
        joint: that moves it, None for the root; parent: index, or -1.
        links: names, the one at the joint first.
        reach: to child joints and geometry [m], or 0; bound: a lower bound only.
        meshes: longest edge of each bounding box [m], by file name.
        far: (3,) farthest child joint, in body axes [m].
        guess: guessed mass [kg] or 0; doubted: its own mass is a placeholder.
    """

    joint: str | None
    parent: int = -1
    links: list[str] = field(default_factory=list)
    reach: float = 0.0
    bound: bool = False
    meshes: dict[str, float] = field(default_factory=dict)
    far: Float = field(default_factory=lambda: np.zeros(3))
    guess: float = 0.0
    doubted: bool = False


def rigid_bodies(urdf: Urdf) -> list[Body]:
    """Return the bodies of a tree, root first."""
    children = urdf.children()
    bodies: list[Body] = []
    heads: list[tuple[str | None, str, int]] = [(None, urdf.root, -1)]
    for index, (joint, head, parent) in enumerate(heads):
        body = Body(joint=joint, parent=parent)
        heads += [(*leaving, index) for leaving in _gather(body, urdf, children, head)]
        bodies.append(body)
    return bodies


def size_of(body: Body, bodies: list[Body]) -> float:
    """Size of a body [m], else the largest of the robot, else 0."""
    if body.reach > 0.0 and not body.bound:
        return body.reach
    return max(b.reach for b in [body, *bodies])


def missing_meshes(urdf: Urdf) -> dict[str, str]:
    """File names of missing meshes, each with the first link that uses it."""
    missing: dict[str, str] = {}
    for name, link in urdf.links.items():
        for mesh in link.findall("*/geometry/mesh"):
            uri = mesh.get("filename", "")
            if uri and uri not in missing and resolve_mesh(uri, urdf.path) is None:
                missing[uri] = name
    return missing


def without_meshes(urdf: Urdf) -> Urdf:
    """Tree with empty mesh file names."""
    links = {name: copy.deepcopy(link) for name, link in urdf.links.items()}
    for link in links.values():
        for mesh in link.findall("*/geometry/mesh"):
            mesh.set("filename", "")
    return urdf._replace(links=links)


def placement(element: ET.Element | None) -> Pose:
    """Pose given by the <origin> of an element, in fixed-axis roll, pitch, yaw."""
    origin = element.find("origin") if element is not None else None
    roll, pitch, yaw = np.diag(numbers(origin, "rpy", 3, _ZERO3))
    rotation = rotation_matrix(yaw) @ rotation_matrix(pitch) @ rotation_matrix(roll)
    return Pose(np.array(numbers(origin, "xyz", 3, _ZERO3)), rotation)


def _gather(body: Body, urdf: Urdf, children: dict[str, list[Joint]], head: str) -> list[tuple[str, str]]:
    """Add the links fixed to `head`, and return the joints that leave the body."""
    leaving: list[tuple[str, str]] = []
    links = [(head, Pose(np.zeros(3), np.eye(3)))]
    for name, pose in links:
        body.links.append(name)
        link = urdf.links[name]
        for drawn in [*link.findall("visual"), *link.findall("collision")]:
            for shape in drawn.findall("geometry/*"):
                points = _points(shape, urdf.path)
                if points is None:
                    body.bound = True
                    continue
                if shape.tag == "mesh":
                    body.meshes[shape.get("filename", "")] = float(np.ptp(points, axis=0).max())
                placed = pose.compose(placement(drawn))
                world = points @ placed.rotation.T + placed.position
                body.reach = max(body.reach, float(np.linalg.norm(world, axis=1).max()))
        for joint in children[name]:
            inside = pose.compose(placement(joint.element))
            distance = float(np.linalg.norm(inside.position))
            if distance > np.linalg.norm(body.far):
                body.far = inside.position
            body.reach = max(body.reach, distance)
            if joint.type == "fixed":
                links.append((joint.child, inside))
            else:
                leaving.append((joint.name, joint.child))
    return leaving


def _points(shape: ET.Element, path: Path) -> Float | None:
    """Points that span a shape, in its own axes, or None."""
    corners = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
    if shape.tag == "box":
        extent: Float = 0.5 * np.array(numbers(shape, "size", 3, _ZERO3))
        return np.asarray(corners * extent)
    if shape.tag == "mesh":
        file = resolve_mesh(shape.get("filename", ""), path)
        vertices = mesh_vertices(file) if file else None
        return None if vertices is None else vertices * mesh_scale(shape)
    if shape.tag not in ("sphere", "cylinder", "capsule"):
        return None
    radius = numbers(shape, "radius", 1, (0.0,))[0]
    half = 0.5 * numbers(shape, "length", 1, (0.0,))[0]
    axes = np.vstack([np.eye(3), -np.eye(3)]) * radius
    if shape.tag == "cylinder":
        axes[:, 2] = 0.0
    along = np.array([[0.0, 0.0, half]])
    return np.vstack([axes + along, axes - along])


def mesh_scale(mesh: ET.Element) -> Float:
    """(3,) scale of a <mesh>, 1 where none can be read."""
    try:
        return np.array(numbers(mesh, "scale", 3, (1.0, 1.0, 1.0)))
    except ValueError:
        return np.ones(3)

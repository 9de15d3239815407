"""Shapes of a robot's links, to tell whether one of them stands in the fixture.

Of each link its `<collision>` shapes count, where one of them can be read, else its `<visual>` shapes. A body that has
neither (meshes that are not there, or of a kind that is not read) counts as a capsule from its joint to the next, as it
is drawn. Links at and beyond an arm's tool frame, and a payload, are the tool: they are meant to touch. Our choice.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterator
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from skillframe.frames import Float, Pose, cross, norm
from skillframe.robot.bodies import mesh_scale
from skillframe.robot.bodies import placement as origin_of
from skillframe.robot.convexity import hull_of, is_convex, open_edges
from skillframe.robot.meshes import LARGEST_FILE, mesh_triangles, resolve_mesh
from skillframe.robot.model import RobotModel
from skillframe.robot.thinning import FINE, MOST, thinned
from skillframe.world.scene import Geom
from skillframe.world.visuals import bones, placed_geom

SPACING, MOST_PIECES = 0.005, 200
"""Distance of points on a link's mesh [m], and parts of an edge at most."""
SMALLEST_VOLUME = 1e-12  # m3; of a cube of 0.1 mm
MANY = 20_000
"""Triangles beyond which a mesh is thinned out."""


class LinkShape(NamedTuple):
    """A shape of a link: convex, in the frame of the body that a joint moves.

    Attributes:
        link: name of the URDF's link; body: name of the joint that moves it, "universe" for what stands still.
        surface: (P, 3) points of the surface where the geom is only the hull of a mesh that is not convex; else None.
        tool: it is at or beyond a tool frame, or carried.
        guessed: nothing of the body is drawn; the shape is a capsule from its joint to the next.
    """

    link: str
    body: str
    geom: Geom
    surface: Float | None = None
    tool: bool = False
    guessed: bool = False


def link_shapes(robot: RobotModel) -> list[LinkShape]:
    """Shapes of every link, in the order of the URDF, then those that are guessed."""
    tool = tool_links(robot)
    found: list[LinkShape] = []
    for name, link in robot.urdf.links.items():
        if robot.model.existBodyName(name):
            frame = robot.model.frames[robot.model.getBodyId(name)]
            found += [shape._replace(tool=name in tool) for shape in _shapes_of(robot, name, link, frame)]
    heads = {joint.name: joint.child for joint in robot.urdf.joints.values()}
    for joint, bone in bones(robot.model, {shape.body for shape in found}):
        head = heads.get(joint, robot.urdf.root)
        found.append(LinkShape(head, joint, bone, tool=head in tool, guessed=True))
    return found


def tool_links(robot: RobotModel) -> set[str]:
    """Links at and beyond the tool frames, and what is carried."""
    children = robot.urdf.children()
    layer = [arm.tool_frame for arm in robot.spec.arm]
    layer += [] if robot.spec.payload is None else [robot.spec.payload.link]
    tool: set[str] = set()
    while layer:
        tool.update(layer)
        layer = [joint.child for link in layer for joint in children.get(link, [])]
    return tool


def _shapes_of(robot: RobotModel, name: str, link: ET.Element, frame: pin.Frame) -> list[LinkShape]:
    body = robot.model.names[frame.parentJoint]
    for tag in ("collision", "visual"):
        made = [_shape(robot, element, frame.placement) for element in link.findall(tag)]
        shapes = [LinkShape(name, body, *pair) for pair in made if pair is not None]
        if shapes:
            return shapes
    return []


def _shape(robot: RobotModel, element: ET.Element, placement: pin.SE3) -> tuple[Geom, Float | None] | None:
    """A shape as a convex geom and, if it is not convex, points of its surface, or None where it cannot be read."""
    mesh = element.find("geometry/mesh")
    if mesh is None:
        geom = placed_geom(element, placement, {})
        return None if geom is None or min(geom.size) <= 0.0 else (geom, None)
    file = resolve_mesh(mesh.get("filename", ""), robot.urdf.path)
    read = None if file is None else read_mesh(file)
    if read is None:
        return None
    at = Pose(np.array(placement.translation), np.array(placement.rotation)).compose(origin_of(element))
    placed = np.ascontiguousarray((read.corners * mesh_scale(mesh)) @ at.rotation.T + at.position)
    return _cloud(placed.tobytes()) if read.thinned else _mesh(placed.tobytes())


class ReadMesh(NamedTuple):
    """A mesh of a file: corners of its triangles (T, 3, 3), or of very many some points (P, 3), and how many it has."""

    corners: Float
    triangles: int
    thinned: bool


def read_mesh(file: Path) -> ReadMesh | None:
    """The mesh of a file, or None where it cannot be read."""
    try:
        about = file.stat()
    except OSError:
        return None
    return _read(file, about.st_mtime_ns, about.st_size)


@lru_cache(maxsize=64)
def _read(file: Path, changed: int, size: int) -> ReadMesh | None:
    corners = mesh_triangles(file)
    if corners is None:
        return None
    many = len(corners) > MANY
    return ReadMesh(thinned(corners.reshape(-1, 3)) if many else corners, len(corners), many)


@lru_cache(maxsize=64)  # a campaign asks for the same links in every chunk
def _mesh(content: bytes) -> tuple[Geom, Float | None] | None:
    """The hull of triangles (T, 3, 3), and points of the surface if that fills something, or None if it is flat."""
    triangles = np.frombuffer(content).reshape(-1, 3, 3)
    corners = triangles.reshape(-1, 3)
    return _hulled(corners, np.arange(len(corners)).reshape(-1, 3), lambda: points_on(triangles))


@lru_cache(maxsize=64)
def _cloud(content: bytes) -> tuple[Geom, Float | None] | None:
    """The same of some points (P, 3) of a mesh."""
    points = np.frombuffer(content).reshape(-1, 3)
    return _hulled(points, np.repeat(np.arange(len(points)), 3).reshape(-1, 3), lambda: points)


def _hulled(corners: Float, faces: NDArray[np.int64], surface: Callable[[], Float]) -> tuple[Geom, Float | None] | None:
    hull = hull_of(corners)
    if hull is None or hull.volume < SMALLEST_VOLUME:
        return None
    geom = Geom(kind="mesh", vertices=hull.vertices, faces=hull.faces)
    if is_convex(corners, faces, hull):
        return geom, None
    points = surface()
    return geom, thinned(points) if len(points) > 2 * MOST else points


class OddMesh(NamedTuple):
    """A mesh that collisions know otherwise than it is drawn: whose, a fixed word, what is wrong, and the cure."""

    link: str
    code: str
    message: str
    fix: str


def odd_meshes(robot: RobotModel) -> Iterator[OddMesh]:
    """Meshes of links that are there and that collisions do not take as they are."""
    for name, link in robot.urdf.links.items():
        if not robot.model.existBodyName(name):
            continue
        placement = robot.model.frames[robot.model.getBodyId(name)].placement
        for tag in ("collision", "visual"):
            known = [(element, _shape(robot, element, placement) is not None) for element in link.findall(tag)]
            for element, shaped in known:
                yield from _odd(robot, name, element, shaped)
            if any(shaped for _, shaped in known):
                break


def _odd(robot: RobotModel, link: str, element: ET.Element, shaped: bool) -> Iterator[OddMesh]:
    mesh = element.find("geometry/mesh")
    file = None if mesh is None else resolve_mesh(mesh.get("filename", ""), robot.urdf.path)
    if file is None:  # a mesh that is not there is named by the audit
        return
    read, fix = read_mesh(file), "give the link a <collision> of boxes, cylinders or spheres, or of a coarse mesh"
    if read is None:
        text = f"mesh {file.name!r} cannot be read as STL or OBJ, or is larger than {LARGEST_FILE // 10**6} MB: "
        yield OddMesh(link, "unread_mesh", text + "collisions take what else is drawn, or a capsule", fix)
    elif not shaped:
        yield OddMesh(link, "flat_mesh", f"mesh {file.name!r} has no volume: collisions do not know it", fix)
    elif read.thinned:
        text = f"mesh {file.name!r} has {read.triangles} triangles: collisions take some thousand of its corners, "
        yield OddMesh(link, "large_mesh", text + f"right to about 1/{FINE} of its size", fix)
    elif count := open_edges(read.corners.reshape(-1, 3), np.arange(3 * len(read.corners)).reshape(-1, 3)):
        text = f"mesh {file.name!r} is not closed ({count} open edges): collisions know its surface, not its inside"
        yield OddMesh(link, "open_mesh", text, fix)


def points_on(triangles: Float) -> Float:
    """Points (P, 3) on triangles (T, 3, 3): their corners, and between them so many that `SPACING` is kept."""
    a, b, c = triangles[:, 0], triangles[:, 1], triangles[:, 2]
    area = 0.5 * float(np.sum(norm(cross(b - a, c - a))))
    spacing = max(SPACING, math.sqrt(area / MOST))
    longest = np.maximum(np.maximum(norm(b - a), norm(c - b)), norm(a - c))
    pieces = np.ceil(longest / spacing).astype(int).clip(1, MOST_PIECES)
    found = [triangles.reshape(-1, 3)]
    for n in np.unique(pieces[pieces > 1]):
        chosen = pieces == n
        weights = np.array([(n - i - j, i, j) for i in range(n + 1) for j in range(n + 1 - i)]) / n
        found.append(np.einsum("pk,tkx->tpx", weights, triangles[chosen]).reshape(-1, 3))
    return np.unique(np.concatenate(found), axis=0)

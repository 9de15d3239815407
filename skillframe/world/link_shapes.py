"""Geoms of a robot's links: to draw them, and to check collisions.

Drawn are primitive visuals, or capsules between joints instead of meshes. For collisions, a link has its readable
`<collision>` shapes, else its `<visual>` shapes, else a capsule to the next joint.
"""

from __future__ import annotations

import hashlib
import math
import xml.etree.ElementTree as ET
from collections.abc import Container, Iterator, Mapping
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from skillframe.frames import Float, Pose, cross, norm, quaternion_from_matrix
from skillframe.robot.bodies import mesh_scale
from skillframe.robot.bodies import placement as origin_of
from skillframe.robot.meshes import (
    FINE,
    LARGEST_FILE,
    MOST,
    hull_of,
    is_convex,
    mesh_triangles,
    missing_collada,
    open_edges,
    resolve_mesh,
    thinned,
)
from skillframe.robot.model import RobotModel
from skillframe.world.scene import Geom

LINK_COLOUR = (0.86, 0.87, 0.89, 1.0)


def link_geoms(robot: RobotModel) -> dict[str, tuple[Geom, ...]]:
    """Geoms by joint name, in the frame of the joint's body."""
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
    """Capsules to the next joint for bodies without shape, by joint name."""
    boned: set[str] = set()
    for joint in range(2, model.njoints):
        parent = model.names[model.parents[joint]]
        reach = np.array(model.jointPlacements[joint].translation)
        if parent not in shaped and parent not in boned and norm(reach) > 0.02:
            boned.add(parent)
            rotation = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), reach / norm(reach)).matrix()
            x, y, z, w = (float(v) for v in quaternion_from_matrix(rotation))
            middle, length = 0.5 * reach, float(norm(reach))
            yield parent, Geom(
                kind="capsule", size=(0.1 * length, 0.5 * length), position=(middle[0], middle[1], middle[2]),
                quaternion=(x, y, z, w), rgba=LINK_COLOUR, collide=False,
            )  # fmt: skip


def placed_geom(visual: ET.Element, placement: pin.SE3, materials: Mapping[str, ET.Element]) -> Geom | None:
    """Primitive of a `<visual>` or `<collision>` in its body's frame, or None."""
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
    material = visual.find("material")
    colour = None if material is None else material.find("color")
    if colour is None and material is not None and material.get("name", "") in materials:
        colour = materials[material.get("name", "")].find("color")
    if colour is None:
        return LINK_COLOUR
    r, g, b, a = (float(v) for v in colour.get("rgba", "0.8 0.8 0.8 1").split())
    return (r, g, b, a)


UNREAD = "unread_mesh"


class LinkShape(NamedTuple):
    """A convex shape of a link, in its joint's body frame.

    Attributes:
        link: name in the URDF; body: name of its joint, "universe" if fixed.
        surface: (P, 3) surface points if not convex.
        tool: at or beyond a tool frame, or carried.
        guessed: a capsule for an undrawn body.
    """

    link: str
    body: str
    geom: Geom
    surface: Float | None = None
    tool: bool = False
    guessed: bool = False


def link_shapes(robot: RobotModel) -> list[LinkShape]:
    """Shapes of every link in the URDF's order, then guessed ones."""
    tool = tool_links(robot)
    found: list[LinkShape] = []
    for name, link in robot.urdf.links.items():
        if not robot.model.existBodyName(name):
            continue
        frame = robot.model.frames[robot.model.getBodyId(name)]
        body = robot.model.names[frame.parentJoint]
        for tag in ("collision", "visual"):
            made = [_shape(robot, element, frame.placement) for element in link.findall(tag)]
            shapes = [LinkShape(name, body, *pair, tool=name in tool) for pair in made if pair is not None]
            found += shapes
            if shapes:
                break
    heads = {joint.name: joint.child for joint in robot.urdf.joints.values()}
    for joint, bone in bones(robot.model, {shape.body for shape in found}):
        head = heads.get(joint, robot.urdf.root)
        found.append(LinkShape(head, joint, bone, tool=head in tool, guessed=True))
    return found


def tool_links(robot: RobotModel) -> set[str]:
    """Links at and beyond the tool frames, and the payload."""
    children = robot.urdf.children()
    layer = [arm.tool_frame for arm in robot.spec.arm]
    layer += [] if robot.spec.payload is None else [robot.spec.payload.link]
    tool: set[str] = set()
    while layer:
        tool.update(layer)
        layer = [joint.child for link in layer for joint in children.get(link, [])]
    return tool


def _shape(robot: RobotModel, element: ET.Element, placement: pin.SE3) -> tuple[Geom, Float | None] | None:
    mesh = element.find("geometry/mesh")
    if mesh is None:
        geom = placed_geom(element, placement, {})
        return None if geom is None or min(geom.size) <= 0.0 else (geom, None)
    file = resolve_mesh(mesh.get("filename", ""), robot.urdf.path)
    read = None if file is None else read_mesh(file)
    if read is None:
        return None
    corners = np.ascontiguousarray(read.corners * mesh_scale(mesh)).reshape(-1, 3)
    key = hashlib.blake2b(corners.tobytes(), digest_size=16).digest()
    if key not in _KNOWN:
        _KNOWN[key] = _looked_at(corners, read.thinned)
    known = _KNOWN[key]
    if known is None:
        return None
    at = Pose(np.array(placement.translation), np.array(placement.rotation)).compose(origin_of(element))
    vertices = known.vertices @ at.rotation.T + at.position
    geom = Geom(kind="mesh", vertices=vertices, faces=known.faces)
    return geom, None if known.surface is None else known.surface @ at.rotation.T + at.position


class ReadMesh(NamedTuple):
    """Triangle corners (T, 3, 3), or points (P, 3) if thinned, and the number of triangles."""

    corners: Float
    triangles: int
    thinned: bool


def read_mesh(file: Path) -> ReadMesh | None:
    """Mesh of a file, or None if it cannot be read."""
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
    many = len(corners) > 20_000  # triangles
    return ReadMesh(thinned(corners.reshape(-1, 3)) if many else corners, len(corners), many)


class KnownMesh(NamedTuple):
    """Collision hull of a scaled mesh, and surface points (P, 3) if not convex."""

    vertices: Float
    faces: NDArray[np.int64]
    surface: Float | None


_KNOWN: dict[bytes, KnownMesh | None] = {}
"""Cache by content."""


def _looked_at(corners: Float, few: bool) -> KnownMesh | None:
    faces = np.repeat(np.arange(len(corners)), 3) if few else np.arange(len(corners))
    hull = hull_of(corners)
    if hull is None or hull.volume < 1e-12:  # m3, a cube of 0.1 mm
        return None
    if is_convex(corners, faces.reshape(-1, 3), hull):
        return KnownMesh(hull.vertices, hull.faces, None)
    points = corners if few else points_on(corners.reshape(-1, 3, 3))
    return KnownMesh(hull.vertices, hull.faces, thinned(points) if len(points) > 2 * MOST else points)


@lru_cache(maxsize=1024)
def _edges(file: Path, changed: int, size: int) -> int:
    read = _read(file, changed, size)
    assert read is not None
    return open_edges(read.corners.reshape(-1, 3), np.arange(3 * len(read.corners)).reshape(-1, 3))


class OddMesh(NamedTuple):
    """A mesh that collides differently than drawn."""

    link: str
    code: str
    message: str
    fix: str


def odd_meshes(robot: RobotModel) -> Iterator[OddMesh]:
    """Meshes of links that collide differently than drawn, unreadable ones as one entry."""
    odd = list(_odd_ones(robot))
    unread = [each for each in odd if each.code == UNREAD]
    yield from (each for each in odd if each.code != UNREAD)
    if not unread:
        return
    names = list(dict.fromkeys(each.message for each in unread))
    named = ", ".join(map(repr, names[:3])) + (f" and {len(names) - 3} more" if len(names) > 3 else "")
    what = f"mesh{'es' * (len(names) > 1)} {named} cannot be read as STL, OBJ or COLLADA, or more than "
    what += f"{LARGEST_FILE // 10**6} MB: collisions take what else is drawn, or a capsule from joint to joint"
    lacks = missing_collada() and any(name.lower().endswith(".dae") for name in names)
    fix = "pip install 'skillframe[collada]', or " if lacks else ""
    yield OddMesh(unread[0].link, UNREAD, what, fix + unread[0].fix)


def _odd_ones(robot: RobotModel) -> Iterator[OddMesh]:
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
    if file is None:
        return
    read, fix = read_mesh(file), "give the link a <collision> of boxes, cylinders or spheres, or of a coarse mesh"
    if read is None:
        yield OddMesh(link, UNREAD, file.name, fix)
    elif not shaped:
        yield OddMesh(link, "flat_mesh", f"mesh {file.name!r} has no volume: collisions do not know it", fix)
    elif read.thinned:
        text = f"mesh {file.name!r} has {read.triangles} triangles: collisions take some thousand of its corners, "
        yield OddMesh(link, "large_mesh", text + f"right to about 1/{FINE} of its size", fix)
    elif count := _edges(file, file.stat().st_mtime_ns, file.stat().st_size):
        text = f"mesh {file.name!r} is not closed ({count} open edges): collisions know its surface, not its inside"
        yield OddMesh(link, "open_mesh", text, fix)


def points_on(triangles: Float) -> Float:
    """Points (P, 3) on triangles (T, 3, 3): corners and others every 5 mm."""
    a, b, c = triangles[:, 0], triangles[:, 1], triangles[:, 2]
    area = 0.5 * float(np.sum(norm(cross(b - a, c - a))))
    spacing = max(0.005, math.sqrt(area / MOST))  # m between surface points, at most 200 parts of an edge
    longest = np.maximum(np.maximum(norm(b - a), norm(c - b)), norm(a - c))
    pieces = np.ceil(longest / spacing).astype(int).clip(1, 200)
    found = [triangles.reshape(-1, 3)]
    for n in np.unique(pieces[pieces > 1]):
        chosen = pieces == n
        weights = np.array([(n - i - j, i, j) for i in range(n + 1) for j in range(n + 1 - i)]) / n
        found.append(np.einsum("pk,tkx->tpx", weights, triangles[chosen]).reshape(-1, 3))
    return np.unique(np.concatenate(found), axis=0)

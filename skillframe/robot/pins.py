"""Links and joints that robot.toml describes by pins, points of two links that meet, and the URDF does not draw.

A strut hangs with a revolute joint on its base pin, about the axis of the joints between its two links. Its rod slides
along, and its end closes a loop with the eye. Its barrel's x axis points to the eye where all joints are at zero.
Barrel and rod are slender, which is our choice.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from skillframe.errors import InputError, UnknownName
from skillframe.frames import Float, cross, norm
from skillframe.robot.tables import LoopClosure, Pin, Strut
from skillframe.robot.urdf import INERTIA, Joint, Urdf, numbers

PARALLEL = 1e-3
"""Sine of the largest angle between hinges that count as parallel."""


def drawn(urdf: Urdf, loops: Sequence[LoopClosure], struts: Sequence[Strut], where: str) -> Urdf:
    """The tree with the links, joints and frames of pins.

    Raises:
        UnknownName: a pin of a link that is not there.
        InputError: a name that is taken, or a strut whose links do not turn in one plane.
    """
    robot, placed = ET.Element("robot"), _at_zero(urdf)
    for loop in loops:
        for name, end in zip((loop.frame_a, loop.frame_b), loop.pin or (), strict=False):
            _frame(robot, name, end)
    for strut in struts:
        _draw(robot, urdf, placed, strut, where)
    links, joints = dict(urdf.links), dict(urdf.joints)
    for element in robot:
        name = element.get("name", "")
        if name in (links if element.tag == "link" else joints):
            raise InputError(where, f"the URDF has a {element.tag} {name!r} already", "choose another name")
        if element.tag == "link":
            links[name] = element
            continue
        parent, child = (part.get("link", "") for part in element[:2])
        if parent not in links:
            raise UnknownName("link", parent, urdf.links, f"named in {where}")
        joints[name] = Joint(name, element.get("type", ""), parent, child, element)
    return urdf._replace(links=links, joints=joints)


def _draw(robot: ET.Element, urdf: Urdf, placed: dict[str, pin.SE3], strut: Strut, where: str) -> None:
    """Add a strut's links and joints."""
    base, eye, name = strut.base, strut.eye, strut.name
    for link, _ in (base, eye):
        if link not in urdf.links:
            raise UnknownName("link", link, urdf.links, f"named in {strut.name} of {where}")
    axis = _hinge(urdf, placed, base[0], eye[0], f"{where}: {name}")
    far = placed[base[0]].inverse() * placed[eye[0]]
    way = far.act(np.array(eye[1])) - np.array(base[1])
    across = np.eye(3) - np.outer(axis, axis)
    if np.linalg.norm(across @ way) < PARALLEL * strut.closed:  # any way will do
        way = np.eye(3)[int(np.argmin(np.abs(axis)))]
    x = across @ way / np.linalg.norm(across @ way)
    turn = pin.rpy.matrixToRpy(np.column_stack([x, axis, cross(x, axis)]))
    barrel, rod = 0.6 * strut.mass, 0.4 * strut.mass
    _link(robot, f"{name}_barrel", barrel, 0.5 * strut.closed, strut.closed)
    _link(robot, f"{name}_rod_eye", rod, -0.5 * strut.stroke, strut.stroke)
    at = np.array(base[1]) + strut.beside * axis
    _joint(robot, f"{name}_hinge", "revolute", (base[0], f"{name}_barrel"), at, turn, ("0 1 0", -math.pi, math.pi))
    ends, slide = (f"{name}_barrel", f"{name}_rod_eye"), ("1 0 0", 0.0, strut.stroke)
    _joint(robot, f"{name}_rod", "prismatic", ends, (strut.closed, 0.0, 0.0), np.zeros(3), slide)
    at = np.array(eye[1]) + strut.beside * (far.rotation.T @ axis)
    _frame(robot, f"{name}_eye", (eye[0], (at[0], at[1], at[2])))


def _hinge(urdf: Urdf, placed: dict[str, pin.SE3], base: str, eye: str, where: str) -> Float:
    """(3,) axis of the joints between two links, in the axes of the first."""
    above = {joint.child: joint for joint in urdf.joints.values()}
    ways = []
    for link in (base, eye):
        way: dict[str, Joint] = {}
        while link in above:
            way[above[link].name] = above[link]
            link = above[link].parent
        ways.append(way)
    between = [joint for way, other in (ways, ways[::-1]) for name, joint in way.items() if name not in other]
    axes = []
    for joint in between:
        if joint.type in ("revolute", "continuous"):
            own = np.array(numbers(joint.element.find("axis"), "xyz", 3, (1.0, 0.0, 0.0)))
            axes.append(placed[base].rotation.T @ placed[joint.child].rotation @ own / np.linalg.norm(own))
    if not axes:
        fix = "name the joint that it moves in place of its pins"
        raise InputError(where, f"its pins lie on {base} and {eye}, which do not turn against each other", fix)
    if norm(cross(np.array(axes), axes[0])).max() > PARALLEL:
        text = f"the joints between {base} and {eye} do not turn about parallel axes"
        raise InputError(where, text, "pin it to links that turn in one plane, or draw it in the URDF")
    first: Float = axes[0]
    return first


def _at_zero(urdf: Urdf) -> dict[str, pin.SE3]:
    """Placement of every link in the root with all joints at zero."""
    placed, children, order = {urdf.root: pin.SE3.Identity()}, urdf.children(), [urdf.root]
    for link in order:
        for joint in children[link]:
            origin = joint.element.find("origin")
            at, turn = (np.array(numbers(origin, key, 3, (0.0, 0.0, 0.0))) for key in ("xyz", "rpy"))
            placed[joint.child] = placed[link] * pin.SE3(pin.rpy.rpyToMatrix(*turn), at)
            order.append(joint.child)
    return placed


def _frame(robot: ET.Element, name: str, end: Pin) -> None:
    _joint(robot, f"{name} mount", "fixed", (end[0], name), end[1], np.zeros(3))
    ET.SubElement(robot, "link", name=name)


def _link(robot: ET.Element, name: str, mass: float, middle: float, length: float) -> None:
    """A slender link along x."""
    inertial = ET.SubElement(ET.SubElement(robot, "link", name=name), "inertial")
    across = mass * length**2 / 12.0
    ET.SubElement(inertial, "origin", xyz=f"{middle!r} 0 0")
    ET.SubElement(inertial, "mass", value=repr(mass))
    values = (0.01 * across, across, across, 0.0, 0.0, 0.0)
    ET.SubElement(inertial, "inertia", dict(zip(INERTIA, map(repr, values), strict=True)))


def _joint(
    robot: ET.Element, name: str, kind: str, ends: tuple[str, str], at: Sequence[float] | Float, turn: Float,
    moves: tuple[str, float, float] | None = None,
) -> None:  # fmt: skip
    joint = ET.SubElement(robot, "joint", name=name, type=kind)
    ET.SubElement(joint, "parent", link=ends[0])
    ET.SubElement(joint, "child", link=ends[1])
    xyz, rpy = (" ".join(repr(float(x)) for x in values) for values in (at, turn))
    ET.SubElement(joint, "origin", xyz=xyz, rpy=rpy)
    if moves is not None:
        ET.SubElement(joint, "axis", xyz=moves[0])
        ET.SubElement(joint, "limit", lower=repr(moves[1]), upper=repr(moves[2]), effort="0", velocity="0")


def aimed(model: pin.Model, struts: Sequence[Strut], home: dict[str, float], q: Float) -> Float:
    """A configuration (nq,) with every strut from pin to pin, wherever the other joints are.

    Joints in `home` stay.
    """
    q, data = q.copy(), model.createData()
    names = [f"{strut.name}_{part}" for strut in struts for part in ("hinge", "rod")]
    moved = [int(model.joints[model.getJointId(name)].idx_q) for name in names if name not in home]
    q[moved] = 0.0
    pin.framesForwardKinematics(model, data, q)
    for strut in struts:
        hinge, rod = (model.getJointId(f"{strut.name}_{part}") for part in ("hinge", "rod"))
        eye = data.oMi[hinge].actInv(data.oMf[model.getFrameId(f"{strut.name}_eye", pin.FrameType.BODY)].translation)
        found = {f"{strut.name}_hinge": (hinge, math.atan2(-eye[2], eye[0]))}
        found[f"{strut.name}_rod"] = rod, math.hypot(eye[0], eye[2]) - strut.closed
        for name, (joint, value) in found.items():
            if name not in home:
                q[model.joints[joint].idx_q] = value
    return q

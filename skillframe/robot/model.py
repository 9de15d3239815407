"""`RobotModel`: nominal `pinocchio.Model` of a robot with its home and tool frames.

Without valid limits, revolute joints range over +-2 pi and prismatic ones over +-10 m, and effort is unlimited.

Prismatic joints of loops whose coordinate grows as the rod slides in are reversed, because drives expect the opposite.
With `[[loop]]`, a continuous joint has its angle for a coordinate instead of cosine and sine.
"""

from __future__ import annotations

import copy
import math
import os
import sys
import tempfile
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin

from skillframe.config.units import meant
from skillframe.errors import InputError, UnknownName
from skillframe.frames import Float
from skillframe.robot.pins import aimed, drawn
from skillframe.robot.spec import RobotSpec
from skillframe.robot.tables import FIXTURE, TOOL, Arm, JointDynamics
from skillframe.robot.urdf import INERTIA, Joint, Urdf, read_urdf

_OUT = {
    "x": pin.utils.rotate("y", math.pi / 2.0), "-x": pin.utils.rotate("y", -math.pi / 2.0),
    "y": pin.utils.rotate("x", -math.pi / 2.0), "-y": pin.utils.rotate("x", math.pi / 2.0),
    "-z": pin.utils.rotate("x", math.pi),
}  # fmt: skip
ROOT_JOINT, CONTINUOUS = "root_joint", "continuous"
_FREE_RANGE = {"revolute": 2.0 * math.pi, "prismatic": 10.0, CONTINUOUS: 1e4}


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotModel:
    """Nominal robot model, whatever the simulated plant varies.

    Attributes:
        urdf: the checked tree.
        model: with gravity of -9.81 m/s^2 along base z.
        home: (nq,) configuration.
        tool_frames: frame ids in the order of `spec.arm`.
        followers: mimic joints, without a coordinate. Those of a machine have one (`robot.loops.followers_of`).
        mimic_fallback: why mimic joints are independent, or "".
        turned: prismatic joints of loops that were reversed.
    """

    spec: RobotSpec
    urdf: Urdf
    model: pin.Model
    home: Float
    tool_frames: tuple[int, ...]
    followers: tuple[str, ...] = ()
    mimic_fallback: str = ""
    turned: tuple[str, ...] = ()

    def guided(self) -> RobotModel:
        """The robot while a teacher moves it: with a torque interface."""
        control = self.spec.control.guided()
        return self if control is self.spec.control else replace(self, spec=replace(self.spec, control=control))

    def arm_index(self, arm: str) -> int:
        """Index of an arm by name.

        Raises:
            UnknownName: the robot has no such arm.
        """
        names = [a.name for a in self.spec.arm]
        if arm not in names:
            raise UnknownName("arm", arm, names)
        return names.index(arm)


def load_model(spec: RobotSpec) -> RobotModel:
    """Build the nominal model of a robot.

    Raises:
        InputError, UnknownName: the URDF does not load, or robot.toml does not fit it.
    """
    drawing = drawn(read_urdf(spec.urdf), spec.loop, spec.strut, str(spec.folder / "robot.toml"))
    urdf = locked(drawing, spec)
    for link in spec.inertia:
        if link not in urdf.links:
            raise UnknownName("link", link, urdf.links, f"named in {spec.name}'s [inertia]")
    _check_machine(spec, urdf)
    wanted = mimic_joints(urdf) if spec.mimic and not spec.machine else ()
    model, fallback = _build(urdf, spec, bool(wanted))
    homes = spec
    if turned := backwards(model, spec):
        urdf, homes = turned_round(urdf, spec, turned)
        model, fallback = _build(urdf, spec, bool(wanted))
    for name in ("effortLimit", "velocityLimit"):  # zero means no limit
        limit = getattr(model, name).copy()
        limit[limit <= 0.0] = np.inf
        setattr(model, name, limit)
    single = {name: model.joints[j].idx_v for j, name in enumerate(model.names) if j and model.joints[j].nv == 1}
    armature = model.armature.copy()  # inertia without weight, as of motors
    for joint, inertia in spec.motor_inertia.items():
        if joint not in single:
            raise UnknownName("joint", joint, single, f"named in {spec.name}'s [motor_inertia]")
        armature[single[joint]] = inertia
    model.armature = armature
    tools = tuple(_tool(model, arm) for arm in spec.arm)
    followers = () if fallback else wanted
    return RobotModel(
        spec=spec,
        urdf=urdf,
        model=model,
        home=aimed(model, spec.strut, homes.home, _home(model, homes, followers)),
        tool_frames=tools,
        followers=followers,
        mimic_fallback=fallback,
        turned=turned,
    )


def _check_machine(spec: RobotSpec, urdf: Urdf) -> None:
    if spec.payload is not None and spec.payload.link not in urdf.links:
        raise UnknownName("link", spec.payload.link, urdf.links, f"named in {spec.name}'s [payload]")
    for joint in spec.friction_share:
        if joint not in urdf.joints:
            raise UnknownName("joint", joint, urdf.joints, f"named in {spec.name}'s [friction_share]")
    for joint in spec.dynamics.joint:
        if joint not in urdf.joints:
            raise UnknownName("joint", joint, urdf.joints, f"named in {spec.name}'s [dynamics]")
    for name in (frame for loop in spec.loop for frame in (loop.frame_a, loop.frame_b)):
        if name not in urdf.links and name not in urdf.joints:
            raise UnknownName("frame", name, urdf.links, f"named in {spec.name}'s [[loop]]")
    for obstacle in spec.obstacle:
        if obstacle.name in urdf.links:
            raise InputError(
                f"{spec.folder / 'robot.toml'}: obstacle", f"{obstacle.name!r} is a link's name", "rename it"
            )
    ends = (*urdf.links, *(obstacle.name for obstacle in spec.obstacle), FIXTURE, TOOL)
    for name in (name for pair in spec.collisions.ignore for name in pair):
        if name not in ends:
            raise UnknownName("link", name, ends, f"named in {spec.name}'s [collisions] ignore")
    for actuation in spec.actuation:
        if actuation.joint not in urdf.joints:
            raise UnknownName("joint", actuation.joint, urdf.joints, f"named in {spec.name}'s [[actuation]]")


def mimic_joints(urdf: Urdf) -> tuple[str, ...]:
    """Names of the joints with a mimic tag."""
    return tuple(j.name for j in urdf.joints.values() if j.element.find("mimic") is not None and j.type != "fixed")


def _tool(model: pin.Model, arm: Arm) -> int:
    body = arm.tool_frame
    bodies = [f.name for f in model.frames if f.type == pin.FrameType.BODY and f.name != "universe"]
    if body not in bodies:
        joint = f"a joint is called {body!r}; " if model.existFrame(body) else ""
        raise UnknownName("tool_frame", body, bodies, f"{joint}a tool_frame is a link of the URDF")
    link = int(model.getFrameId(body, pin.FrameType.BODY))
    if arm.tool_axis == "z":
        return link
    frame, turn = model.frames[link], pin.SE3.Identity()
    turn.rotation = _OUT[arm.tool_axis]
    name = f"{arm.tool_frame} with {arm.tool_axis} out"
    placement = frame.placement * turn
    return int(model.addFrame(pin.Frame(name, frame.parentJoint, link, placement, pin.FrameType.OP_FRAME)))


def _build(urdf: Urdf, spec: RobotSpec, mimic: bool) -> tuple[pin.Model, str]:
    moving = {"floating": 6, "planar": 3, "fixed": 0}
    freedoms = sum(moving.get(joint.type, 1) for joint in urdf.joints.values())
    if freedoms > 300:  # Pinocchio's data grows with the cube: 1.8 GB
        text = f"has {freedoms} degrees of freedom; 300 is the most that dynamics are computed for"
        raise InputError(urdf.path, text, "fix joints that do not matter")
    text = _bare_tree(urdf, spec)
    arguments = [text] if spec.base == "fixed" else [text, pin.JointModelFreeFlyer(), ROOT_JOINT]
    if mimic:
        try:
            with _silent() as log:
                return pin.buildModelFromXML(*arguments, mimic=True), ""
        except (ValueError, RuntimeError) as error:
            fallback = _continuous(urdf) or _first_line(log, error)
    try:
        with _silent() as log:
            return pin.buildModelFromXML(*arguments), fallback if mimic else ""
    except (ValueError, RuntimeError) as error:
        raise InputError(urdf.path, f"is refused by Pinocchio ({_first_line(log, error)})", "correct it") from None


def _bare_tree(urdf: Urdf, spec: RobotSpec) -> str:
    overlay = spec.inertia
    robot = ET.Element("robot", name=urdf.name)
    for name, link in urdf.links.items():
        bare = ET.SubElement(robot, "link", name=name)
        inertial = link.find("inertial")
        if name in overlay:
            inertia = overlay[name]
            inertial = ET.SubElement(bare, "inertial")
            ET.SubElement(inertial, "origin", xyz=" ".join(map(repr, inertia.com)))
            ET.SubElement(inertial, "mass", value=repr(inertia.mass))
            ET.SubElement(inertial, "inertia", dict(zip(INERTIA, map(repr, inertia.inertia), strict=True)))
        elif inertial is not None:
            bare.append(inertial)
    for joint in urdf.joints.values():
        robot.append(_bare_joint(joint, spec.dynamics.joint.get(joint.name), bool(spec.loop)))
    return ET.tostring(robot, encoding="unicode")


def _bare_joint(joint: Joint, own: JointDynamics | None, angles: bool) -> ET.Element:
    endless = joint.type == CONTINUOUS
    bare = ET.Element("joint", name=joint.name, type="revolute" if angles and endless else joint.type)
    for tag in ("parent", "child", "origin", "axis", "mimic"):
        element = joint.element.find(tag)
        if element is not None:
            bare.append(element)
    resisting = joint.element.find("dynamics")
    values = dict(resisting.attrib) if resisting is not None else {}
    for what in ("friction", "damping"):
        value = None if own is None else getattr(own, what)
        if value is not None:
            values[what] = repr(value)
    if values:
        ET.SubElement(bare, "dynamics", values)
    limit = joint.element.find("limit")
    given = {"effort": "0", "velocity": "0", **(limit.attrib if limit is not None else {})}
    if joint.type in _FREE_RANGE and (endless or float(given.get("lower", 0.0)) >= float(given.get("upper", 0.0))):
        given |= {"lower": repr(-_FREE_RANGE[joint.type]), "upper": repr(_FREE_RANGE[joint.type])}
    if limit is not None or joint.type in _FREE_RANGE:
        ET.SubElement(bare, "limit", {k: v for k, v in given.items() if k in ("effort", "velocity", "lower", "upper")})
    return bare


def _home(model: pin.Model, spec: RobotSpec, followers: tuple[str, ...]) -> Float:
    q: Float = pin.neutral(model)
    lower, upper = model.lowerPositionLimit, model.upperPositionLimit
    movable = {n: j for j, n in enumerate(model.names) if j and model.joints[j].nv == 1 and n not in followers}
    for joint in movable.values():
        if model.joints[joint].nq == 1 and lower[i := model.joints[joint].idx_q] < upper[i]:
            q[i] = np.clip(q[i], lower[i], upper[i])
    for name, value in spec.home.items():
        if name not in movable:
            note = "it follows another joint" if name in followers else f"named in {spec.name}'s [home]"
            raise UnknownName("joint", name, movable, note)
        joint = model.joints[movable[name]]
        if joint.nq == 2:
            q[joint.idx_q : joint.idx_q + 2] = math.cos(value), math.sin(value)
            continue
        low, high = lower[joint.idx_q], upper[joint.idx_q]
        if low < high and not low - 1e-9 <= value <= high + 1e-9:
            where, text = spec.folder / "robot.toml", f"{value:g} is outside the joint's limits {low:g} to {high:g}"
            unit = "m" if joint.shortname().startswith("JointModelP") else "rad"
            words = meant(value, unit, lambda there, low=low, high=high: low <= there <= high)  # type: ignore[misc]
            fix = f'did you mean "{value:g} {words[0]}"?' if words else "correct it"
            raise InputError(f"{where}: home.{name}", text, fix)
        q[joint.idx_q] = value
    return q


@contextmanager
def _silent() -> Iterator[list[str]]:
    lines: list[str] = []
    try:
        saved = os.dup(2)
    except OSError:
        yield lines
        return
    sys.stderr.flush()
    with tempfile.TemporaryFile("w+", encoding="utf-8", errors="replace") as catch:
        os.dup2(catch.fileno(), 2)
        try:
            yield lines
        finally:
            os.dup2(saved, 2)
            os.close(saved)
            catch.seek(0)
            lines.extend(catch.read().splitlines())


def _continuous(urdf: Urdf) -> str:
    for name in mimic_joints(urdf):
        element = urdf.joints[name].element.find("mimic")
        leader = urdf.joints.get("" if element is None else element.get("joint", ""))
        for joint in (urdf.joints[name], leader):
            if joint is not None and joint.type == "continuous":
                return f"joint {joint.name!r} is {CONTINUOUS}, and a joint without limits neither follows nor leads"
    return ""


def _first_line(log: list[str], error: Exception) -> str:
    lines = [line.removeprefix("Error:").strip() for line in [*log, *str(error).splitlines()] if line.strip()]
    told = [line.partition(":")[2].strip() for line in lines if line.lower().startswith("message")]
    spoken = told or [line for line in lines if not line.startswith(("From file", "in function", "at line"))]
    return spoken[0] if spoken else type(error).__name__


def backwards(model: pin.Model, spec: RobotSpec) -> tuple[str, ...]:
    """Driven prismatic joints whose rod end approaches the barrel's hinge as they grow."""
    driven = {actuation.joint for actuation in spec.actuation}
    found = []
    for frame in {name for loop in spec.loop for name in (loop.frame_a, loop.frame_b) if model.existFrame(name)}:
        eye = model.frames[model.getFrameId(frame)]
        slider, name = eye.parentJoint, model.names[eye.parentJoint]
        if name not in driven or not str(model.joints[slider].shortname()).startswith("JointModelP"):
            continue
        placement = model.jointPlacements[slider]
        slide = placement.rotation @ np.array(model.joints[slider].createData().S, dtype=float).reshape(6)[:3]
        rest = placement.act(np.array(eye.placement.translation))
        if (rest + spec.home.get(name, 0.0) * slide) @ slide < 0.0:
            found.append(name)
    return tuple(sorted(found))


def locked(urdf: Urdf, spec: RobotSpec) -> Urdf:
    """The tree with the joints of `[lock]` fixed at their positions.

    Raises:
        UnknownName: names no such joint.
        InputError: a joint that cannot be held there, or that is moved as well.
    """
    where, joints = spec.folder / "robot.toml", dict(urdf.joints)
    plain = [name for name, joint in joints.items() if joint.type in ("revolute", "continuous", "prismatic")]
    for name, value in spec.lock.items():
        if name not in plain:
            raise UnknownName("joint", name, plain, f"named in {spec.name}'s [lock]")
        for table, moved in (("[home]", spec.home), ("[[actuation]]", [a.joint for a in spec.actuation])):
            if name in moved:
                raise InputError(
                    where, f"{name} is held by [lock], and moved by {table}", "leave it out of one of them"
                )
        limit = joints[name].element.find("limit")
        if limit is not None and joints[name].type != "continuous":
            low, high = float(limit.get("lower", "0")), float(limit.get("upper", "0"))
            if low < high and not low <= value <= high:
                text = f"{value:g} is outside the joint's limits {low:g} to {high:g}"
                raise InputError(f"{where}: lock.{name}", text, "correct it")
        joints[name] = _held(joints[name], value)
    return urdf._replace(joints=joints)


def _held(joint: Joint, value: float) -> Joint:
    """A fixed joint in place of one at a position [rad or m]."""
    element = copy.deepcopy(joint.element)
    origin, axis = element.find("origin"), element.find("axis")
    if origin is None:
        element.append(origin := element.makeelement("origin", {}))
    place, turn = (
        np.array([float(word) for word in origin.get(key, "0 0 0").split()]) for key in ("xyz", "rpy")
    )  # fmt: skip
    way = np.array([float(word) for word in (axis.get("xyz", "1 0 0") if axis is not None else "1 0 0").split()])
    way, rotation = way / np.linalg.norm(way), pin.rpy.rpyToMatrix(*turn)
    if joint.type == "prismatic":
        place = place + rotation @ way * value
    else:
        rotation = rotation @ pin.exp3(way * value)
    origin.set("xyz", " ".join(map(repr, place.tolist())))
    origin.set("rpy", " ".join(map(repr, pin.rpy.matrixToRpy(rotation).tolist())))
    element.set("type", "fixed")
    for tag in ("axis", "limit", "mimic", "dynamics", "safety_controller"):
        for part in element.findall(tag):
            element.remove(part)
    return joint._replace(type="fixed", element=element)


def turned_round(urdf: Urdf, spec: RobotSpec, names: tuple[str, ...]) -> tuple[Urdf, RobotSpec]:
    """Reverse the axes, limits and home of these joints in tree and declaration."""
    joints = {name: _turned(joint) if name in names else joint for name, joint in urdf.joints.items()}
    home = {name: -value if name in names else value for name, value in spec.home.items()}
    return urdf._replace(joints=joints), replace(spec, home=home)


def _turned(joint: Joint) -> Joint:
    element = copy.deepcopy(joint.element)
    axis = element.find("axis")
    if axis is None:
        axis = element.makeelement("axis", {})
        element.append(axis)
    x, y, z = (-float(word) for word in axis.get("xyz", "1 0 0").split())
    axis.set("xyz", f"{x!r} {y!r} {z!r}")
    limit = element.find("limit")
    if limit is not None:
        low, high = float(limit.get("lower", "0")), float(limit.get("upper", "0"))
        limit.set("lower", repr(-high))
        limit.set("upper", repr(-low))
    return joint._replace(element=element)

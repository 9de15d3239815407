"""`RobotModel`: the nominal `pinocchio.Model` of a robot, its home and its tool frames.

The model is built from a bare tree (links with their inertia, joints), written again from the checked URDF with the
overlay of robot.toml in it; geometry plays no part, so meshes may be missing. A revolute joint without limits (or with
equal or reversed ones) turns within +-2 pi, a prismatic one slides within +-10 m (our choice; the audit warns); no
effort limit means unlimited.
"""

from __future__ import annotations

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
from numpy.typing import ArrayLike

from skillframe.errors import InputError, UnknownName
from skillframe.frames import Float
from skillframe.robot.joint_settings import JointDynamics
from skillframe.robot.numbers import INERTIA
from skillframe.robot.spec import LinkInertia, RobotSpec
from skillframe.robot.surroundings import FIXTURE, TOOL
from skillframe.robot.urdf import Joint, Urdf, read_urdf

_LARGEST_MODEL = 300  # degrees of freedom; Pinocchio's data grows with the cube: 1.8 GB at 300
_FREE_RANGE = {"revolute": 2.0 * math.pi, "prismatic": 10.0}
ROOT_JOINT = "root_joint"


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotModel:
    """A robot ready for kinematics and dynamics. It is nominal, whatever the simulated plant varies.

    Attributes:
        urdf: the checked tree it was built from.
        model: its gravity is -9.81 m/s^2 along base z.
        home: (nq,) configuration.
        tool_frames: frame ids, one per arm in the order of `spec.arm`.
        followers: joints that follow another (URDF mimic) in this model.
        mimic_fallback: why mimic joints are independent here although they should follow; empty if they do.
    """

    spec: RobotSpec
    urdf: Urdf
    model: pin.Model
    home: Float
    tool_frames: tuple[int, ...]
    followers: tuple[str, ...] = ()
    mimic_fallback: str = ""

    def guided(self) -> RobotModel:
        """The robot in a person's hands: an arm that takes positions yields as one that takes torques."""
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
        InputError: the URDF does not load, or robot.toml does not fit it.
        UnknownName: robot.toml names a link, joint or frame that the URDF does not have.
    """
    urdf = read_urdf(spec.urdf)
    for link in spec.inertia:
        if link not in urdf.links:
            raise UnknownName("link", link, urdf.links, f"named in {spec.name}'s [inertia]")
    _check_machine(spec, urdf)
    wanted = mimic_joints(urdf) if spec.mimic else ()
    model, fallback = _build(urdf, spec, bool(wanted))
    _free_missing_limits(model)
    _add_motors(model, spec)
    tools = tuple(_frame(model, arm.tool_frame) for arm in spec.arm)
    followers = () if fallback else wanted
    return RobotModel(
        spec=spec,
        urdf=urdf,
        model=model,
        home=_home(model, spec, followers),
        tool_frames=tools,
        followers=followers,
        mimic_fallback=fallback,
    )


def _check_machine(spec: RobotSpec, urdf: Urdf) -> None:
    """Names of links and joints in robot.toml, so that a slip is found by `robots check` and not by the first run."""
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
    """Names of the joints that carry a mimic tag."""
    return tuple(j.name for j in urdf.joints.values() if j.element.find("mimic") is not None and j.type != "fixed")


def attach_payload(
    model: pin.Model, tool_frame: int | str, mass: float, com: ArrayLike, inertia: ArrayLike
) -> pin.Model:
    """A copy of a model that carries a rigid load.

    Args:
        model: left as it is.
        tool_frame: id or name of the frame that the load is fixed to.
        mass: [kg].
        com: (3,) centre of mass in the tool frame [m].
        inertia: (3,) diagonal or (3, 3) about the centre of mass, tool frame axes [kg m^2].
    """
    frame = model.frames[_frame(model, tool_frame) if isinstance(tool_frame, str) else tool_frame]
    about_com = np.asarray(inertia, dtype=float)
    about_com = np.diag(about_com) if about_com.ndim == 1 else about_com
    loaded = model.copy()
    load = pin.Inertia(float(mass), np.asarray(com, dtype=float), about_com)
    loaded.appendBodyToJoint(frame.parentJoint, load, frame.placement)
    return loaded


def _frame(model: pin.Model, name: str) -> int:
    bodies = [f.name for f in model.frames if f.type != pin.FrameType.JOINT and f.name != "universe"]
    if name not in bodies:
        raise UnknownName("tool_frame", name, bodies, "a tool_frame is a link of the URDF")
    return int(model.getFrameId(name, pin.FrameType.BODY))


def _build(urdf: Urdf, spec: RobotSpec, mimic: bool) -> tuple[pin.Model, str]:
    """The model, and why mimic joints had to be made independent (empty if they follow)."""
    _check_size(urdf)
    text = _bare_tree(urdf, spec)
    arguments = [text] if spec.base == "fixed" else [text, pin.JointModelFreeFlyer(), ROOT_JOINT]
    if mimic:
        try:
            with _silent() as log:
                return pin.buildModelFromXML(*arguments, mimic=True), ""
        except (ValueError, RuntimeError) as error:
            fallback = _first_line(log, error)
    try:
        with _silent() as log:
            return pin.buildModelFromXML(*arguments), fallback if mimic else ""
    except (ValueError, RuntimeError) as error:
        raise InputError(urdf.path, f"is refused by Pinocchio ({_first_line(log, error)})", "correct it") from None


def _check_size(urdf: Urdf) -> None:
    moving = {"floating": 6, "planar": 3, "fixed": 0}
    freedoms = sum(moving.get(joint.type, 1) for joint in urdf.joints.values())
    if freedoms > _LARGEST_MODEL:
        text = f"has {freedoms} degrees of freedom; {_LARGEST_MODEL} is the most that dynamics are computed for"
        raise InputError(urdf.path, text, "fix joints that do not matter")


def _bare_tree(urdf: Urdf, spec: RobotSpec) -> str:
    """URDF text with inertias and joints only. [inertia] and [dynamics] replace a link's and a joint's own."""
    overlay = spec.inertia
    robot = ET.Element("robot", name=urdf.name)
    for name, link in urdf.links.items():
        bare = ET.SubElement(robot, "link", name=name)
        inertial = link.find("inertial")
        if name in overlay:
            _write_inertia(bare, overlay[name])
        elif inertial is not None:
            bare.append(inertial)
    for joint in urdf.joints.values():
        robot.append(_bare_joint(joint, spec.dynamics.joint.get(joint.name)))
    return ET.tostring(robot, encoding="unicode")


def _write_inertia(link: ET.Element, inertia: LinkInertia) -> None:
    inertial = ET.SubElement(link, "inertial")
    ET.SubElement(inertial, "origin", xyz=" ".join(map(repr, inertia.com)))
    ET.SubElement(inertial, "mass", value=repr(inertia.mass))
    ET.SubElement(inertial, "inertia", dict(zip(INERTIA, map(repr, inertia.inertia), strict=True)))


def _bare_joint(joint: Joint, own: JointDynamics | None) -> ET.Element:
    bare = ET.Element("joint", name=joint.name, type=joint.type)
    for tag in ("parent", "child", "origin", "axis", "mimic"):
        element = joint.element.find(tag)
        if element is not None:
            bare.append(element)
    _add_dynamics(bare, joint.element.find("dynamics"), own)
    limit = joint.element.find("limit")
    given = {"effort": "0", "velocity": "0", **(limit.attrib if limit is not None else {})}
    if joint.type in _FREE_RANGE and float(given.get("lower", 0.0)) >= float(given.get("upper", 0.0)):
        given |= {"lower": repr(-_FREE_RANGE[joint.type]), "upper": repr(_FREE_RANGE[joint.type])}
    if limit is not None or joint.type in _FREE_RANGE:
        ET.SubElement(bare, "limit", {k: v for k, v in given.items() if k in ("effort", "velocity", "lower", "upper")})
    return bare


def _add_dynamics(bare: ET.Element, given: ET.Element | None, own: JointDynamics | None) -> None:
    """Friction and damping as the URDF gives them, or as robot.toml does."""
    values = dict(given.attrib) if given is not None else {}
    for what in ("friction", "damping"):
        value = None if own is None else getattr(own, what)
        if value is not None:
            values[what] = repr(value)
    if values:
        ET.SubElement(bare, "dynamics", values)


def _free_missing_limits(model: pin.Model) -> None:
    """Effort and velocity limits of zero mean that none was given."""
    for name in ("effortLimit", "velocityLimit"):
        limit = getattr(model, name).copy()
        limit[limit <= 0.0] = np.inf
        setattr(model, name, limit)


def _add_motors(model: pin.Model, spec: RobotSpec) -> None:
    """The motors' inertia as Pinocchio's armature: on the diagonal of the mass matrix, and without weight."""
    single = {name: model.joints[j].idx_v for j, name in enumerate(model.names) if j and model.joints[j].nv == 1}
    armature = model.armature.copy()
    for joint, inertia in spec.motor_inertia.items():
        if joint not in single:
            raise UnknownName("joint", joint, single, f"named in {spec.name}'s [motor_inertia]")
        armature[single[joint]] = inertia
    model.armature = armature


def _home(model: pin.Model, spec: RobotSpec, followers: tuple[str, ...]) -> Float:
    """Configuration with the named joints at home and every other as near to neutral as its limits allow."""
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
            raise InputError(f"{where}: home.{name}", text, "correct it")
        q[joint.idx_q] = value
    return q


@contextmanager
def _silent() -> Iterator[list[str]]:
    """Catch what C++ parsers write to the process's stderr, so that the user reads one sentence."""
    lines: list[str] = []
    try:
        saved = os.dup(2)
    except OSError:  # a process without stderr has nothing to catch
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


def _first_line(log: list[str], error: Exception) -> str:
    spoken = [line.removeprefix("Error:").strip() for line in [*log, *str(error).splitlines()] if line.strip()]
    return spoken[0] if spoken else type(error).__name__

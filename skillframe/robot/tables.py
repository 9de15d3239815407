"""Tables of robot.toml: arms, joints, encoders, mount, loops, actuators, payload, obstacles, collisions."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from skillframe.config import read_toml, texts
from skillframe.config.units import one_of, si, unit_of
from skillframe.files import data_dirs
from skillframe.robot.interface import Control
from skillframe.robot.urdf import LARGEST, read_urdf

Pin = tuple[str, tuple[float, float, float]]
"""A point of a link: the link's name, and the point in its axes [m]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Arm:
    """One arm of a robot.

    Attributes:
        name: of the arm.
        tool_frame: URDF link (flange, wrist) of the tool.
        tool_axis: axis of that link along the tool; z is turned there the shortest way (to -z about x).
    """

    name: str
    tool_frame: str
    tool_axis: Literal["x", "-x", "y", "-y", "z", "-z"] = "z"


@dataclass(frozen=True, slots=True, kw_only=True)
class JointDynamics:
    """Resistance of a joint. None keeps the URDF's value.

    Attributes:
        friction: of the joint, at any speed [N m or N].
        damping: of the joint [N m s/rad or N s/m].
    """

    friction: float | None = None
    damping: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Dynamics:
    """`[dynamics]` of robot.toml.

    Attributes:
        compensate: the controller adds nominal friction and damping to its torques. False is the harder case.
        joint: by joint name, what replaces the URDF's `<dynamics>`.
    """

    compensate: bool = False
    joint: dict[str, JointDynamics] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class Encoders:
    """`[encoders]` of robot.toml: how joint positions and velocities are measured.

    Attributes:
        bits: per turn, of revolute joints; None reads them exactly.
        step_m: a count of prismatic joints [m]; None reads them exactly.
        corner_hz: of the first-order filter on differenced positions, which give the velocities [Hz].
    """

    bits: int | None = None
    step_m: float | None = None
    corner_hz: float = 100.0

    @property
    def count_rad(self) -> float | None:
        """A count of revolute joints [rad]."""
        return None if self.bits is None else 2.0 * math.pi / 2.0**self.bits

    def __str__(self) -> str:
        parts = [] if self.bits is None else [f"{self.bits} bits a turn"]
        parts += [] if self.step_m is None else [f"counts of {1e6 * self.step_m:g} um"]
        return f"{', '.join(parts)}; velocities are differences behind a filter of {self.corner_hz:g} Hz"


def impossible_encoders(encoders: Encoders, rate_hz: float) -> Iterator[tuple[str, str, str]]:
    """Key, problem and fix of each impossible encoder value."""
    if encoders.bits is None and encoders.step_m is None:
        yield "encoders", "gives neither bits nor step_m", "give the resolution, or leave [encoders] out"
    if encoders.bits is not None and not 8 <= encoders.bits <= 32:
        yield "encoders.bits", f"is {encoders.bits}", "give 8 to 32 bits a turn"
    if encoders.step_m is not None and not 0.0 < encoders.step_m <= 1e-3:  # a larger count is in another unit
        yield "encoders.step_m", f"is {encoders.step_m:g} m", "give metres per count, at most 0.001"
    if not 0.0 < encoders.corner_hz <= 0.5 * rate_hz:
        text = f"is {encoders.corner_hz:g} Hz at a control rate of {rate_hz:g} Hz"
        yield "encoders.corner_hz", text, "give half the control rate at most"


def impossible_joints(dynamics: Dynamics) -> Iterator[tuple[str, str, str]]:
    """Key, problem and fix of each impossible joint value."""
    for name, own in dynamics.joint.items():
        for what in ("friction", "damping"):
            value = getattr(own, what)
            if value is not None and not 0.0 <= value < math.inf:
                yield f"dynamics.joint.{name}.{what}", f"is {value:g}", "give 0 or more, or leave it out"


@dataclass(frozen=True, slots=True, kw_only=True)
class Mount:
    """`[mount]` of robot.toml: springs and dampers between the wrist's force sensor and the tool.

    The controller assumes a rigid mount.

    Attributes:
        stiffness: of the mount along any axis of the tool frame [N/m, 1e3 to 1e6].
        turning_stiffness: of the mount about the tool frame [Nm/rad, 10 to 1e5].
        damping_ratio: of the tool on these springs [0 to 2]; rubber has about 0.05 to 0.2.
    """

    stiffness: float
    turning_stiffness: float
    damping_ratio: float = 0.1

    def __str__(self) -> str:
        return f"{self.stiffness:.3g} N/m, {self.turning_stiffness:.3g} Nm/rad, damping ratio {self.damping_ratio:g}"


def unfit_mount(mount: Mount, control: Control, other: str) -> Iterator[tuple[str, str, str]]:
    """Key, problem and fix of a mount that is impossible on this robot.

    `other` is the robot's property that excludes a mount, or "".
    """
    if other:
        yield "mount", f"is for one arm on a fixed base, and this robot {other}", "leave it out"
    if control.interface == "torque":
        return
    stiffness = control.admittance.stiffness
    if stiffness > mount.stiffness:
        series = 1.0 / (1.0 / stiffness + 1.0 / mount.stiffness)
        text = f"is {stiffness:.2g} N/m, and the mount alone, in series with it, yields with {mount.stiffness:.2g} N/m"
        yield "control.contact_stiffness", text, f"measure it with the mount; {_rounded(series)} by what is written"


def _rounded(value: float) -> str:
    """Two digits, rounded up, because too low a stiffness bounces."""
    step = 10.0 ** (math.floor(math.log10(value)) - 1)
    return f"{math.ceil(value / step) * step:.2g}"


FIXTURE, TOOL = "fixture", "tool"
"""Names that `[collisions] ignore` takes besides links and obstacles."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DeclaredCollisions:
    """Whether touching bodies end a trial.

    Attributes:
        enabled: False checks no pair of bodies.
        ignore: pairs that may touch, each of two names: links, obstacles, "fixture", "tool".
    """

    enabled: bool = True
    ignore: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Obstacle:
    """A fixed obstacle around the robot: a table, a floor, a wall. Nothing may touch it.

    Attributes:
        name: unique.
        kind: "box", or "plane", all below which counts as inside.
        size: edges of a box along its axes [m].
        position: in base [m], the middle of a box, a point of a plane.
        orientation: quaternion x, y, z, w; a plane's normal is its z axis.
    """

    name: str
    kind: Literal["box", "plane"] = "box"
    size: tuple[float, float, float] = (0.0, 0.0, 0.0)
    position: tuple[float, float, float] = (0.0, 0.0, 0.0)
    orientation: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 1.0)


def unfit_obstacles(obstacles: Sequence[Obstacle]) -> Iterator[tuple[str, str, str]]:
    """Key, problem and fix of each impossible obstacle."""
    seen = {FIXTURE, TOOL}
    for obstacle in obstacles:
        key = f"obstacle {obstacle.name!r}"
        if not obstacle.name or obstacle.name in seen:
            why = "has no name" if not obstacle.name else "has a name that is taken"
            yield "obstacle", f"{obstacle.name!r} {why}", "give each a name of its own, not 'fixture' or 'tool'"
        seen.add(obstacle.name)
        if not all(abs(x) <= LARGEST for x in (*obstacle.position, *obstacle.size)):
            yield key, "is beyond any physical size", "give metres in base"
        elif obstacle.kind == "box" and not min(obstacle.size) > 0.0:
            yield f"{key}: size", f"is {list(obstacle.size)}", "give a box three positive edges in metres"
        elif obstacle.kind == "plane" and any(obstacle.size):
            yield f"{key}: size", "is given, and a plane has no end", 'leave it out, or say kind = "box"'
        if abs(math.hypot(*obstacle.orientation) - 1.0) > 0.01:
            size = f"has the length {math.hypot(*obstacle.orientation):g}, not 1"
            yield f"{key}: orientation", size, "give a unit quaternion, x, y, z, w"


def collisions_note(robot: str, collisions: DeclaredCollisions) -> str:
    """Note for results about bodies exempt from collision checks, or ""."""
    if not collisions.enabled:
        return f"bodies that touch did not end a trial: [collisions] enabled is false in robot.toml of {robot}"
    if not collisions.ignore:
        return ""
    pairs = ", ".join(f"{one} with {two}" for one, two in collisions.ignore)
    return f"bodies that could touch without ending a trial, by [collisions] ignore of {robot}: {pairs}"


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopClosure:
    """A closed chain: the origins of two frames of the tree, or points of two links, coincide.

    Attributes:
        frame_a, frame_b: names of the two links.
        pin: in place of both, the two links with the point of each [m].
        branch: near which positions of joints the loop is closed, as in `[home]` [rad or m].
    """

    frame_a: str = ""
    frame_b: str = ""
    pin: tuple[Pin, Pin] | None = None
    branch: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class Strut:
    """A barrel and a rod between two pins, which the URDF does not draw (`robot.pins`).

    Attributes:
        name: of the strut; its sliding joint is called so with "_rod".
        base: pin of the barrel [m].
        eye: pin of the rod [m].
        closed: distance of the pins with the rod all the way in [m].
        stroke: of the rod [m].
        mass: of both [kg]; six tenths are the barrel's, our choice.
        beside: shift of both pins along their hinges [m].
    """

    name: str
    base: Pin
    eye: Pin
    closed: float
    stroke: float
    mass: float
    beside: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Passive:
    """A joint without a drive, such as the one that a grapple hangs on.

    Attributes:
        joint: that swings freely.
        damping: of the joint, in place of the URDF's [N m s/rad or N s/m].
    """

    joint: str
    damping: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class DeclaredDrive:
    """The drive between controller and joints.

    Attributes:
        kind: name of the drive: "servo" for the electric servos that `[[actuation]]` names, or a plug-in's.
    """

    kind: str


@dataclass(frozen=True, slots=True, kw_only=True)
class DeclaredPayload:
    """The payload of a machine.

    Attributes:
        link: whose inertia includes the load.
        mass: of the load [kg, 0 to 1000t].
        rating: the rated load [kg, 0 to 1000t]; the largest cranes lift that much.
    """

    link: str
    mass: float
    rating: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Actuation:
    """An actuator (an FMU) on a joint.

    Attributes:
        joint: that it drives.
        fmu: its name, or its file beside robot.toml.
        parameters: of the FMU, by its names.
        inputs, outputs: names here, to the FMU's names.
        nominal: parameters that the controller assumes, by the names here, where they differ.
        initial_force: the FMU's parameter for the force [N] at the start, or "".
        unused: inputs and outputs of the FMU that are deliberately left unconnected.
        velocity_gain, force_gain: of the drive's controller, in the drive's units; None: derived by the drive.
    """

    joint: str
    fmu: str
    parameters: dict[str, Any] = field(default_factory=dict)
    inputs: dict[str, str] = field(default_factory=dict)
    outputs: dict[str, str] = field(default_factory=dict)
    nominal: dict[str, Any] = field(default_factory=dict)
    initial_force: str = ""
    unused: tuple[str, ...] = ()
    velocity_gain: float | None = None
    force_gain: float | None = None

    @property
    def known(self) -> dict[str, Any]:
        """Parameters that the controller assumes, by the names here."""
        return {**self.parameters, **self.nominal}


SERVO = "electric_servo"
"""FMU of the core's servo drive, whose figures are those of a servo. Other drives have those of the other FMUs."""
_BY_JOINT = {"home": "rad or m", "lock": "rad or m", "motor_inertia": "kg m^2 or kg"}


def in_si(values: Mapping[str, Any], path: Path) -> dict[str, Any]:
    """Content of robot.toml at `path` with these texts as SI numbers.

    Raises:
        InputError: a unit does not fit, or the URDF cannot be read.
    """
    own: dict[str, Any] = {key: dict(table) for key in _BY_JOINT if isinstance(table := values.get(key), Mapping)}
    rows = [(table, joint, joint, _BY_JOINT[key], key) for key, table in own.items() for joint in table]
    dynamics = values.get("dynamics")
    joints = dynamics.get("joint") if isinstance(dynamics, Mapping) else None
    if isinstance(dynamics, Mapping) and isinstance(joints, Mapping):
        given = {name: dict(table) if isinstance(table, Mapping) else table for name, table in joints.items()}
        own["dynamics"] = {**dynamics, "joint": given}
        pairs = [(name, what) for name, table in given.items() if isinstance(table, dict) for what in table]
        units = {what: unit_of(about) for what, about in texts(JointDynamics).items()}
        rows += [(given[name], what, name, units.get(what, ""), f"dynamics.joint.{name}") for name, what in pairs]
    rows = [row for row in rows if isinstance(row[0][row[1]], str)]
    file = path.resolve().parent / str(values.get("urdf"))
    drawn = read_urdf(file).joints.values() if rows and file.is_file() else ()
    slides = {joint.name: joint.type == "prismatic" for joint in drawn}
    for table, key, joint, unit, where in rows:
        asked = one_of(unit, slides[joint]) if joint in slides else unit
        table[key] = si(table[key], asked, f"{path}: {where}.{key}")
    if "actuation" in values:
        own["actuation"] = _actuation(values, path)
    return {**values, **own}


def _actuation(values: Mapping[str, Any], path: Path) -> Any:
    """`[[actuation]]` with its figures in SI."""
    given, drive = values["actuation"], values.get("drive")
    if not isinstance(given, list) or not all(isinstance(one, Mapping) for one in given):
        return given
    servo = isinstance(drive, Mapping) and drive.get("kind") == "servo"
    names = {file.parent.name for root in data_dirs("fmus") for file in root.glob("*/fmu.toml")}
    chosen = [name for name in sorted(names) if (name == SERVO) == servo]
    units = {figure: unit for name in chosen for figure, unit in units_of_figures(name).items()}
    return [{**one, **dict(_figures(one, units, f"{path}: actuation of {one.get('joint')}"))} for one in given]


def _figures(one: Mapping[str, Any], ours: Mapping[str, str], where: str) -> Iterator[tuple[str, Any]]:
    nominal = one.get("nominal")
    own = units_of_figures(str(one.get("fmu")))
    for key, units in (("parameters", own or ours), ("nominal", ours)):
        table = one.get(key)
        if not isinstance(table, Mapping):
            continue
        told = nominal if key == "parameters" and not own and isinstance(nominal, Mapping) else ()
        meant = {name for name in table if name in units and name not in told}
        yield key, {k: si(v, units[k], f"{where}: {key}.{k}") if k in meant else v for k, v in table.items()}


def units_of_figures(fmu: str) -> Mapping[str, str]:
    """SI units of an FMU's parameters, if shipped as sources."""
    tables = (folder / fmu / "fmu.toml" for folder in data_dirs("fmus")) if fmu and Path(fmu).name == fmu else ()
    for path in tables:
        if path.is_file():
            return {name: unit_of(f"[{row.get('unit', '')}]") for name, row in read_toml(path)["parameter"].items()}
    return {}

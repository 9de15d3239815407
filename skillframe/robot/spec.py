"""`RobotSpec`: the checked content of robot.toml, read without a dynamics library."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any, Literal

from skillframe.config import build, read_toml
from skillframe.errors import InputError, UnknownName
from skillframe.files import OFFERS, WRITES_OUT, data_dirs
from skillframe.files.documents import refuse_other
from skillframe.robot.interface import Control, check_control
from skillframe.robot.tables import (
    Actuation,
    Arm,
    DeclaredCollisions,
    DeclaredDrive,
    DeclaredPayload,
    Dynamics,
    Encoders,
    JointDynamics,
    LoopClosure,
    Mount,
    Obstacle,
    Passive,
    Strut,
    impossible_encoders,
    impossible_joints,
    in_si,
    unfit_mount,
    unfit_obstacles,
)
from skillframe.robot.urdf import LARGEST

Vector = tuple[float, float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """Limits that stop a run. None disables one.

    Attributes:
        force_n: contact force at the tool [N].
        torque_n_m: contact torque at the tool [N m].
        torque_rate_nm_s: change of a joint's commanded torque [N m/s].
        workspace_m: box of the tool point, (lower, upper) corners in base [m, -1000m to 1000m].
        energy_j: energy that the controller may put into the robot [J].
    """

    force_n: float | None = 80.0
    torque_n_m: float | None = None
    torque_rate_nm_s: float | None = 1000.0
    workspace_m: tuple[Vector, Vector] | None = None
    energy_j: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Workspace:
    """Place of work.

    Attributes:
        fixture: position in base of a world's fixture [m, -100m to 100m].
        orientation: (x, y, z, w), its rotation from upright, for a fixture that a second arm holds sideways.
    """

    fixture: Vector = (0.0, 0.0, 0.0)
    orientation: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 1.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkInertia:
    """Inertia of a link that replaces the URDF's, in link axes.

    Attributes:
        mass: of the link [kg].
        com: centre of mass [m].
        inertia: xx, yy, zz, xy, xz, yz about the centre of mass [kg m^2].
        guessed: the mass is a guess of `robots --check`; failures mention it.
    """

    mass: float
    com: Vector = (0.0, 0.0, 0.0)
    inertia: tuple[float, float, float, float, float, float]
    guessed: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotFile:
    """The keys of robot.toml. `RobotSpec` describes those without an entry.

    Attributes:
        urdf: file of the robot, from the folder of robot.toml.
        summary: one line for people.
        parameter_set: a file of SSP (.ssv or .ssp) whose values replace those of `actuation`.
    """

    urdf: Path
    summary: str = ""
    base: Literal["fixed", "free"] = "fixed"
    mimic: bool = True
    arm: tuple[Arm, ...] = ()
    home: dict[str, float] = field(default_factory=dict)
    lock: dict[str, float] = field(default_factory=dict)
    control: Control = field(default_factory=Control)
    limits: Limits = field(default_factory=Limits)
    workspace: Workspace = field(default_factory=Workspace)
    friction_share: dict[str, float] = field(default_factory=dict)
    motor_inertia: dict[str, float] = field(default_factory=dict)
    dynamics: Dynamics = field(default_factory=Dynamics)
    encoders: Encoders | None = None
    mount: Mount | None = None
    inertia: dict[str, LinkInertia] = field(default_factory=dict)
    payload: DeclaredPayload | None = None
    loop: tuple[LoopClosure, ...] = ()
    strut: tuple[Strut, ...] = ()
    passive: tuple[Passive, ...] = ()
    drive: DeclaredDrive | None = None
    actuation: tuple[Actuation, ...] = ()
    parameter_set: Path | None = None
    collisions: DeclaredCollisions = field(default_factory=DeclaredCollisions)
    obstacle: tuple[Obstacle, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotSpec(RobotFile):
    """A robot as declared.

    Attributes:
        name: folder's name, or the URDF's stem; summary: one line for people.
        folder: where relative paths start; urdf: absolute path of the URDF.
        declared: by a robot.toml.
        base: "fixed", or "free" for a free-flying body.
        mimic: joints with a URDF mimic tag follow their leader; False makes every joint independent.
        home: joint positions by joint name [rad or m]; other joints are at neutral.
        lock: positions of joints that are held [rad or m]: they are fixed joints.
        friction_share: part of the sampled `robot.joint_friction` by joint name; 1 for others.
        motor_inertia: of motor and gear by joint name: the rotor's times the gear ratio squared [kg m^2 or kg]; 0 for
            others.
        dynamics: friction and damping in place of the URDF's, and their compensation.
        encoders: of the joints; None for exact positions and velocities.
        mount: soft, between sensor and tool, or None; payload: a variable load.
        inertia: overlay by link name; loop: closed chains; strut: drawn between two pins; passive: without a drive.
        actuation: drives of joints, of the kind in `drive`.
        tables: the other tables, for the drive of a plug-in.
        collisions: which bodies may touch; obstacle: fixed bodies around it.
    """

    name: str
    folder: Path
    declared: bool = True
    tables: dict[str, Any] = field(default_factory=dict)

    @property
    def servo(self) -> bool:
        """Electric servos drive the robot."""
        return bool(self.actuation) and self.drive is not None and self.drive.kind == "servo"

    @property
    def own_law(self) -> bool:
        """A plug-in's drive, with its own controller and checks."""
        return not self.servo and (self.drive is not None or bool(self.actuation))

    @property
    def machine(self) -> bool:
        """Joints that follow others, or close loops, are constraints of a tree (`robot.chain`)."""
        return bool(self.loop) or self.own_law

    def require_simulated(self) -> None:
        """Refuse a robot that cannot be simulated.

        Raises:
            InputError: closed loops without actuators, or no arm.
        """
        where = self.folder / "robot.toml"
        if self.loop and not self.actuation:
            raise InputError(where, "has [[loop]] and no [[actuation]]", "say which joints of the loops are driven")
        if not self.declared:
            write = "write a robot.toml beside it with name and tool_frame of an [[arm]]"
            raise InputError(
                self.urdf, "a URDF alone names no arm to run", f"give {where}" if where.is_file() else write
            )
        if not self.arm:
            raise InputError(where, "names no arm", 'add [[arm]] with name = "arm" and tool_frame = "<a URDF link>"')


def load_robot(name_or_path: str | Path) -> RobotSpec:
    """Robot of a name, a folder, a robot.toml, or a bare URDF.

    Raises:
        InputError: a file is missing or invalid.
        UnknownName: no such name.
    """
    path = Path(name_or_path)
    bare_name = isinstance(name_or_path, str) and path.parts == (name_or_path,) and not path.suffix
    name = str(name_or_path)
    if bare_name and (found := _named_folders().get(name) or OFFERS["robots"](None).get(name)):
        return _from_toml(found / "robot.toml")
    if path.is_dir():
        return _from_toml(path / "robot.toml")
    if bare_name and not path.exists():
        return _from_toml(robot_folder(name) / "robot.toml")
    if not path.exists():
        fix = "give a URDF, a robot.toml, a folder with one, or a name from `skillframe robots`"
        raise InputError(path, "no such file", fix)
    refuse_other(path, "robot")
    if path.suffix == ".toml":
        return _from_toml(path)
    path = path.resolve()
    return RobotSpec(name=path.stem, folder=path.parent, urdf=path, declared=False)


def robot_names() -> dict[str, Path]:
    """Folder by name of every robot."""
    return {**OFFERS["robots"](None), **_named_folders()}


def robot_folder(name: str, note: str = "") -> Path:
    """Folder of a robot. `note` is added to the error.

    Raises:
        UnknownName: there is none.
        SkillframeError: two plug-ins have it.
    """
    if found := _named_folders().get(name):
        return found
    try:
        return OFFERS["robots"](name)[name]
    except UnknownName as error:
        notes = "; ".join(text for text in (note, error.note) if text)
        raise UnknownName("robot", name, robot_names(), notes) from None


def _named_folders() -> dict[str, Path]:
    names: dict[str, Path] = {}
    for folder in data_dirs("robots"):
        for robot in sorted(p.parent for p in folder.glob("*/robot.toml")):
            names.setdefault(robot.name, robot)
    return names


def _from_toml(path: Path) -> RobotSpec:
    values, known = read_toml(path), {each.name for each in fields(RobotFile)}
    for write_out in WRITES_OUT if values.keys() - (known - {"parameter_set"}) else ():
        values = write_out(values, path)
    values = in_si(values, path)
    drive = values.get("drive")
    plugin = drive.get("kind") != "servo" if isinstance(drive, dict) else "actuation" in values
    tables = {key: value for key, value in values.items() if plugin and key not in known}
    declared = build(RobotFile, {key: value for key, value in values.items() if key not in tables}, str(path))
    folder = path.resolve().parent
    urdf = folder / declared.urdf
    if not urdf.is_file():
        raise InputError(f"{path}: urdf", f"there is no file {values['urdf']!r} beside it", "correct the name")
    rest = {name: getattr(declared, name) for name in known - {"urdf"}}
    damped = {each.joint: JointDynamics(damping=each.damping) for each in declared.passive if each.damping is not None}
    if twice := sorted(damped.keys() & declared.dynamics.joint.keys()):
        raise InputError(f"{path}: passive", f"{twice[0]} has damping and a table in [dynamics]", "keep one of them")
    rest["dynamics"] = replace(declared.dynamics, joint={**declared.dynamics.joint, **damped})
    rest["loop"], rest["home"] = _closures(declared, str(path))
    spec = RobotSpec(name=folder.name, folder=folder, urdf=urdf.resolve(), tables=tables, **rest)
    for key, problem, fix in _problems(spec, str(path)):
        raise InputError(f"{path}: {key}", problem, fix)
    return spec


def _closures(declared: RobotFile, where: str) -> tuple[tuple[LoopClosure, ...], dict[str, float]]:
    """Loops with names of their frames, those of struts among them, and `[home]` with the loops' branches.

    Raises:
        InputError: a loop with both or neither, an impossible strut, or a joint with two positions.
    """
    named, home = [], dict(declared.home)
    for number, loop in enumerate(declared.loop, 1):
        whole, begun = loop.frame_a and loop.frame_b, loop.frame_a or loop.frame_b
        if begun if loop.pin else not whole:
            text = "has pin and frames" if loop.pin else "lacks frame_a, frame_b, or pin in their place"
            raise InputError(f"{where}: loop {number}", text, "give either")
        if twice := sorted(home.keys() & loop.branch.keys()):
            raise InputError(f"{where}: loop {number}.branch", f"{twice[0]} stands under [home]", "keep one of them")
        home |= loop.branch
        ends = [f"pin {number} of {link}" for link, _ in loop.pin or ()]
        named.append(replace(loop, frame_a=ends[0], frame_b=ends[1]) if ends else loop)
    for strut in declared.strut:
        for key in ("closed", "stroke", "mass"):
            if not 0.0 < (value := getattr(strut, key)) < math.inf:
                raise InputError(f"{where}: {strut.name}.{key}", f"is {value:g}", "give a positive, finite number")
        if strut.stroke >= strut.closed:
            text = f"is {strut.stroke:g} m, and no such rod fits into {strut.closed:g} m when closed"
            raise InputError(f"{where}: {strut.name}.stroke", text, "correct stroke or closed")
        named.append(LoopClosure(frame_a=f"{strut.name}_eye", frame_b=f"{strut.name}_rod_eye"))
    return tuple(named), home


def _problems(spec: RobotSpec, where: str) -> Iterator[tuple[str, str, str]]:
    """Key, problem and fix of each impossible value. Those of `[control]` are raised."""
    limits, passive = spec.limits, [each.joint for each in spec.passive]
    if passive and not spec.actuation:
        yield "passive", "is of machines with an [[actuation]]", "leave it out"
    if twice := sorted({name for name in passive if passive.count(name) > 1}):
        yield "passive", f"names {twice[0]} twice", "keep one of them"
    for key in ("force_n", "torque_n_m", "torque_rate_nm_s", "energy_j"):
        value = getattr(limits, key)
        if value is not None and not (0.0 < value < math.inf):
            yield f"limits.{key}", f"is {value:g}", "give a positive, finite number"
    check_control(spec.control, where)
    several = len(spec.arm) > 1
    others = {
        "is a machine whose joints are driven as [[actuation]] says": spec.actuation,
        "has a drive of its own": spec.drive, "has closed loops": spec.loop,
        "has several arms": several, "stands on a free base": spec.base == "free",
    }  # fmt: skip
    other = next((what for what, true in others.items() if true), "")
    if spec.mount is not None:
        yield from unfit_mount(spec.mount, spec.control, other)
    interface = spec.control.interface
    if other and interface != "torque":
        text = f"is {interface!r}, which one arm on a fixed base takes, and this robot {other}"
        yield "control.interface", text, 'leave it out, or write "torque"'
    if spec.drive is not None and spec.drive.kind == "servo":
        if not spec.actuation:
            yield "drive", "there is no [[actuation]] that it could be the kind of", "leave it out"
        if spec.loop or several:
            what = "closed loops" if spec.loop else "several arms"
            yield "drive", f"servos drive one open arm, and this robot has {what}", "leave it out"
    for joint, value in spec.home.items():
        if not math.isfinite(value):
            yield f"home.{joint}", f"is {value:g}", "give a finite number"
    box = limits.workspace_m
    if box is not None and not all(low < high for low, high in zip(*box, strict=True)):
        yield "limits.workspace_m", f"{box} is empty", "give the lower corner first"
    for joint, share in spec.friction_share.items():
        if not 0.0 <= share < math.inf:
            yield f"friction_share.{joint}", f"is {share:g}", "give 0 or more"
    for joint, of_motor in spec.motor_inertia.items():
        if not 0.0 <= of_motor <= LARGEST:
            yield f"motor_inertia.{joint}", f"is {of_motor:g}", "give 0 or more, as seen from the joint [kg m^2]"
    yield from impossible_joints(spec.dynamics)
    if spec.encoders is not None:
        yield from impossible_encoders(spec.encoders, spec.control.tick_hz)
    if interface != "torque" or spec.own_law:  # only the torque controller has what follows
        of_torque = {
            "dynamics.compensate": spec.dynamics.compensate, "encoders": spec.encoders is not None,
            "control.delay_s": spec.control.late_s > 0.0,
        }  # fmt: skip
        why = "its drive has a control law of its own"
        if interface != "torque":
            why = f"is for arms that take torques, and the interface is {interface!r}"
        yield from ((key, why, "leave it out") for key, given in of_torque.items() if given)
    place = spec.workspace
    if not all(abs(x) <= LARGEST for x in place.fixture):
        yield "workspace.fixture", "is beyond any physical size", "give metres in base"
    if abs(math.hypot(*place.orientation) - 1.0) > 0.01:
        size = f"has the length {math.hypot(*place.orientation):g}, not 1"
        yield "workspace.orientation", size, "give a unit quaternion, x, y, z, w"
    yield from unfit_obstacles(spec.obstacle)
    names = [arm.name for arm in spec.arm]
    if not all(names):
        yield "arm", "an arm has an empty name", 'write for example name = "arm"'
    if len(set(names)) < len(names):
        yield "arm", f"two arms have one name ({', '.join(names)})", "rename one"
    driven = [actuation.joint for actuation in spec.actuation]
    if len(set(driven)) < len(driven):
        yield "actuation", f"two drive one joint ({', '.join(driven)})", "keep one of them"
    for loop in spec.loop:
        if loop.frame_a == loop.frame_b:
            yield "loop", f"closes {loop.frame_a!r} on itself", "name two frames"
    if (load := spec.payload) is not None and not 0.0 <= load.mass <= load.rating < math.inf:
        text = f"mass {load.mass:g} kg is not within 0 and the rating of {load.rating:g} kg"
        yield "payload", text, "correct it"
    for link, inertia in spec.inertia.items():
        if not all(abs(x) <= LARGEST for x in (inertia.mass, *inertia.com, *inertia.inertia)):
            yield f"inertia.{link}", "holds a number beyond any physical size", "correct it"

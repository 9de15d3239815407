"""`RobotSpec`: what robot.toml says about a robot, checked. No library of robot dynamics is needed to read it.

A robot is a name under a `robots/` folder (shipped, or in `$SKILLFRAME_PATH`), a folder, a robot.toml, or, to be
checked, a bare URDF, which stands on a fixed base and has no arm until a robot.toml names one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Literal

from skillframe.config import build, read_toml
from skillframe.errors import InputError, UnknownName
from skillframe.paths import OFFERS, data_dirs
from skillframe.robot.driven import (
    Actuation,
    DeclaredDrive,
    DeclaredPayload,
    Gains,
    LoopClosure,
    MachineNoise,
    impossible,
)
from skillframe.robot.home import home_in_si
from skillframe.robot.interface import Control, check_control
from skillframe.robot.joint_settings import Dynamics, Encoders, impossible_encoders, impossible_joints
from skillframe.robot.mount import Mount, unfit_mount
from skillframe.robot.numbers import LARGEST
from skillframe.robot.surroundings import DeclaredCollisions, Obstacle, unfit_obstacles

OWN_DRIVES = ("hydraulic", "servo")
Vector = tuple[float, float, float]
_URDF_SUFFIXES = (".urdf", ".xml", ".xacro", ".sdf")


@dataclass(frozen=True, slots=True, kw_only=True)
class Arm:
    """One arm.

    Attributes:
        name: of the arm.
        tool_frame: the URDF frame (flange, wrist) that tools are mounted on, z axis out along the tool.
    """

    name: str
    tool_frame: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """Limits that stop a run. None switches one off.

    Attributes:
        force_n: contact force at the tool [N].
        torque_n_m: contact torque at the tool [N m].
        torque_rate_nm_s: change of a joint's commanded torque [N m/s].
        workspace_m: box the tool point stays in, (lower, upper) corners in base [m, -1000m to 1000m], in which the
            largest machines fit.
        energy_j: energy the controller may put into the robot [J].
    """

    force_n: float | None = 80.0
    torque_n_m: float | None = None
    torque_rate_nm_s: float | None = 1000.0
    workspace_m: tuple[Vector, Vector] | None = None
    energy_j: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Workspace:
    """Where work is done.

    Attributes:
        fixture: the place in base where a world's fixture stands [m, -100m to 100m]; no machine reaches further.
        attitude: (x, y, z, w), turns it from upright, for a fixture that a second arm holds sideways.
    """

    fixture: Vector = (0.0, 0.0, 0.0)
    attitude: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 1.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkInertia:
    """Inertia of a link that replaces the URDF's, in link axes.

    Attributes:
        mass: of the link [kg].
        com: centre of mass [m].
        inertia: xx, yy, zz, xy, xz, yz about the centre of mass [kg m^2].
        guessed: the mass is a guess, as `robots check` prints it; what fails with it says so.
    """

    mass: float
    com: Vector = (0.0, 0.0, 0.0)
    inertia: tuple[float, float, float, float, float, float]
    guessed: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotFile:
    """The keys of robot.toml, word for word (contract: robot.toml). Those without a line here: `RobotSpec`.

    Attributes:
        urdf: file of the robot, from the folder of robot.toml.
        summary: one line for people.
    """

    urdf: str
    summary: str = ""
    base: Literal["fixed", "free"] = "fixed"
    mimic: bool = True
    arm: tuple[Arm, ...] = ()
    home: dict[str, float] = field(default_factory=dict)
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
    drive: DeclaredDrive | None = None
    actuation: tuple[Actuation, ...] = ()
    sensors: MachineNoise = field(default_factory=MachineNoise)
    gains: Gains = field(default_factory=Gains)
    collisions: DeclaredCollisions = field(default_factory=DeclaredCollisions)
    obstacle: tuple[Obstacle, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotSpec:
    """A robot as declared.

    Attributes:
        name: folder's name, or the URDF's stem; summary: one line for people.
        folder: where relative paths start; urdf: absolute path of the URDF.
        declared: whether a robot.toml says all this; False for a bare URDF.
        base: "fixed", or "free" for a free-flying body.
        mimic: joints with a URDF mimic tag follow their leader; False makes every joint independent.
        home: joint positions by joint name [rad or m]; joints not named stand at the neutral position.
        friction_share: part of the drawn `robot.joint_friction` that a joint gets, by name; 1 for joints not named.
        motor_inertia: what motor and gear add to a joint's inertia, by name: the rotor's times the gear ratio squared
            [kg m^2, or kg where the joint slides]; 0 for joints not named.
        dynamics: friction and damping of joints in place of the URDF's, and whether the controller compensates them.
        encoders: of the joints; None where the controller knows positions and velocities exactly.
        mount: soft, between sensor and tool, or None; payload: what is carried, where it can be changed.
        inertia: overlay by link name; loop: closed chains; actuation: what drives joints, of the kind in `drive`.
        sensors, gains: of a machine with actuators.
        collisions: which bodies may touch; obstacle: what stands around it.
    """

    name: str
    folder: Path
    urdf: Path
    declared: bool = True
    summary: str = ""
    base: Literal["fixed", "free"] = "fixed"
    mimic: bool = True
    arm: tuple[Arm, ...] = ()
    home: dict[str, float] = field(default_factory=dict)
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
    drive: DeclaredDrive | None = None
    actuation: tuple[Actuation, ...] = ()
    sensors: MachineNoise = field(default_factory=MachineNoise)
    gains: Gains = field(default_factory=Gains)
    collisions: DeclaredCollisions = field(default_factory=DeclaredCollisions)
    obstacle: tuple[Obstacle, ...] = ()

    @property
    def hydraulic(self) -> bool:
        """Whether hydraulic cylinders drive it, which is what actuators are where nothing else is said."""
        return bool(self.actuation) and (self.drive is None or self.drive.kind == "hydraulic")

    @property
    def servo(self) -> bool:
        """Whether electric servos drive it."""
        return bool(self.actuation) and self.drive is not None and self.drive.kind == "servo"

    @property
    def other_drive(self) -> str:
        """Name of the plug-in's drive that it has. "" for those of skillframe."""
        return "" if self.drive is None or self.drive.kind in OWN_DRIVES else self.drive.kind

    def require_simulated(self) -> None:
        """Refuse to be simulated where that would be wrong.

        Raises:
            InputError: the robot has closed loops and no actuators in them, or names no arm.
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
    """The robot of a shipped name, a folder with robot.toml, a robot.toml, or a bare URDF.

    Raises:
        InputError: a file is missing, or says something that is not allowed.
        UnknownName: a name that neither a `robots/` folder nor a plug-in has.
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
        fix = "give a URDF, a robot.toml, a folder with one, or a name from `skillframe robots list`"
        raise InputError(path, "no such file", fix)
    return _from_toml(path) if path.suffix == ".toml" else _from_urdf(path)


def robot_names() -> dict[str, Path]:
    """Folder of every robot that can be named: the user's own, then the shipped ones, then those of plug-ins."""
    return {**OFFERS["robots"](None), **_named_folders()}


def robot_folder(name: str, note: str = "") -> Path:
    """The folder of a robot.

    Args:
        name: of the robot.
        note: what to say besides if there is none.

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
    """Folder by name of what lies in a `robots/` folder."""
    names: dict[str, Path] = {}
    for folder in data_dirs("robots"):
        for robot in sorted(p.parent for p in folder.glob("*/robot.toml")):
            names.setdefault(robot.name, robot)
    return names


def _from_urdf(path: Path) -> RobotSpec:
    path = path.resolve()
    return RobotSpec(name=path.stem, folder=path.parent, urdf=path, declared=False)


def _from_toml(path: Path) -> RobotSpec:
    values = home_in_si(read_toml(path), path)
    declared = build(RobotFile, values, str(path))
    folder = path.resolve().parent
    urdf = folder / declared.urdf
    if not urdf.is_file():
        raise InputError(f"{path}: urdf", f"there is no file {declared.urdf!r} beside it", "correct the name")
    _check_values(declared, str(path))
    rest = {f.name: getattr(declared, f.name) for f in fields(declared) if f.name != "urdf"}
    return RobotSpec(name=folder.name, folder=folder, urdf=urdf.resolve(), **rest)


def _check_values(declared: RobotFile, where: str) -> None:
    """Values that have the right type and are still impossible."""
    positive = {
        f"limits.{k}": getattr(declared.limits, k) for k in ("force_n", "torque_n_m", "torque_rate_nm_s", "energy_j")
    }
    for key, value in positive.items():
        if value is not None and not (0.0 < value < math.inf):
            raise InputError(f"{where}: {key}", f"is {value:g}", "give a positive, finite number")
    check_control(declared.control, where)
    _check_one_arm(declared, where)
    _check_machine(declared, where)
    for joint, value in declared.home.items():
        if not math.isfinite(value):
            raise InputError(f"{where}: home.{joint}", f"is {value:g}", "give a finite number")
    box = declared.limits.workspace_m
    if box is not None and not all(low < high for low, high in zip(*box, strict=True)):
        raise InputError(f"{where}: limits.workspace_m", f"{box} is empty", "give the lower corner first")
    for joint, share in declared.friction_share.items():
        if not 0.0 <= share < math.inf:
            raise InputError(f"{where}: friction_share.{joint}", f"is {share:g}", "give 0 or more")
    for joint, inertia_of_motor in declared.motor_inertia.items():
        if not 0.0 <= inertia_of_motor <= LARGEST:
            text = f"is {inertia_of_motor:g}"
            raise InputError(f"{where}: motor_inertia.{joint}", text, "give 0 or more, as felt at the joint [kg m^2]")
    _check_joints(declared, where)
    place = declared.workspace
    if not all(abs(x) <= LARGEST for x in place.fixture):
        raise InputError(f"{where}: workspace.fixture", "is beyond any physical size", "give metres in base")
    if abs(math.hypot(*place.attitude) - 1.0) > 0.01:
        size = f"has the length {math.hypot(*place.attitude):g}, not 1"
        raise InputError(f"{where}: workspace.attitude", size, "give a unit quaternion, x, y, z, w")
    for key, problem, fix in unfit_obstacles(declared.obstacle):
        raise InputError(f"{where}: {key}", problem, fix)
    _check_names(declared, where)
    if (load := declared.payload) is not None and not 0.0 <= load.mass <= load.rating < math.inf:
        text = f"mass {load.mass:g} kg is not within 0 and the rating of {load.rating:g} kg"
        raise InputError(f"{where}: payload", text, "correct it")
    for link, inertia in declared.inertia.items():
        if not all(abs(x) <= LARGEST for x in (inertia.mass, *inertia.com, *inertia.inertia)):
            raise InputError(f"{where}: inertia.{link}", "holds a number beyond any physical size", "correct it")


def _check_joints(declared: RobotFile, where: str) -> None:
    """Joints' dynamics and encoders, and the loop's delay, which are those of the torque law."""
    problems = list(impossible_joints(declared.dynamics))
    if declared.encoders is not None:
        problems += impossible_encoders(declared.encoders, declared.control.tick_hz)
    kind = declared.drive.kind if declared.drive is not None else "hydraulic" if declared.actuation else ""
    if kind == "hydraulic":
        own = "a hydraulic machine's "
        told = {"dynamics.compensate": f"{own}law identifies friction by itself"}
        told |= {"encoders": f"{own}encoders are in [sensors]"}
        told |= {"control.delay_s": f"{own}delay is the quantity actuator.delay"}
    else:
        told = dict.fromkeys(("dynamics.compensate", "encoders", "control.delay_s"), f"its drive is {kind!r}")
    given = (declared.dynamics.compensate, declared.encoders is not None, declared.control.late_s > 0.0)
    if admits := (interface := declared.control.interface) != "torque":
        told = dict.fromkeys(told, f"is for arms that take torques, and the interface is {interface!r}")
    if admits or kind not in ("", "servo"):
        problems += [(key, told[key], "leave it out") for key, is_given in zip(told, given, strict=True) if is_given]
    for key, problem, fix in problems:
        raise InputError(f"{where}: {key}", problem, fix)


def _check_machine(declared: RobotFile, where: str) -> None:
    """Sensors and gains of a hydraulic machine, and of nothing else."""
    kind = None if declared.drive is None else declared.drive.kind
    if kind in OWN_DRIVES and not declared.actuation:
        raise InputError(f"{where}: drive", "there is no [[actuation]] that it could be the kind of", "leave it out")
    if kind == "servo" and (declared.loop or len(declared.arm) > 1):
        what = "closed loops" if declared.loop else "several arms"
        raise InputError(f"{where}: drive", f"servos drive one open arm, and this robot has {what}", "leave it out")
    if declared.actuation and kind in (None, "hydraulic"):
        for key, problem, fix in impossible(declared.actuation, declared.sensors, declared.gains):
            raise InputError(f"{where}: {key}", problem, fix)
    elif (declared.sensors, declared.gains) != (MachineNoise(), Gains()):
        what = "actuators are servos" if kind == "servo" else f"drive is {kind!r}"
        none = f"its {what}" if declared.actuation else "there is no [[actuation]]"
        text = f"[sensors] and [gains] are those of a machine with actuators, and {none}"
        raise InputError(where, text, "leave them out; a wrist sensor's noise is varied as `sensor.*` in a campaign")


def _check_one_arm(declared: RobotFile, where: str) -> None:
    """Velocities, positions and mounts are for one arm on a fixed base, whose joints nothing else drives."""
    kind = declared.control.interface
    others = {
        "is a machine whose joints are driven as [[actuation]] says": declared.actuation,
        "has a drive of its own": declared.drive, "has closed loops": declared.loop,
        "has several arms": len(declared.arm) > 1, "stands on a free base": declared.base == "free",
    }  # fmt: skip
    other = next((what for what, true in others.items() if true), "")
    for key, problem, fix in () if declared.mount is None else unfit_mount(declared.mount, declared.control, other):
        raise InputError(f"{where}: {key}", problem, fix)
    if other and kind != "torque":
        text = f"is {kind!r}, which one arm on a fixed base takes, and this robot {other}"
        raise InputError(f"{where}: control.interface", text, 'leave it out, or write "torque"')


def _check_names(declared: RobotFile, where: str) -> None:
    """Names that must differ, and must be there."""
    names = [arm.name for arm in declared.arm]
    if not all(names):
        raise InputError(f"{where}: arm", "an arm has an empty name", 'write for example name = "arm"')
    if len(set(names)) < len(names):
        raise InputError(f"{where}: arm", f"two arms have one name ({', '.join(names)})", "rename one")
    driven = [actuation.joint for actuation in declared.actuation]
    if len(set(driven)) < len(driven):
        raise InputError(f"{where}: actuation", f"two drive one joint ({', '.join(driven)})", "keep one of them")
    for loop in declared.loop:
        if loop.frame_a == loop.frame_b:
            raise InputError(f"{where}: loop", f"closes {loop.frame_a!r} on itself", "name two frames")

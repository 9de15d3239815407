r"""Mass audit of a robot, behind `skillframe robots --check`: can its dynamics be computed?

The mass matrix is \(M = L^T D L\) (Featherstone, Rigid Body Dynamics Algorithms, 2008, ch. 6): \(D_i\) is the inertia
that joint i moves while all joints beyond it are free. A ratio \(D_i / M_{ii}\) of zero means that it moves no inertia
of its own. At tool speed \(v\) a joint with friction \(f\) and damping \(d\) resists with \(f / r + d v / r^2\); its
lever is \(r^2 = |J_v|^2 + l^2 |J_\omega|^2\) at home, with \(l\) = 0.1 m.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from skillframe.config.units import meant
from skillframe.errors import InputError
from skillframe.frames import Float, norm
from skillframe.robot.bodies import Body, missing_meshes
from skillframe.robot.kinematics import RobotState, random_configuration
from skillframe.robot.link_checks import (
    Given,
    Problem,
    given_inertias,
    guessed_bodies,
    impossible_inertias,
    inertia_fix,
    missing_inertias,
    oversized_inertias,
    placeholder_masses,
    tiny_masses,
    toy_masses,
)
from skillframe.robot.model import CONTINUOUS, ROOT_JOINT, RobotModel, load_model, mimic_joints
from skillframe.robot.spec import RobotSpec
from skillframe.robot.urdf import Joint, numbers


@dataclass(frozen=True, slots=True, kw_only=True)
class Audit:
    """Result of the audit.

    Attributes:
        usable: no problem is fatal; nq, nv: of Pinocchio.
        mass_kg: of all links.
    """

    usable: bool
    nq: int
    nv: int
    mass_kg: float
    problems: tuple[Problem, ...]


def audit(robot: RobotSpec | RobotModel, total_kg: float | None = None) -> Audit:
    """Check a robot, declared or loaded, with guessed masses scaled to `total_kg` of the whole.

    Raises:
        InputError, UnknownName: it does not load, or its known links weigh more than `total_kg`.
    """
    robot = load_model(robot) if isinstance(robot, RobotSpec) else robot
    given = given_inertias(robot)
    bodies = guessed_bodies(robot, given, total_kg)
    problems = [
        *placeholder_masses(robot, given, bodies),
        *mass_matrix_problems(robot, given, bodies),
        *impossible_inertias(robot, given, bodies),
        *oversized_inertias(robot, given, bodies),
        *missing_inertias(robot, given, bodies),
        *tiny_masses(robot, bodies),
        *toy_masses(robot, given),
        *giant_meshes(bodies),
        *joint_warnings(robot),
    ]
    return Audit(
        usable=not any(p.severity == "fatal" for p in problems),
        nq=int(robot.model.nq),
        nv=int(robot.model.nv),
        mass_kg=sum(g.mass for g in given.values()),
        problems=tuple(problems),
    )


def unusable(spec: RobotSpec, reason: object) -> InputError:
    """Error for a robot that a simulator refuses: the first fatal problem, else the simulator's message."""
    fatal = next((p for p in audit(spec).problems if p.severity == "fatal"), None)
    text = fatal.message if fatal else " ".join(str(reason).removeprefix("Error: ").split())
    return InputError(f"robot {spec.name!r}", f"cannot be simulated: {text}", "type: skillframe robots ROBOT --check")


def mass_matrix_problems(robot: RobotModel, given: dict[str, Given], bodies: list[Body]) -> Iterator[Problem]:
    """Check joint by joint that the mass matrix can be inverted."""
    pivots = smallest_pivots(robot.model, robot.home)
    if robot.model.nv and np.abs(pivots.inertia).max() <= SINGULAR:
        moving = [body.links[0] for body in bodies if body.joint is not None or robot.spec.base == "free"]
        text, fix = "the mass matrix is zero: no joint moves any inertia", inertia_fix(moving, given, bodies)
        yield Problem(code="zero_mass_matrix", severity="fatal", where=robot.urdf.root, message=text, fix=fix)
        return
    worst: dict[str, tuple[float, float]] = {}
    for i in range(robot.model.nv):
        joint = joint_of(robot.model, i)
        inertia, ratio = worst.get(joint, (np.inf, np.inf))
        worst[joint] = min(inertia, float(pivots.inertia[i])), min(ratio, float(pivots.ratio[i]))
    heads = {body.joint or ROOT_JOINT: body.links[0] for body in bodies}
    for joint, (inertia, ratio) in worst.items():
        fix = inertia_fix([heads[joint]], given, bodies)
        if inertia <= SINGULAR or ratio <= SINGULAR:
            why = "moves no inertia at all" if inertia <= SINGULAR else "moves no inertia of its own"
            text = f"the mass matrix is singular: joint {joint!r} {why}; give it an axis that is not zero, or inertia"
            yield Problem(code="singular_mass_matrix", severity="fatal", where=joint, message=text, fix=fix)
        elif ratio < 1e-9:
            text = (
                f"the mass matrix is nearly singular: joint {joint!r} moves {ratio:.1g} of the inertia that it carries"
            )
            yield Problem(code="ill_conditioned", severity="warning", where=joint, message=text, fix=fix)


SINGULAR = 1e-12  # rounding leaves 1e-15 at an inertialess joint; a planar chain of 100 links has 2e-6


class Pivots(NamedTuple):
    """Smallest values over the configurations, per degree of freedom.

    Attributes:
        inertia: (nv,) diagonal entry relative to the carried inertia; ratio: (nv,) D_i / M_ii.
    """

    inertia: Float
    ratio: Float


def smallest_pivots(model: pin.Model, home: Float) -> Pivots:
    """Evaluate the mass matrix at home and at random configurations within the limits."""
    rng = np.random.default_rng(0)
    count = int(np.clip(2000 / max(model.nv, 1), 8, 100))
    configurations = [home, *(random_configuration(model, rng) for _ in range(count))]
    inertia, ratio = np.full(model.nv, np.inf), np.full(model.nv, np.inf)
    for q in configurations:
        data = model.createData()  # fresh data: with mimic joints, crba adds to its earlier result
        upper = np.triu(pin.crba(model, data, q))
        mass = upper + np.triu(upper, 1).T
        moved = np.diag(mass)
        carried = _carried(model, data)
        there = carried > 0.0
        inertia = np.minimum(inertia, np.where(there, moved / np.where(there, carried, 1.0), np.sign(moved)))
        ratio = np.minimum(ratio, pivot_ratios(mass))
    return Pivots(inertia, ratio)


def pivot_ratios(mass: Float) -> Float:
    """(n,) D_i / M_ii of a symmetric matrix, or 0 where M_ii is not positive."""
    diagonal = np.diag(mass)
    scale = np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
    rest = mass / scale[:, None] / scale
    ratios = np.zeros(len(mass))
    for i in range(len(mass) - 1, -1, -1):
        ratios[i] = rest[i, i]
        if ratios[i] > SINGULAR:
            column = rest[:i, i]
            rest[:i, :i] -= np.outer(column, column) / ratios[i]
    return ratios


def _carried(model: pin.Model, data: pin.Data) -> Float:
    """(nv,) carried mass of prismatic, or trace of inertia of revolute joints."""
    carried = np.zeros(model.nv)
    for index in range(1, model.njoints):
        joint, load = model.joints[index], data.Ycrb[index]
        square = sum(x * x for x in load.lever.tolist())  # without bound where negative masses cancel the others
        turning = float(np.trace(load.inertia)) + 2.0 * load.mass * square
        sliding = joint.shortname().startswith("JointModelP") if joint.nv == 1 else {3: 2, 6: 3}.get(joint.nv, 0)
        for i in range(joint.nv):
            carried[joint.idx_v + i] = load.mass if i < sliding else turning
    return carried


def joint_of(model: pin.Model, velocity: int) -> str:
    """Name of the joint of a velocity index."""
    for index in range(1, model.njoints):
        joint = model.joints[index]
        if joint.idx_v <= velocity < joint.idx_v + joint.nv:
            return str(model.names[index])
    raise IndexError(velocity)


TURNING, SPEED, PUSH = 0.1, 0.02, 1.0  # l [m]; v [m/s]; force worth a warning [N]
MOST_NAMES = 3


class Resistance(NamedTuple):
    """Friction [N m or N], damping [N m s/rad or N s/m], and force at the tool [N] of a joint."""

    joint: str
    friction: float
    damping: float
    sliding: bool
    push: float

    @property
    def figures(self) -> str:
        """Friction and damping as text."""
        force, rate = ("N", "N s/m") if self.sliding else ("Nm", "Nm s/rad")
        given = ((self.friction, "friction", force), (self.damping, "damping", rate))
        return " and ".join(f"{what} {value:g} {unit}" for value, what, unit in given if value > 0.0)


def resistances(robot: RobotModel) -> list[Resistance]:
    """Resistances of the joints that move a tool frame (any frame without an arm)."""
    model = robot.model
    if not (np.any(model.friction) or np.any(model.damping)):
        return []
    frames = robot.tool_frames or range(1, model.nframes)
    state = RobotState(model, robot.home, np.zeros(model.nv))
    scale = np.array([[1.0]] * 3 + [[TURNING]] * 3)
    levers = [np.square(state.jacobian(f).reshape(6, -1) * scale).sum(axis=0) for f in frames]
    squares = np.max(levers, axis=0, initial=0.0)
    found = []
    for index in range(1, model.njoints):
        joint = model.joints[index]
        if joint.nv != 1 or squares[joint.idx_v] <= 0.0:
            continue
        friction, damping = float(model.friction[joint.idx_v]), float(model.damping[joint.idx_v])
        square = float(squares[joint.idx_v])
        push = friction / np.sqrt(square) + damping * SPEED / square
        sliding = robot.urdf.joints[model.names[index]].type == "prismatic"
        found.append(Resistance(model.names[index], friction, damping, sliding, float(push)))
    return [one for one in found if one.push > 0.0]


def hurting(robot: RobotModel) -> list[Resistance]:
    """The joints above the warning threshold, the worst first."""
    return sorted((one for one in resistances(robot) if one.push >= PUSH), key=lambda one: -one.push)


def resistance_note(robot: RobotModel) -> str:
    """Advice for a failure with resisting joints, or ""."""
    worst = hurting(robot)
    if not worst or robot.spec.own_law:
        return ""
    named = ", ".join(f"{one.joint} ({one.figures}: {one.push:.2g} N of a push)" for one in worst[:MOST_NAMES])
    rest = f" and {len(worst) - MOST_NAMES} more" if len(worst) > MOST_NAMES else ""
    known = "the controller compensates them while a joint moves, not at rest" if robot.spec.dynamics.compensate else (
        "the controller does not know of it"
    )  # fmt: skip
    return (
        f"joints of {robot.spec.name} resist: {named}{rest}; {known}; first give what the maker "
        "says in robot.toml's [dynamics]"
    )


_ACTUATED = ("revolute", "continuous", "prismatic")
_PLACE, _RATE = ("rad", "m"), ("rad/s", "m/s")
_FREE = "it counts as free within +-2 pi rad or +-10 m"


def joint_warnings(robot: RobotModel) -> Iterator[Problem]:
    """Missing or implausible limits, mimic and continuous joints, and missing meshes."""
    passive = tuple(robot.urdf.joints) if robot.spec.own_law else robot.followers
    for joint in robot.urdf.joints.values():
        if joint.type in _ACTUATED and joint.name not in passive and not _limit(joint, "effort") > 0.0:
            text = f"joint {joint.name!r} has no effort limit; its motor counts as unlimited"
            yield _warning("no_effort_limits", joint.name, text, 'write effort="..." [N m or N] in its <limit>')
        yield from _position(joint)
        yield from _in_another_unit(joint)
        if joint.type == CONTINUOUS and not robot.spec.loop:
            text = f"joint {joint.name!r} is continuous: it has two coordinates in q (cosine, sine) and one in v"
            yield _warning("continuous", joint.name, text, "nothing to do; give angles in [home] as usual")
    yield from _mimic(robot)
    head = "put this into robot.toml, with what the maker says (0 where the arm compensates by itself):"
    for one in hurting(robot) if not robot.spec.own_law else ():
        text = f"joint {one.joint!r} has {one.figures}, which takes {one.push:.2g} N of the 20 N that skills push with"
        text += "; it is compensated while the joint moves, not at rest" if robot.spec.dynamics.compensate else ""
        fix = f"{head}\n[dynamics.joint]\n{one.joint} = {{ friction = 0.0, damping = 0.0 }}"
        yield _warning("joint_resists", one.joint, text, fix)
    for uri, link in missing_meshes(robot.urdf).items():
        text = f"mesh {uri!r} is not found; the robot works without it, its drawing, size and collisions do not know it"
        yield _warning(
            "missing_mesh", link, text, "put its package's parent folder into SKILLFRAME_PATH or ROS_PACKAGE_PATH"
        )
    if robot.model.nv == 0:
        text = "nothing moves: there is no joint but fixed ones, and the base is fixed"
        yield _warning("no_moving_joints", robot.urdf.root, text, 'write base = "free" in robot.toml for a free body')
    if robot.spec.loop and not robot.spec.actuation:
        text = "it has [[loop]] and no [[actuation]]: nothing drives its loops, so it can be checked and shown, not run"
        yield _warning("not_driven", "robot.toml", text, "say in [[actuation]] which joints of the loops are driven")


def giant_meshes(bodies: list[Body]) -> Iterator[Problem]:
    """Moving links with a mesh in another unit: more than ten times the robot's reach."""
    reach = sum(float(norm(body.far[None])[0]) for body in bodies if body.joint is not None)
    for body in bodies if reach > 0.0 else ():
        for mesh, size in body.meshes.items() if body.joint is not None else ():
            if size > 10.0 * reach:
                text = f"mesh {mesh!r} is {size:.3g} m long, and the robot reaches {reach:.3g} m from joint to joint"
                fix = 'if it is drawn in millimetres, write scale="0.001 0.001 0.001" in its <mesh>'
                yield Problem(code="giant_mesh", severity="fatal", where=body.links[0], message=text, fix=fix)


def _position(joint: Joint) -> Iterator[Problem]:
    if joint.type not in ("revolute", "prismatic"):
        return
    low, high = _limit(joint, "lower"), _limit(joint, "upper")
    fix = 'write lower="..." and upper="..." in its <limit>'
    if joint.element.find("limit") is None:
        text = f"joint {joint.name!r} has no limits; {_FREE}"
        yield _warning("no_position_limits", joint.name, text, fix)
    elif low == high:
        text = f"joint {joint.name!r} has equal limits ({low:g}); {_FREE}"
        yield _warning("no_position_limits", joint.name, text, fix)
    elif low > high:
        text = f"joint {joint.name!r} has its limits reversed ({low:g} > {high:g}); {_FREE}"
        yield _warning("reversed_limits", joint.name, text, "exchange lower and upper")


def _in_another_unit(joint: Joint) -> Iterator[Problem]:
    if joint.type not in _ACTUATED:
        return
    slides = joint.type == "prismatic"
    for key, units, most in (
        ("lower", _PLACE, (26.0, 100.0)),
        ("upper", _PLACE, (26.0, 100.0)),
        ("velocity", _RATE, (200.0, 20.0)),
    ):  # largest [rad, m] and [rad/s, m/s] of revolute and prismatic joints
        unit, value, largest = units[slides], _limit(joint, key), most[slides]
        unlimited = value != 0.0 and math.log10(abs(value)).is_integer()  # 1000 or 1e9 means unlimited
        words = [] if unlimited or abs(value) <= largest else meant(abs(value), unit, largest.__ge__)
        if words:
            text = f"joint {joint.name!r} has {key}={value:g} {unit}, and no joint here goes beyond {largest:g} {unit}"
            where = f"if {' or '.join(words)} are meant, write it in {unit}"
            yield _warning("limit_in_another_unit", joint.name, text, where)


def _mimic(robot: RobotModel) -> Iterator[Problem]:
    for name in mimic_joints(robot.urdf):
        element = robot.urdf.joints[name].element.find("mimic")
        leader = element.get("joint") if element is not None else None
        if robot.mimic_fallback:
            text = f"joint {name!r} should follow {leader!r} and is independent instead ({robot.mimic_fallback})"
            fix = (
                "let every mimic joint follow a joint that moves, is no follower itself and comes before it "
                "(branches are taken in the alphabetical order of their joints)"
            )
            if CONTINUOUS in robot.mimic_fallback:
                fix = 'make it revolute, with lower="..." and upper="..." in its <limit>'
            yield _warning("mimic_independent", name, text, fix)
        elif name in robot.followers:
            text = f"joint {name!r} follows {leader!r}: it has no coordinate of its own"
            yield _warning("mimic", name, text, "write mimic = false in robot.toml to make it independent")


def _limit(joint: Joint, name: str) -> float:
    return numbers(joint.element.find("limit"), name, 1, (0.0,))[0]


def _warning(code: str, where: str, message: str, fix: str) -> Problem:
    return Problem(code=code, severity="warning", where=where, message=message, fix=fix)

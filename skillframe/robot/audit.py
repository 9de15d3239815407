"""Can this robot be used for dynamics? The mass audit behind `skillframe robots check`.

Fatal: a zero or singular mass matrix, a moving body whose inertia is impossible or too large for its size (contract:
`robots check`). Each comes with the robot.toml lines that fix it. Everything else is a warning;
`skillframe.machine.checks.audit` adds those of driven machines.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from skillframe.errors import InputError
from skillframe.robot.bodies import Body
from skillframe.robot.joint_checks import joint_warnings
from skillframe.robot.link_checks import (
    Given,
    given_inertias,
    guessed_bodies,
    impossible_inertias,
    inertia_fix,
    missing_inertias,
    oversized_inertias,
    tiny_masses,
    toy_masses,
)
from skillframe.robot.mass_matrix import ILL_CONDITIONED, SINGULAR, joint_of, smallest_pivots
from skillframe.robot.model import ROOT_JOINT, RobotModel, load_model
from skillframe.robot.problems import Problem
from skillframe.robot.spec import RobotSpec


@dataclass(frozen=True, slots=True, kw_only=True)
class Audit:
    """The answer.

    Attributes:
        usable: no problem is fatal; nq, nv: Pinocchio's.
        mass_kg: of all links together, the base included.
    """

    usable: bool
    nq: int
    nv: int
    mass_kg: float
    problems: tuple[Problem, ...]


def audit(robot: RobotSpec | RobotModel, total_kg: float | None = None) -> Audit:
    """Check a robot.

    Args:
        robot: as declared, or loaded.
        total_kg: mass of the whole robot, its base included, that guessed masses are scaled to.

    Raises:
        InputError, UnknownName: it does not load, or its links weigh more than `total_kg` already.
    """
    robot = load_model(robot) if isinstance(robot, RobotSpec) else robot
    given = given_inertias(robot)
    bodies = guessed_bodies(robot, given, total_kg)
    problems = [
        *mass_matrix_problems(robot, given, bodies),
        *impossible_inertias(robot, given, bodies),
        *oversized_inertias(robot, given, bodies),
        *missing_inertias(robot, given, bodies),
        *tiny_masses(robot, bodies),
        *toy_masses(robot, given),
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
    """Refuse a robot that a simulator does not take: the audit's first fatal problem, else the simulator's words."""
    fatal = next((p for p in audit(spec).problems if p.severity == "fatal"), None)
    text = fatal.message if fatal else " ".join(str(reason).removeprefix("Error: ").split())
    return InputError(f"robot {spec.name!r}", f"cannot be simulated: {text}", "type: skillframe robots check")


def mass_matrix_problems(robot: RobotModel, given: dict[str, Given], bodies: list[Body]) -> Iterator[Problem]:
    """A mass matrix that cannot be inverted, joint by joint."""
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
        yield from _joint_problem(joint, inertia, ratio, fix)


def _joint_problem(joint: str, inertia: float, ratio: float, fix: str) -> Iterator[Problem]:
    if inertia <= SINGULAR or ratio <= SINGULAR:
        why = "moves no inertia at all" if inertia <= SINGULAR else "moves no inertia of its own"
        text = f"the mass matrix is singular: joint {joint!r} {why}; give it an axis that is not zero, or inertia"
        yield Problem(code="singular_mass_matrix", severity="fatal", where=joint, message=text, fix=fix)
    elif ratio < ILL_CONDITIONED:
        text = f"the mass matrix is nearly singular: joint {joint!r} moves {ratio:.1g} of the inertia that it carries"
        yield Problem(code="ill_conditioned", severity="warning", where=joint, message=text, fix=fix)

r"""What is wrong with the inertias of links and bodies.

A rigid body's principal moments obey the triangle inequality \(I_1 + I_2 \ge I_3\), because each is a sum of squares of
two of three coordinates (Wensing, Kim, Slotine, IEEE RA-L 3(1), 2018, eq. 10). Its radius of gyration
\(k = \sqrt{I_3 / m}\) cannot exceed its extent; the contract allows 3 times its size.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Literal, NamedTuple

import numpy as np

from skillframe.frames import Float
from skillframe.robot.bodies import Body, placement, rigid_bodies, size_of
from skillframe.robot.guesses import cylinder, guess_masses, lengths
from skillframe.robot.model import RobotModel
from skillframe.robot.numbers import INERTIA, numbers
from skillframe.robot.problems import Problem, overlay_fix

_ROUNDING = 1e-3  # relative: URDFs carry three to four digits, and flat plates meet the triangle inequality exactly
_NEGLIGIBLE = 1e-15  # of the whole robot: exporters leave rounding such as 1e-18 kg m^2 on decorative links
_GYRATION = 3.0  # contract: radius of gyration over size
TINY = 1e-6  # mass of a body over that of all that moves; a finger's tip is 1e-4 of a large arm. Ours
_SLENDER = 5.0  # length of a guessed cylinder over size, whose radius of gyration is 0.3 times its length


class Given(NamedTuple):
    """Inertia of a link, overlay applied: mass [kg], com (3,) [m], moments (3, 3) about it in link axes [kg m^2]."""

    mass: float
    com: Float
    moments: Float

    @property
    def principal(self) -> Float:
        """(3,) principal moments, ascending."""
        return np.asarray(np.linalg.eigvalsh(self.moments), dtype=float)


def given_inertias(robot: RobotModel) -> dict[str, Given]:
    """Inertia of every link that has one."""
    given: dict[str, Given] = {}
    for name, link in robot.urdf.links.items():
        inertial = link.find("inertial")
        if name in robot.spec.inertia:
            own = robot.spec.inertia[name]
            given[name] = Given(own.mass, np.array(own.com), _matrix(own.inertia))
        elif inertial is not None:
            pose = placement(inertial)
            moments = _matrix(tuple(numbers(inertial.find("inertia"), key, 1, (0.0,))[0] for key in INERTIA))
            mass = numbers(inertial.find("mass"), "value", 1, (0.0,))[0]
            given[name] = Given(mass, pose.position, pose.rotation @ moments @ pose.rotation.T)
    return given


def guessed_bodies(robot: RobotModel, given: Mapping[str, Given], total_kg: float | None) -> list[Body]:
    """The robot's bodies, each with the mass that it is guessed to have where none is given.

    Raises:
        InputError: `total_kg` is not more than the masses that are given.
    """
    bodies = rigid_bodies(robot.urdf)
    sums = {i: sum(given[n].mass for n in body.links if n in given) for i, body in enumerate(bodies)}
    known = {i: mass for i, mass in sums.items() if mass > 0.0}
    guess_masses(bodies, known, robot.spec.base == "free", total_kg)
    return bodies


def inertia_fix(links: list[str], given: Mapping[str, Given], bodies: list[Body]) -> str:
    """The fix: overlay lines for links, with the mass and centre that they have if these are possible."""
    lines = {}
    for body, length in zip(bodies, lengths(bodies), strict=True):
        size = size_of(body, bodies)
        solid = min(length, _SLENDER * size) if size > 0.0 else length  # or the fix would be oversized itself
        for name in (n for n in links if n in body.links):
            own = given.get(name)
            center = own.com if own is not None and np.linalg.norm(own.com) <= max(size, length) else 0.5 * body.far
            known = own is not None and own.mass > 0.0
            at = (float(center[0]), float(center[1]), float(center[2]))
            lines[name] = cylinder(own.mass if own is not None and known else body.guess, solid, at, not known)
    return overlay_fix(lines)


def impossible_inertias(robot: RobotModel, given: Mapping[str, Given], bodies: list[Body]) -> Iterator[Problem]:
    """Links whose mass is negative or whose moments no distribution of mass can have.

    Dynamics know bodies only: such a link is fatal where the body that it is welded into moves and is impossible too.
    """
    whole = sum(abs(g.mass) for g in given.values()) * max(body.reach for body in bodies) ** 2
    for name, inertia in given.items():
        low, middle, high = (float(x) for x in inertia.principal)
        if inertia.mass >= 0.0 and max(high - low - middle, -low) <= _NEGLIGIBLE * whole:
            continue
        if text := _impossible(inertia.mass, inertia.principal):
            body = next(body for body in bodies if name in body.links)
            index, fix = _joint_index(robot, body), inertia_fix([name], given, bodies)
            harm, why = _harm(robot, body, index)
            message = f"link {name!r} {text}{why}"
            yield Problem(code="impossible_inertia", severity=harm, where=name, message=message, fix=fix)


def _harm(robot: RobotModel, body: Body, index: int | None) -> tuple[Literal["fatal", "warning"], str]:
    """How bad an impossible link of a body is, and why no worse."""
    if index is None:
        return "warning", "; it does not move, so no motion depends on it"
    welded = robot.model.inertias[index]
    if _impossible(float(welded.mass), np.linalg.eigvalsh(np.asarray(welded.inertia))):
        return "fatal", ""
    whole = f"{_some(body.links)}, {welded.mass:.3g} kg"
    return "warning", f"; the body that it is fixed in ({whole}) is possible as a whole"


def _impossible(mass: float, principal: Float) -> str:
    """What is impossible about a mass and its principal moments, ascending, or "" if nothing is."""
    low, middle, high = (float(x) for x in principal)
    if mass < 0.0:
        return f"has a negative mass ({mass:g} kg)"
    if low < -_ROUNDING * max(abs(high), abs(low)):
        return f"has a negative principal moment of inertia ({low:.3g} kg m^2)"
    if low + middle < high * (1.0 - _ROUNDING):
        return f"has principal moments {low:.3g}, {middle:.3g}, {high:.3g} kg m^2 against the triangle inequality"
    return ""


def oversized_inertias(robot: RobotModel, given: Mapping[str, Given], bodies: list[Body]) -> Iterator[Problem]:
    """Moving bodies whose radius of gyration exceeds 3 times their size."""
    for body in bodies:
        index, size = _joint_index(robot, body), size_of(body, bodies)
        if index is None or size <= 0.0:
            continue
        inertia = robot.model.inertias[index]
        gyration = _gyration(inertia.mass, np.asarray(inertia.inertia))
        if gyration <= _GYRATION * size:
            continue
        own = [n for n in body.links if n in given]
        large = [n for n in own if _gyration(given[n].mass, given[n].moments) > _GYRATION * size] or own
        text = f"body {_some(body.links)} has a radius of gyration of {gyration:.3g} m but a size of {size:.3g} m"
        fix = inertia_fix(large, given, bodies)
        yield Problem(code="oversized_inertia", severity="fatal", where=large[0], message=text, fix=fix)


def _gyration(mass: float, moments: Float) -> float:
    """Radius of gyration about the worst axis [m], or infinite for inertia without mass."""
    top = float(np.linalg.eigvalsh(moments)[-1])
    if top <= 0.0:
        return 0.0
    return math.sqrt(top / mass) if mass > 0.0 else math.inf


def _joint_index(robot: RobotModel, body: Body) -> int | None:
    """Pinocchio's joint that moves a body, None where nothing does."""
    if body.joint is None:
        return 1 if robot.spec.base == "free" else None
    return int(robot.model.getJointId(body.joint))


def missing_inertias(robot: RobotModel, given: Mapping[str, Given], bodies: list[Body]) -> Iterator[Problem]:
    """Moving bodies of which no link carries mass."""
    for body in bodies:
        if _joint_index(robot, body) is None or any(given[n].mass != 0.0 for n in body.links if n in given):
            continue
        name = body.links[0]
        text = f"link {name!r} moves and has no {'mass' if name in given else 'inertia'}"
        fix = inertia_fix([name], given, bodies)
        yield Problem(code="no_inertia", severity="warning", where=name, message=text, fix=fix)


def tiny_masses(robot: RobotModel, bodies: list[Body]) -> Iterator[Problem]:
    """Moving bodies, links fixed to each other taken together, that weigh next to nothing beside the robot."""
    masses = [(body, index) for body in bodies if (index := _joint_index(robot, body)) is not None]
    whole = sum(max(float(robot.model.inertias[index].mass), 0.0) for _, index in masses)
    fix = "fix its joint, or give it the mass of the real part, in the URDF or in robot.toml's [inertia]"
    for body, index in masses:
        mass = float(robot.model.inertias[index].mass)
        if 0.0 < mass < TINY * whole:
            text = (
                f"body {_some(body.links)} weighs {mass:.1g} kg and the robot {whole:.3g} kg: a placeholder, which any "
            )
            text += "torque on its joint throws about"
            yield Problem(code="tiny_mass", severity="warning", where=body.links[0], message=text, fix=fix)


def toy_masses(robot: RobotModel, given: Mapping[str, Given]) -> Iterator[Problem]:
    """Inertias that somebody typed to make a parser happy: identity, or the same for every link."""
    fix = "give figures from CAD or identification, in the URDF or in robot.toml's [inertia]"
    identity = [n for n, g in given.items() if np.allclose(g.moments, np.eye(3)) and n not in robot.spec.inertia]
    if identity:
        text = f"{_some(identity)}: the inertia is the identity, 1 kg m^2 about every axis, as in a template"
        yield Problem(code="toy_inertia", severity="warning", where=identity[0], message=text, fix=fix)
    masses = {g.mass for g in given.values()}
    if len(given) >= 3 and len(masses) == 1:
        text = f"all {len(given)} links have the same mass, {masses.pop():g} kg, as in a template"
        yield Problem(code="toy_mass", severity="warning", where=robot.urdf.name, message=text, fix=fix)


def _some(names: list[str]) -> str:
    return ", ".join(names[:4]) + (f" and {len(names) - 4} more" if len(names) > 4 else "")


def _matrix(moments: tuple[float, ...]) -> Float:
    xx, yy, zz, xy, xz, yz = moments
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])

r"""Checks of the inertias of links and bodies, and guesses where there are none.

Principal moments obey \(I_1 + I_2 \ge I_3\) (Wensing, Kim, Slotine, IEEE RA-L 3(1), 2018, eq. 10). The radius of
gyration \(k = \sqrt{I_3 / m}\) may be 3 times the body's size.

For a guess, a link is a tube of its reach \(L_i\) to the next joint and its geometry, and a motor that counts as d,
1.5 times the longest reach. Both taper with the carried reach:

    m_i = s (L_i + d) (R_i / R)^0.6,    R_i = L_i + ... to the end of its longest branch, R the largest, R_i >= R / 20

The fit to eleven published arms is within a factor of 2.5 given the total. The scale s follows from a total or a class
(`CLASSES`). Without either, the longest branch of length l weighs 15 kg (l / 1 m)^1.5.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

from skillframe.errors import InputError, UnknownName
from skillframe.frames import Float
from skillframe.robot.bodies import Body, placement, rigid_bodies, size_of
from skillframe.robot.spec import LinkInertia, RobotSpec
from skillframe.robot.urdf import INERTIA, numbers

if TYPE_CHECKING:
    from skillframe.robot.model import RobotModel

CLASSES: dict[str, float] = {
    "cobot-3": 15.5, "cobot-5": 22.0, "cobot-10": 39.0, "cobot-16": 32.3, "cobot-20": 73.0,
    "industrial-7": 33.0, "industrial-12": 115.0, "industrial-25": 250.0,
}  # fmt: skip
"""Mass [kg] of an arm with its base, by kind and payload [kg]: medians of data sheets.

From the Open Robot Database (J. Malzahn, 2021). 3: AUBO i3, Panda, UR3e. 5: A0509, AUBO i5, GoFa, OB7, UR5e. 10: AUBO
i10, CRX-10iA, 10iA/L, HC10, HC10DT, M1013, UR10e. 16: LBR iiwa 14, M1509, TM14, UR16e. 20: H2017, H2515. Industrial:
GP7, GP8; GP12, TX2-90, 90L, 90XL; GP25.
"""
UNKNOWN = 0.1  # m, if no reach is known
MOST_NAMES = 4


def lengths(bodies: list[Body]) -> list[float]:
    """Length of each body's cylinder [m]."""
    return [body.reach + 0.25 * _longest(bodies) for body in bodies]  # what a cylinder is longer than its reach


def class_mass(name: str) -> float:
    """Mass [kg] of a class of arms.

    Raises:
        UnknownName: there is no such class.
    """
    if name not in CLASSES:
        raise UnknownName("class", name, CLASSES)
    return CLASSES[name]


def guess_masses(bodies: list[Body], known: Mapping[int, float], free: bool, total_kg: float | None = None) -> None:
    """Write the guessed mass into every body.

    Args:
        bodies: root first.
        known: masses [kg] by index.
        free: the root moves.
        total_kg: of the whole robot.

    Raises:
        InputError: the total does not exceed the known masses.
    """
    shares, branch = _shares(bodies)
    scale = 15.0 * branch**1.5  # kg/m^1.5
    if total_kg is not None:
        moving = [i for i in range(len(bodies)) if free or bodies[i].joint is not None]
        share_of_moving = 1.0 if free else 0.83  # of an arm with its base, by data sheets
        left = total_kg * share_of_moving - sum(known.get(i, 0.0) for i in moving)
        if not 0.0 < left < math.inf:
            text = f"{total_kg:g} kg leave {left:.3g} kg for the links without a mass"
            raise InputError("the robot's total mass", text, "give the mass on its data sheet, the base included")
        scale = left / (sum(shares[i] for i in moving if i not in known) or 1.0)
    for body, share in zip(bodies, shares, strict=True):
        body.guess = scale * share


def _longest(bodies: list[Body]) -> float:
    moving = max((body.reach for body in bodies if body.joint is not None), default=0.0)
    return moving or max(body.reach for body in bodies) or UNKNOWN


def _shares(bodies: list[Body]) -> tuple[list[float], float]:
    """Mass of every body over that of the longest branch, and this branch's length [m]."""
    ahead = [body.reach for body in bodies]
    follow = [-1] * len(bodies)
    for index in range(len(bodies) - 1, 0, -1):
        parent = bodies[index].parent
        if (reach := bodies[parent].reach + ahead[index]) >= ahead[parent]:
            ahead[parent], follow[parent] = reach, index
    first = max(range(1, len(bodies)), key=lambda i: ahead[i]) if len(bodies) > 1 else 0
    most, motor = ahead[first] or UNKNOWN, 1.5 * _longest(bodies)  # d
    tapered = [min(1.0, max(0.05, reach / most)) ** 0.6 for reach in ahead]
    weights = [(body.reach + motor) * part for body, part in zip(bodies, tapered, strict=True)]
    along = between = 0.0
    while first >= 0:
        along, between = along + weights[first], between + float(np.linalg.norm(bodies[first].far))
        first = follow[first]
    return [weight / along for weight in weights], between or most


def cylinder(mass: float, length: float, center: tuple[float, float, float], guessed: bool) -> LinkInertia:
    """Inertia of a solid cylinder of a link's length, with its larger moment about every axis."""
    across = mass * (3.0 * ((1.0 / 6.0) * length) ** 2 + length**2) / 12.0  # radius over length
    x, y, z = (_short(c) for c in center)
    moments = (_short(across),) * 3 + (0.0, 0.0, 0.0)
    return LinkInertia(mass=_short(mass), com=(x, y, z), inertia=moments, guessed=guessed)


def guess_note(spec: RobotSpec) -> str:
    """Advice for a failure on guessed masses, or "" if none is guessed."""
    links = [name for name, inertia in spec.inertia.items() if inertia.guessed]
    if not links:
        return ""
    rest = f" and {len(links) - MOST_NAMES} more" if len(links) > MOST_NAMES else ""
    total = sum(spec.inertia[name].mass for name in links)
    return (
        f"{spec.name} runs on guessed masses: {', '.join(links[:MOST_NAMES])}{rest}, {total:.3g} kg together; "
        "first give its [inertia] the maker's figures and remove guessed = true"
    )


def _short(value: float) -> float:
    return float(f"{value:.3g}")


@dataclass(frozen=True, slots=True, kw_only=True)
class Problem:
    """A problem.

    Attributes:
        code: fixed word for scripts; severity: "fatal" makes the robot unusable for dynamics, "info" is no problem.
        where: link or joint; message: the problem; fix: what to do; figures: those of the message, in SI, by name.
    """

    code: str
    severity: Literal["fatal", "warning", "info"]
    where: str
    message: str
    fix: str
    figures: Mapping[str, float] = field(default_factory=dict)


def cannot_run(message: str, fix: str) -> Problem:
    """The problem of a robot that checks and shows, and that `skillframe run` refuses."""
    return Problem(code="cannot_run", severity="fatal", where="robot.toml", message=message, fix=fix)


def warning(code: str, message: str, fix: str) -> Problem:
    """A problem of robot.toml that a run survives."""
    return Problem(code=code, severity="warning", where="robot.toml", message=message, fix=fix)


def overlay_fix(inertias: Mapping[str, LinkInertia]) -> str:
    """Message with robot.toml lines that give links an inertia."""
    lines = []
    for link, inertia in inertias.items():
        key = link if re.fullmatch(r"[A-Za-z0-9_-]+", link) else json.dumps(link)
        com, moments = (", ".join(f"{x:g}" for x in values) for values in (inertia.com, inertia.inertia))
        doubt = ", guessed = true" if inertia.guessed else ""
        lines.append(f"{key} = {{ mass = {inertia.mass:g}, com = [{com}], inertia = [{moments}]{doubt} }}")
    guessed = [inertia.mass for inertia in inertias.values() if inertia.guessed]
    how = "type --mass and the data sheet's total, or the arm's kind"
    scale = f" ({sum(guessed):.3g} kg together; {how})" if len(guessed) > 1 else ""
    head = f"put this into a robot.toml, with figures from CAD where they are guesses{scale}:"
    return "\n".join([head, "[inertia]", *lines])


class Given(NamedTuple):
    """Inertia of a link, overlay applied: mass [kg], com (3,) [m], moments about it in link axes (3, 3) [kg m^2]."""

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
    """Bodies of the robot, with guessed masses.

    Raises:
        InputError: `total_kg` does not exceed the given masses.
    """
    bodies = rigid_bodies(robot.urdf)
    sums = {i: sum(given[n].mass for n in body.links if n in given) for i, body in enumerate(bodies)}
    known = {i: mass for i, mass in sums.items() if mass > 0.0}
    guess_masses(bodies, known, robot.spec.base == "free", total_kg)
    if placeholders(bodies, known):
        guess_masses(bodies, {}, robot.spec.base == "free", total_kg)
        for body in bodies:
            body.doubted = True
    return bodies


def placeholders(bodies: list[Body], known: Mapping[int, float]) -> bool:
    """Check whether the given masses together are implausibly small for the robot's reach."""
    moving = [i for i, body in enumerate(bodies) if body.joint is not None and i in known]
    mass, guess = sum(known[i] for i in moving), sum(bodies[i].guess for i in moving)
    cubes = sum(bodies[i].reach ** 3 for i in moving)
    return 0.0 < mass < min(1.0 / 30.0 * guess, 1.0 * cubes)  # hobby arms have 0.1 of the guess; arms 100 kg/m3


def placeholder_masses(robot: RobotModel, given: Mapping[str, Given], bodies: list[Body]) -> Iterator[Problem]:
    """Problem of a robot whose masses are those of a template."""
    if not any(body.doubted for body in bodies):
        return
    moving = [body for body in bodies if body.joint is not None]
    own = sum(given[name].mass for body in moving for name in body.links if name in given)
    guess = sum(body.guess for body in moving)
    text = f"all that moves weighs {own:.2g} kg together, and robots of that reach some {guess:.2g} kg: placeholders"
    names = [body.links[0] for body in moving]
    fix = inertia_fix(names, given, bodies)
    yield Problem(code="placeholder_mass", severity="fatal", where=robot.urdf.name, message=text, fix=fix)


def inertia_fix(links: list[str], given: Mapping[str, Given], bodies: list[Body]) -> str:
    """Overlay lines for links, with their own mass and centre where these are possible."""
    lines = {}
    for body, length in zip(bodies, lengths(bodies), strict=True):
        size = size_of(body, bodies)
        solid = min(length, 5.0 * size) if size > 0.0 else length  # or the fix would be oversized
        for name in (n for n in links if n in body.links):
            own = given.get(name)
            center = own.com if own is not None and np.linalg.norm(own.com) <= max(size, length) else 0.5 * body.far
            known = own is not None and own.mass > 0.0 and not body.doubted
            at = (float(center[0]), float(center[1]), float(center[2]))
            lines[name] = cylinder(own.mass if own is not None and known else body.guess, solid, at, not known)
    return overlay_fix(lines)


def impossible_inertias(robot: RobotModel, given: Mapping[str, Given], bodies: list[Body]) -> Iterator[Problem]:
    """Links with negative mass or impossible moments, fatal if their whole moving body is impossible."""
    whole = sum(abs(g.mass) for g in given.values()) * max(body.reach for body in bodies) ** 2
    for name, inertia in given.items():
        low, middle, high = (float(x) for x in inertia.principal)
        # less is rounding of exporters on decorative links
        if inertia.mass >= 0.0 and max(high - low - middle, -low) <= 1e-15 * whole:
            continue
        if text := _impossible(inertia.mass, inertia.principal):
            body = next(body for body in bodies if name in body.links)
            index, fix = _joint_index(robot, body), inertia_fix([name], given, bodies)
            harm: Literal["fatal", "warning"] = "warning"
            why = "; it does not move, so no motion depends on it"
            if index is not None:
                welded = robot.model.inertias[index]
                why = (
                    f"; the body that it is fixed in ({_some(body.links)}, {welded.mass:.3g} kg) is possible as a whole"
                )
                if _impossible(float(welded.mass), np.linalg.eigvalsh(np.asarray(welded.inertia))):
                    harm, why = "fatal", ""
            message = f"link {name!r} {text}{why}"
            yield Problem(code="impossible_inertia", severity=harm, where=name, message=message, fix=fix)


def _impossible(mass: float, principal: Float) -> str:
    low, middle, high = (float(x) for x in principal)
    if mass < 0.0:
        return f"has a negative mass ({mass:g} kg)"
    if low < -1e-3 * max(abs(high), abs(low)):  # flat plates meet the inequality exactly
        return f"has a negative principal moment of inertia ({low:.3g} kg m^2)"
    if low + middle < high * (1.0 - 1e-3):
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
        if gyration <= 3.0 * size:
            continue
        own = [n for n in body.links if n in given]
        large = [n for n in own if _gyration(given[n].mass, given[n].moments) > 3.0 * size] or own
        text = f"body {_some(body.links)} has a radius of gyration of {gyration:.3g} m but a size of {size:.3g} m"
        fix = inertia_fix(large, given, bodies)
        yield Problem(code="oversized_inertia", severity="fatal", where=large[0], message=text, fix=fix)


def _gyration(mass: float, moments: Float) -> float:
    top = float(np.linalg.eigvalsh(moments)[-1])
    if top <= 0.0:
        return 0.0
    return math.sqrt(top / mass) if mass > 0.0 else math.inf


def _joint_index(robot: RobotModel, body: Body) -> int | None:
    if body.joint is None:
        return 1 if robot.spec.base == "free" else None
    return int(robot.model.getJointId(body.joint))


def missing_inertias(robot: RobotModel, given: Mapping[str, Given], bodies: list[Body]) -> Iterator[Problem]:
    """Moving bodies without mass."""
    for body in bodies:
        if _joint_index(robot, body) is None or any(given[n].mass != 0.0 for n in body.links if n in given):
            continue
        name = body.links[0]
        text = f"link {name!r} moves and has no {'mass' if name in given else 'inertia'}"
        fix = inertia_fix([name], given, bodies)
        yield Problem(code="no_inertia", severity="warning", where=name, message=text, fix=fix)


def tiny_masses(robot: RobotModel, bodies: list[Body]) -> Iterator[Problem]:
    """Moving bodies of negligible mass."""
    masses = [(body, index) for body in bodies if (index := _joint_index(robot, body)) is not None]
    whole = sum(max(float(robot.model.inertias[index].mass), 0.0) for _, index in masses)
    fix = "fix its joint, or give it the mass of the real part, in the URDF or in robot.toml's [inertia]"
    for body, index in masses:
        mass = float(robot.model.inertias[index].mass)
        if 0.0 < mass < 1e-6 * whole:
            text = (
                f"body {_some(body.links)} weighs {mass:.1g} kg and the robot {whole:.3g} kg: a placeholder, which any "
            )
            text += "torque on its joint throws about"
            yield Problem(code="tiny_mass", severity="warning", where=body.links[0], message=text, fix=fix)


def toy_masses(robot: RobotModel, given: Mapping[str, Given]) -> Iterator[Problem]:
    """Placeholder inertias: identity, or equal masses of all links."""
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

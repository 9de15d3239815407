r"""Masses of links that a URDF does not give: a guess from their reaches, and a sentence where one was run with.

A link is a motor and a tube. The tube is as long as its reach \(L_i\) to the next joint and its geometry; the motor
counts as d, 1.5 times the longest such reach. Both taper with the reach that they carry:

    m_i = s (L_i + d) (R_i / R)^0.6,    R_i = L_i + ... to the end of its longest branch, R the largest, R_i >= R / 20

Our choice, fitted to eleven published arms. With the true total a link is then within a factor of 2.5 of its maker's
figure, 1.5 in the mean (root mean square of the logarithm), but for the Panda, whose identification gives link 2 next
to nothing. The scale s comes from a total that the user gives, or from a class of arms (`CLASSES`), of which the moving
links have 83 %: the mean of eight arms, 76 to 90 %. Without either, the longest branch weighs 15 kg (l / 1 m)^1.5, l
being its length from joint to joint, without what shapes stand out: within a factor of 1.7 for arms of up to 20 kg
payload, but for the Gen3, of carbon fibre, 2.5 times too heavy (the mean of the arms is 17.5). What lifts more is
heavier still: the UR30 2.2 times, an industrial arm two to six times.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from skillframe.errors import InputError, UnknownName
from skillframe.robot.bodies import Body
from skillframe.robot.spec import LinkInertia, RobotSpec

CLASSES: dict[str, float] = {
    "cobot-3": 15.5, "cobot-5": 22.0, "cobot-10": 39.0, "cobot-16": 32.3, "cobot-20": 73.0,
    "industrial-7": 33.0, "industrial-12": 115.0, "industrial-25": 250.0,
}  # fmt: skip
"""Mass [kg] of an arm with its base, by kind and payload in kg: medians of makers' data sheets as the Open Robot
Database (J. Malzahn, 2021) has them. cobot-3: AUBO i3 15.5, Panda 17.8, UR3e 11.2. cobot-5: A0509 21, AUBO i5 24,
GoFa 27, OB7 22, UR5e 20.6. cobot-10: AUBO i10 37, CRX-10iA 39, 10iA/L 39, HC10 47, HC10DT 48, M1013 33, UR10e 33.5.
cobot-16: LBR iiwa 14 29.9, M1509 32, TM14 32.6, UR16e 33.1 (0.8 to 1.1 m: shorter than those for 10 kg). cobot-20:
H2017 74, H2515 72. industrial-7: GP7 34, GP8 32. industrial-12: GP12 150, TX2-90 111, 90L 114, 90XL 116.
industrial-25: GP25 250."""
MOVING = 0.83  # of an arm's mass on the data sheet
SCALE = 15.0  # kg/m^1.5
MOTOR, TAPER, LEAST = 1.5, 0.6, 0.05  # d over the longest reach; exponent; R_i over R at the flange
UNKNOWN = 0.1  # m; where no reach is known at all
_THICKNESS = 1.0 / 6.0  # radius over length of the cylinder that a link is guessed to be; our choice
_ENDS = 0.25  # what a cylinder is longer than its reach, over the longest reach; our choice
MOST_NAMES = 4


def lengths(bodies: list[Body]) -> list[float]:
    """Length of every body as a cylinder [m]."""
    return [body.reach + _ENDS * _longest(bodies) for body in bodies]


def class_mass(name: str) -> float:
    """Mass [kg] of a class of arms, the base included.

    Raises:
        UnknownName: there is no such class.
    """
    if name not in CLASSES:
        raise UnknownName("class", name, CLASSES)
    return CLASSES[name]


def guess_masses(bodies: list[Body], known: Mapping[int, float], free: bool, total_kg: float | None = None) -> None:
    """Write into every body the mass that it is guessed to have, by the law above.

    Args:
        bodies: root first; a root that does not move is counted as if it did.
        known: masses [kg] by index of those that have one.
        free: the root moves; then all of `total_kg` does.
        total_kg: of the whole robot, the base included.

    Raises:
        InputError: the total is not more than what is known.
    """
    shares, branch = _shares(bodies)
    scale = SCALE * branch**1.5
    if total_kg is not None:
        moving = [i for i in range(len(bodies)) if free or bodies[i].joint is not None]
        left = total_kg * (1.0 if free else MOVING) - sum(known.get(i, 0.0) for i in moving)
        if not 0.0 < left < math.inf:
            text = f"{total_kg:g} kg leave {left:.3g} kg for the links without a mass"
            raise InputError("the robot's total mass", text, "give the mass on its data sheet, the base included")
        scale = left / (sum(shares[i] for i in moving if i not in known) or 1.0)
    for body, share in zip(bodies, shares, strict=True):
        body.guess = scale * share


def _longest(bodies: list[Body]) -> float:
    """Longest reach of a moving body [m], or of any where none moves, or `UNKNOWN`."""
    moving = max((body.reach for body in bodies if body.joint is not None), default=0.0)
    return moving or max(body.reach for body in bodies) or UNKNOWN


def _shares(bodies: list[Body]) -> tuple[list[float], float]:
    """Mass of every body over that of the longest branch, and this branch's length from joint to joint [m]."""
    ahead = [body.reach for body in bodies]
    follow = [-1] * len(bodies)
    for index in range(len(bodies) - 1, 0, -1):  # children stand behind their parents
        parent = bodies[index].parent
        if (reach := bodies[parent].reach + ahead[index]) >= ahead[parent]:
            ahead[parent], follow[parent] = reach, index
    first = max(range(1, len(bodies)), key=lambda i: ahead[i]) if len(bodies) > 1 else 0
    most, motor = ahead[first] or UNKNOWN, MOTOR * _longest(bodies)
    tapered = [min(1.0, max(LEAST, reach / most)) ** TAPER for reach in ahead]
    weights = [(body.reach + motor) * part for body, part in zip(bodies, tapered, strict=True)]
    along = between = 0.0
    while first >= 0:
        along, between = along + weights[first], between + float(np.linalg.norm(bodies[first].far))
        first = follow[first]
    return [weight / along for weight in weights], between or most


def cylinder(mass: float, length: float, center: tuple[float, float, float], guessed: bool) -> LinkInertia:
    """Inertia of a solid cylinder as long as a link, with its larger moment about every axis."""
    across = mass * (3.0 * (_THICKNESS * length) ** 2 + length**2) / 12.0
    x, y, z = (_short(c) for c in center)
    moments = (_short(across),) * 3 + (0.0, 0.0, 0.0)
    return LinkInertia(mass=_short(mass), com=(x, y, z), inertia=moments, guessed=guessed)


def guess_note(spec: RobotSpec) -> str:
    """What to say where something failed with guessed masses, or "" if none is guessed."""
    links = [name for name, inertia in spec.inertia.items() if inertia.guessed]
    if not links:
        return ""
    rest = f" and {len(links) - MOST_NAMES} more" if len(links) > MOST_NAMES else ""
    total = sum(spec.inertia[name].mass for name in links)
    return (
        f"{spec.name} runs on guessed masses: {', '.join(links[:MOST_NAMES])}{rest}, {total:.3g} kg together; "
        "before looking elsewhere, give its [inertia] the maker's figures and remove guessed = true"
    )


def _short(value: float) -> float:
    return float(f"{value:.3g}")

r"""Masses of links that a URDF does not give: a guess from their lengths, and a sentence where one was run with.

Collaborative arms weigh about as much per metre whatever their length: the seven of the tests, 0.7 to 1.9 m from first
to last joint, move 6 to 32 kg per metre, most of them 13 to 22. Every joint brings a motor, and what carries more is
heavier. Our choice, fitted to those arms: \(m_i = \lambda (L_i + d) \sqrt{R_i / R}\), with \(L_i\) the reach of a body
to its next joint and its geometry, d a quarter of the longest such reach, for the motor, \(R_i\) the sum of L + d from
the body to the end of its longest branch, and R the largest of these. An industrial arm or a machine is heavier.
"""

from __future__ import annotations

import math

from skillframe.robot.bodies import Body
from skillframe.robot.spec import LinkInertia, RobotSpec

PER_METRE = 15.0  # kg/m, lambda: the geometric mean of those arms
MOTOR = 0.25  # d over the longest reach
UNKNOWN = 0.1  # m; d where no reach is known at all
_THICKNESS = 1.0 / 6.0  # radius over length of the cylinder that a link is guessed to be; our choice
MOST_NAMES = 4


def lengths(bodies: list[Body]) -> list[float]:
    """L + d of every body [m]."""
    longest = max((body.reach for body in bodies if body.joint is not None), default=0.0)
    motor = MOTOR * (longest or max(body.reach for body in bodies)) or UNKNOWN
    return [body.reach + motor for body in bodies]


def guessed_masses(bodies: list[Body]) -> list[float]:
    """Mass of every body [kg], by the law above. A root that does not move is counted as if it did."""
    own = lengths(bodies)
    ahead = own.copy()
    for index in range(len(bodies) - 1, 0, -1):  # children stand behind their parents
        parent = bodies[index].parent
        ahead[parent] = max(ahead[parent], own[parent] + ahead[index])
    most = max(ahead[1:], default=ahead[0])
    return [PER_METRE * length * math.sqrt(min(1.0, reach / most)) for length, reach in zip(own, ahead, strict=True)]


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

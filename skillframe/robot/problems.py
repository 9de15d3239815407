"""One finding of the audit, and the robot.toml lines that mend a link's inertia."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from skillframe.frames import Float
from skillframe.robot.spec import LinkInertia

_DENSITY = 1500.0  # kg/m^3: between plastic and light alloy with cavities; our choice
_THICKNESS = 1.0 / 6.0  # radius over length of the cylinder that a link is guessed to be; our choice


@dataclass(frozen=True, slots=True, kw_only=True)
class Problem:
    """A finding.

    Attributes:
        code: fixed word for scripts; severity: "fatal" makes the robot unusable for dynamics.
        where: link or joint; message: what is wrong; fix: what to do about it.
    """

    code: str
    severity: Literal["fatal", "warning"]
    where: str
    message: str
    fix: str


def guessed_inertia(size: float, center: Float, mass: float = 0.0) -> LinkInertia:
    """Inertia of a solid cylinder as long as a link, with its larger moment about every axis.

    Args:
        size: of the link [m], 0 if unknown.
        center: (3,) centre of mass in link axes [m].
        mass: [kg], 0 if unknown.
    """
    length = size if size > 0.0 else 0.1
    radius = _THICKNESS * length
    if not mass > 0.0:
        mass = _DENSITY * np.pi * radius**2 * length
    across = mass * (3.0 * radius**2 + length**2) / 12.0
    x, y, z = (_short(float(c)) for c in center)
    return LinkInertia(mass=_short(mass), com=(x, y, z), inertia=(_short(across),) * 3 + (0.0, 0.0, 0.0))


def overlay_fix(inertias: Mapping[str, LinkInertia]) -> str:
    """The cure of a message: robot.toml lines that give links an inertia."""
    lines = [_overlay_line(link, inertia) for link, inertia in inertias.items()]
    return "\n".join(["put this into a robot.toml, with figures from CAD where they are guesses:", "[inertia]", *lines])


def _overlay_line(link: str, inertia: LinkInertia) -> str:
    key = link if re.fullmatch(r"[A-Za-z0-9_-]+", link) else json.dumps(link)
    com, moments = (", ".join(f"{x:g}" for x in values) for values in (inertia.com, inertia.inertia))
    return f"{key} = {{ mass = {inertia.mass:g}, com = [{com}], inertia = [{moments}] }}"


def _short(value: float) -> float:
    return float(f"{value:.3g}")

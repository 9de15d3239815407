"""Varied quantities as people read them: "fixture.tilt_y" in radians becomes "fixture tilt about y" in degrees."""

from __future__ import annotations

import re
from typing import NamedTuple

import numpy as np

ANGLES = re.compile(r"(^|_)(tilt|angle|slope|roll|pitch|yaw|rotation|turn)(_|$)")
LENGTHS = re.compile(r"(^|_)(offset|position|clearance|depth|radius|length|width|height|gap|tolerance|fillet)(_|$)")
NEWTONS = re.compile(r"(^|_)force(_|$)")
TORQUES = re.compile(r"(^|_)(torque|joint_friction)(_|$)")


class Quantity(NamedTuple):
    """A column of the results.

    Attributes:
        name: as in the file.
        label: in words, without unit.
        unit: for people, empty if it has none.
        factor: from the file's SI value to that unit.
    """

    name: str
    label: str
    unit: str
    factor: float

    @property
    def axis(self) -> str:
        """Label with unit, for an axis."""
        return f"{self.label} [{self.unit}]" if self.unit else self.label


def quantity(name: str) -> Quantity:
    """How to show a varied quantity, from its name."""
    group, _, rest = name.rpartition(".")
    unit, factor = _unit(rest)
    words = re.sub(r"^(tilt|rotation|turn)_([xyz])$", r"\1 about \2", rest)
    words = re.sub(r"^offset_([xyz])$", r"offset along \1", words).replace("_", " ")
    group = "" if group == "world" else group
    return Quantity(name, f"{group} {words}".strip(), unit, factor)


def _unit(rest: str) -> tuple[str, float]:
    if TORQUES.search(rest):
        return "Nm", 1.0
    if NEWTONS.search(rest):
        return "N", 1.0
    if ANGLES.search(rest):
        return "°", float(np.degrees(1.0))
    return ("mm", 1e3) if LENGTHS.search(rest) else ("", 1.0)

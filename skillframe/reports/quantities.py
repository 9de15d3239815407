"""Varied quantities as people read them: "fixture.tilt_y" in radians becomes "fixture tilt about y" in degrees."""

from __future__ import annotations

import re
from typing import NamedTuple

import numpy as np

UNITS: tuple[tuple[str, str, float], ...] = (
    ("scale|frozen|zero|stuck|runaway|loss", "", 1.0),
    ("torque|joint_friction", "Nm", 1.0),
    ("force", "N", 1.0),
    ("stiffness", "N/m", 1.0),
    ("tilt|angle|slope|roll|pitch|yaw|rotation|turn", "°", float(np.degrees(1.0))),
    ("pressure", "bar", 1e-5),
    ("payload|mass", "kg", 1.0),
    ("delay", "ms", 1e3),
    ("deadband", "%", 1e2),
    ("offset|position|clearance|depth|radius|length|width|height|gap|tolerance|fillet|above|away|along", "mm", 1e3),
)
"""Words of a name, the unit for people, and its factor; the first that fits counts."""


class ShownQuantity(NamedTuple):
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


def quantity(name: str) -> ShownQuantity:
    """How to show a varied quantity, from its name."""
    group, _, rest = name.rpartition(".")
    unit, factor = _unit(rest)
    words = re.sub(r"^(tilt|rotation|turn)_([xyz])$", r"\1 about \2", rest)
    words = re.sub(r"^offset_([xyz])$", r"offset along \1", words).replace("_", " ")
    group = "" if group == "world" else group
    return ShownQuantity(name, f"{group} {words}".strip(), unit, factor)


def _unit(rest: str) -> tuple[str, float]:
    found = ((unit, factor) for words, unit, factor in UNITS if re.search(rf"(^|_)({words})(_|$)", rest))
    return next(found, ("", 1.0))

"""Display of varied quantities: "fixture.tilt_y" in radians becomes "fixture tilt about y" in degrees."""

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
    ("offset|position|clearance|depth|radius|length|width|height|gap|tolerance|fillet|above|away|distance", "mm", 1e3),
)
"""Words of a name, display unit and factor; the first match counts."""


class ShownQuantity(NamedTuple):
    """Display of a results column.

    Attributes:
        name: as in the file.
        label: in words, without unit.
        unit: for display, or "".
        factor: from SI to that unit.
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
    """Return the display of a varied quantity by its name."""
    group, _, rest = name.rpartition(".")
    found = ((unit, factor) for pattern, unit, factor in UNITS if re.search(rf"(^|_)({pattern})(_|$)", rest))
    unit, factor = next(found, ("", 1.0))
    words = re.sub(r"^(tilt|rotation|turn)_([xyz])$", r"\1 about \2", rest)
    words = re.sub(r"^offset_([xyz])$", r"offset along \1", words).replace("_", " ")
    group = "" if group == "world" else group
    return ShownQuantity(name, f"{group} {words}".strip(), unit, factor)

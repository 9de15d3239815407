"""What robot.toml says of a soft mount between the force sensor and the tool."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from skillframe.robot.interface import Control


@dataclass(frozen=True, slots=True, kw_only=True)
class Mount:
    """`[mount]` of robot.toml: springs and dampers between the wrist's force sensor and the tool.

    Softer ones than the ranges allow drop the tool by millimetres, and stiffer ones are none.

    It is levelled where a trial starts: there the springs carry the tool's weight, and the tool stands straight (ours).
    What the controller knows is the arm with a rigid mount: encoders see the flange and not the tool.

    Attributes:
        stiffness: of the mount along any axis of the tool frame [N/m, 1e3 to 1e6].
        turning_stiffness: of the mount about the tool frame [Nm/rad, 10 to 1e5].
        damping_ratio: of the tool's mass, and inertia about the tool frame, on these springs [0 to 2]; rubber has 0.05
            to 0.2 (a guess).
    """

    stiffness: float
    turning_stiffness: float
    damping_ratio: float = 0.1

    def __str__(self) -> str:
        return f"{self.stiffness:.3g} N/m, {self.turning_stiffness:.3g} Nm/rad, damping ratio {self.damping_ratio:g}"


def unfit_mount(mount: Mount, control: Control, other: str) -> Iterator[tuple[str, str, str]]:
    """Key, problem and cure of a mount that cannot be, or that this robot cannot have.

    Args:
        mount: as declared.
        control: of the same file.
        other: what the robot is besides that excludes a mount, "" for one arm on a fixed base.
    """
    if other:
        yield "mount", f"is for one arm on a fixed base, and this robot {other}", "leave it out"
    if control.interface == "torque":
        return
    stiffness = control.admittance.stiffness
    if stiffness > mount.stiffness:
        series = 1.0 / (1.0 / stiffness + 1.0 / mount.stiffness)
        text = f"is {stiffness:.2g} N/m, and the mount alone, in series with it, yields with {mount.stiffness:.2g} N/m"
        yield "control.contact_stiffness", text, f"measure it with the mount; {_rounded(series)} by what is written"


def _rounded(value: float) -> str:
    """Two digits, rounded up: too much is slow, too little bounces."""
    step = 10.0 ** (math.floor(math.log10(value)) - 1)
    return f"{math.ceil(value / step) * step:.2g}"

"""What robot.toml says of an arm's joints: friction and damping in place of the URDF's, and their encoders."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field

LEAST_BITS, MOST_BITS, LARGEST_STEP = 8, 32, 1e-3
"""Of encoders: 8 bits are 1.4 degrees, 32 finer than anything built; 1 mm a count is a number in another unit. Ours."""


@dataclass(frozen=True, slots=True, kw_only=True)
class JointDynamics:
    """What resists a joint's motion. None keeps what the URDF says.

    Attributes:
        friction: of the joint, whatever its speed [N m or N].
        damping: of the joint [N m s/rad or N s/m].
    """

    friction: float | None = None
    damping: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Dynamics:
    """`[dynamics]` of robot.toml.

    Attributes:
        compensate: the controller adds nominal friction and damping to its torques. False, our choice: what a URDF says
            acts, and a skill has to do without knowing it, which is the harder case.
        joint: by joint name, what replaces the URDF's `<dynamics>`.
    """

    compensate: bool = False
    joint: dict[str, JointDynamics] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class Encoders:
    """`[encoders]` of robot.toml: what the controller knows of joint positions and velocities.

    Attributes:
        bits: of a turn, of joints that turn; None reads them exactly.
        step_m: a count of joints that slide [m]; None reads them exactly.
        corner_hz: of the first-order filter behind the differences that velocities are [Hz]. 100 is our choice.
    """

    bits: int | None = None
    step_m: float | None = None
    corner_hz: float = 100.0

    @property
    def count_rad(self) -> float | None:
        """A count of joints that turn [rad]."""
        return None if self.bits is None else 2.0 * math.pi / 2.0**self.bits

    def __str__(self) -> str:
        parts = [] if self.bits is None else [f"{self.bits} bits a turn"]
        parts += [] if self.step_m is None else [f"counts of {1e6 * self.step_m:g} um"]
        return f"{', '.join(parts)}; velocities are differences behind a filter of {self.corner_hz:g} Hz"


def impossible_encoders(encoders: Encoders, rate_hz: float) -> Iterator[tuple[str, str, str]]:
    """Key, problem and cure of each value that no encoder can have."""
    if encoders.bits is None and encoders.step_m is None:
        yield "encoders", "gives neither bits nor step_m", "give the resolution, or leave [encoders] out"
    if encoders.bits is not None and not LEAST_BITS <= encoders.bits <= MOST_BITS:
        yield "encoders.bits", f"is {encoders.bits}", f"give {LEAST_BITS} to {MOST_BITS} bits a turn"
    if encoders.step_m is not None and not 0.0 < encoders.step_m <= LARGEST_STEP:
        yield "encoders.step_m", f"is {encoders.step_m:g} m", f"give metres per count, at most {LARGEST_STEP:g}"
    if not 0.0 < encoders.corner_hz <= 0.5 * rate_hz:
        text = f"is {encoders.corner_hz:g} Hz at a control rate of {rate_hz:g} Hz"
        yield "encoders.corner_hz", text, "give half the control rate at most"


def impossible_joints(dynamics: Dynamics) -> Iterator[tuple[str, str, str]]:
    """Key, problem and cure of each value that no joint can have."""
    for name, own in dynamics.joint.items():
        for what in ("friction", "damping"):
            value = getattr(own, what)
            if value is not None and not 0.0 <= value < math.inf:
                yield f"dynamics.joint.{name}.{what}", f"is {value:g}", "give 0 or more, or leave it out"

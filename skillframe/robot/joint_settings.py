"""What robot.toml says of an arm's joints: friction and damping in place of the URDF's, and whether they are known."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field


@dataclass(frozen=True, slots=True, kw_only=True)
class JointDynamics:
    """What resists a joint's motion; None keeps what the URDF says.

    Attributes:
        friction: [N m or N]; damping: [N m s/rad or N s/m].
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


def impossible_joints(dynamics: Dynamics) -> Iterator[tuple[str, str, str]]:
    """Key, problem and cure of each value that no joint can have."""
    for name, own in dynamics.joint.items():
        for what in ("friction", "damping"):
            value = getattr(own, what)
            if value is not None and not 0.0 <= value < math.inf:
                yield f"dynamics.joint.{name}.{what}", f"is {value:g}", "give 0 or more, or leave it out"

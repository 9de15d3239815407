"""A document for two arms in words."""

from __future__ import annotations

import numpy as np

from skillframe.extend.records import Document
from skillframe_dualarm.document import Arm, Phase, Vector, read_phase


def describe(document: Document) -> list[str]:
    """What the pair does, then a line for each arm."""
    phase = read_phase(document)
    how = "as a relative task" if phase.mode == "relative" else "each arm for itself"
    first = f"two arms approach along {_axis(phase.desired_direction)} at {1e3 * phase.speed:g} mm/s, {how}"
    names = ("the arm with the tool", "the arm with the fixture")
    return [first, *(_arm(phase, arm, name) for arm, name in zip(phase.arms, names, strict=True))]


def _arm(phase: Phase, arm: Arm, name: str) -> str:
    axes = {"translation": phase.compliant_translation, "rotation": phase.compliant_rotation}
    verbs = {"translation": "along", "rotation": "about"}
    free = [f"{verbs[part]} {' and '.join(map(_axis, axes[part]))}" for part in arm.compliant if axes[part]]
    gives = f"gives way {' and '.join(free)}" if free else "gives way nowhere"
    point = ", ".join(f"{1e3 * x:g}" for x in arm.center_of_compliance)
    return f"{name} makes {100 * arm.share:g} % of the motion and {gives}; its centre of compliance is ({point}) mm"


def _axis(vector: Vector) -> str:
    """The name of a coordinate axis within 5 degrees, else the numbers."""
    v = np.array(vector)
    i = int(np.argmax(np.abs(v)))
    if abs(v[i]) > np.cos(np.radians(5.0)):
        return f"{'-' if v[i] < 0.0 else ''}{'xyz'[i]}"
    return f"({v[0]:.2f}, {v[1]:.2f}, {v[2]:.2f})"

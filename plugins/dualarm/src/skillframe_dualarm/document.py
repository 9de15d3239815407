"""Phase of two arms as checked records, and the published configurations A to E.

Both arms share one linear motion with compliance, each in its own tool axes at the start. They differ in their centre
of compliance, compliant parts, and share of the motion (published: 1 and 0).
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import Any, Literal

import numpy as np

from skillframe.config import build
from skillframe.document import frame_at
from skillframe.errors import InputError, UnknownName
from skillframe.extend import Document
from skillframe.frames import Float, norm

Vector = tuple[float, float, float]
Mode = Literal["independent", "relative"]
PARTS = ("translation", "rotation")


@dataclass(frozen=True, slots=True, kw_only=True)
class Arm:
    """One arm's part.

    Attributes:
        center_of_compliance: point of its tool frame [m].
        compliant: "translation", "rotation", both or nothing, along the phase's compliant axes.
        share: of the motion along the desired direction; the arms' shares add up to 1.
    """

    center_of_compliance: Vector
    compliant: tuple[str, ...] = ()
    share: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Phase:
    """A motion with compliance for two arms, with stiffness, speed, lead and limits that the paper lacks.

    Attributes:
        arms: the arm that holds the tool, then the one that holds the fixture.
        desired_direction: (3,) unit vector, first arm's tool axes at the start.
        compliant_translation, compliant_rotation: unit vectors, each arm's own tool axes at the start.
        mode: "independent": no coupling (published); "relative": compliant in the relative motion of the arms, stiff as
            a pair.
        speed: of one arm relative to the other [m/s].
        stiffness: [N/m]; turn_stiffness: [Nm/rad]; zero along compliant axes.
        lead_force_n: largest push; the desired pose of an arm leads by at most this over the stiffness.
        stall_s, stall_m: at rest when, while pushing, the arms have approached by less than this for this long.
        time_limit_s: longer than this fails.
    """

    arms: tuple[Arm, Arm]
    desired_direction: Vector = (0.0, 0.0, 1.0)
    compliant_translation: tuple[Vector, ...] = ((1.0, 0.0, 0.0),)
    compliant_rotation: tuple[Vector, ...] = ((0.0, 1.0, 0.0),)
    mode: Mode = "independent"
    speed: float = 0.02
    stiffness: float = 600.0
    turn_stiffness: float = 40.0
    lead_force_n: float = 30.0
    stall_s: float = 3.0
    stall_m: float = 1e-4
    time_limit_s: float = 60.0


BOTH = PARTS
CONFIGURATIONS: dict[str, tuple[tuple[str, tuple[str, ...]], tuple[str, tuple[str, ...]]]] = {
    "A": (("wrist", BOTH), ("tip", ())),
    "B": (("tip", BOTH), ("tip", ())),
    "C": (("tip", ()), ("tip", BOTH)),
    "D": (("tip", ("rotation",)), ("tip", ("rotation",))),
    "E": (("tip", BOTH), ("tip", BOTH)),
}
"""Table I of the two-arm paper: centre of compliance and compliant parts of master (peg), then slave."""


def configured(phase: Phase, name: str, frames: dict[str, Vector]) -> Phase:
    """A phase in a configuration A to E, the first arm moving.

    Args:
        phase: everything else.
        name: "A" to "E".
        frames: "wrist" and "tip" of the tool frames.

    Raises:
        UnknownName: no such configuration.
    """
    if name not in CONFIGURATIONS:
        raise UnknownName("configuration", name, CONFIGURATIONS)
    first, second = (
        Arm(center_of_compliance=frames[point], compliant=parts, share=share)
        for (point, parts), share in zip(CONFIGURATIONS[name], (1.0, 0.0), strict=True)
    )
    return replace(phase, arms=(first, second))


def relative(phase: Phase) -> Phase:
    """The relative task: both arms compliant where either was."""
    parts = tuple(part for part in PARTS if any(part in arm.compliant for arm in phase.arms))
    first, second = (replace(arm, compliant=parts) for arm in phase.arms)
    return replace(phase, arms=(first, second), mode="relative")


def body(phase: Phase) -> Document:
    """`frame` and `phases` of a skill document."""
    frame = frame_at(phase.arms[0].center_of_compliance, axes="phase_start")
    return {"frame": frame, "phases": [_plain(asdict(phase))]}


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    return [_plain(item) for item in value] if isinstance(value, list | tuple) else value


def read_phase(document: Document) -> Phase:
    """The phase of a document.

    Raises:
        InputError: not exactly one phase or two arms, or an invalid value.
    """
    phases = document.get("phases", [])
    if len(phases) != 1:
        raise InputError("phases", f"two arms share one phase, this has {len(phases)}", "learn it again")
    phase = build(Phase, phases[0], "phases[0]")
    where = "phases[0]"
    vectors = [phase.desired_direction, *phase.compliant_translation, *phase.compliant_rotation]
    if any(abs(float(norm(np.array(v))) - 1.0) > 0.01 for v in vectors):
        raise InputError(where, "holds a direction or compliant axis that is no unit vector", "divide by its length")
    positive = ("speed", "stiffness", "turn_stiffness", "lead_force_n", "stall_s", "stall_m", "time_limit_s")
    for key in positive:
        if getattr(phase, key) <= 0.0:
            raise InputError(f"{where}.{key}", "should be positive", "fix it")
    shares = [arm.share for arm in phase.arms]
    if min(shares) < 0.0 or abs(sum(shares) - 1.0) > 1e-9:
        raise InputError(f"{where}.arms", f"shares of the motion are {shares}", "let them add up to 1")
    for i, arm in enumerate(phase.arms):
        for part in arm.compliant:
            if part not in PARTS:
                raise InputError(f"{where}.arms[{i}].compliant", str(UnknownName("part", part, PARTS)))
    if phase.mode == "relative" and set(phase.arms[0].compliant) != set(phase.arms[1].compliant):
        raise InputError(f"{where}.arms", "both arms are compliant alike in a relative task", "make `compliant` equal")
    return phase


def centers(document: Document) -> Float:
    """(arms, 3) centres of compliance in each arm's tool frame [m]."""
    return np.array([arm.center_of_compliance for arm in read_phase(document).arms])


def describe(document: Document) -> list[str]:
    """The task of the pair, then a line for each arm."""
    phase = read_phase(document)
    how = "as a relative task" if phase.mode == "relative" else "each arm for itself"
    lines = [f"two arms approach along {_axis(phase.desired_direction)} at {1e3 * phase.speed:g} mm/s, {how}"]
    parts = (("along", "translation", phase.compliant_translation), ("about", "rotation", phase.compliant_rotation))
    for arm, name in zip(phase.arms, ("the arm with the tool", "the arm with the fixture"), strict=True):
        free = [
            f"{verb} {' and '.join(map(_axis, axes))}"
            for part in arm.compliant for verb, of, axes in parts if of == part and axes
        ]  # fmt: skip
        gives = f"is compliant {' and '.join(free)}" if free else "is stiff"
        point = ", ".join(f"{1e3 * x:g}" for x in arm.center_of_compliance)
        share = f"{name} makes {100 * arm.share:g} % of the motion"
        lines.append(f"{share} and {gives}; its centre of compliance is ({point}) mm")
    return lines


def _axis(vector: Vector) -> str:
    """Name of a coordinate axis within 5 degrees, else the components."""
    v = np.array(vector)
    i = int(np.argmax(np.abs(v)))
    if abs(v[i]) > np.cos(np.radians(5.0)):
        return f"{'-' if v[i] < 0.0 else ''}{'xyz'[i]}"
    return f"({v[0]:.2f}, {v[1]:.2f}, {v[2]:.2f})"

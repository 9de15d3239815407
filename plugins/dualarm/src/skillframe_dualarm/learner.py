"""Learn a skill for two arms from demonstrations in which one moved and the other stood still.

The registry's `lmc` learner gives one linear motion with compliance in the tool's orientation at the start; a
configuration A to E, or the relative task, divides it. Speed, stiffness and lead are this plug-in's.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from skillframe.config import build
from skillframe.demonstration import Demonstration
from skillframe.document import common_frames
from skillframe.errors import InputError
from skillframe.extend import Document, LearnOptions, registry
from skillframe.frames import norm
from skillframe_dualarm.document import Arm, Mode, Phase, Vector, body, configured, relative

PRIMITIVE = "lmc"


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """Settings of `learn --set`, whose other keys go to the learner of the primitive.

    Attributes:
        configuration: "A" to "E", the compliant arm: A the first about its wrist, B the first about the tip, C the
            second, D both in rotation only, E both.
        mode: "independent", or "relative" for the relative task.
    """

    configuration: str = "B"
    mode: Mode = "independent"


def learn(demonstrations: Sequence[Demonstration], options: LearnOptions) -> Document:
    """A document's body from demonstrations of the arm that moves.

    Raises:
        InputError: demonstrations without a common direction, or axes of base.
        UnknownName: no such configuration, point or setting.
    """
    ours = {key: value for key, value in options.settings.items() if key in Settings.__dataclass_fields__}
    theirs = {key: value for key, value in options.settings.items() if key not in ours}
    settings = build(Settings, ours, "--set")
    known = common_frames(demonstrations)  # without a tip, the recorded tool point
    origin: Vector = (0.0, 0.0, 0.0)
    frames = {"wrist": origin, "tip": origin} | {k: (v[0], v[1], v[2]) for k, v in known.items()}
    at = options.at or ("tip" if "tip" in known else None)
    wanted = replace(options, at=at, axes="phase_start", settings=theirs)
    learner = registry().skill(PRIMITIVE).learn
    assert learner is not None
    phase = phase_from(learner(demonstrations, wanted), frames, settings.configuration)
    return body(relative(phase) if settings.mode == "relative" else phase)


def phase_from(learned: Document, frames: dict[str, Vector], configuration: str) -> Phase:
    """The two arms' phase from a learned one, axes in the tool's orientation at the start.

    Raises:
        InputError: it has no desired direction.
    """
    translation, rotation = learned["phases"][0]["translation"], learned["phases"][0]["rotation"]
    direction = translation["desired_direction"]
    if direction is None:
        fix = "demonstrate from the other side as well"
        raise InputError("demonstrations", "have no direction of pushing in common", fix)
    phase = Phase(
        arms=(Arm(center_of_compliance=frames["tip"], share=1.0), Arm(center_of_compliance=frames["tip"])),
        desired_direction=_unit(direction),
        compliant_translation=_axes(translation),
        compliant_rotation=_axes(rotation),
    )
    return configured(phase, configuration, frames)


def _axes(part: Document) -> tuple[Vector, ...]:
    axes = np.eye(3).tolist() if part["fully_compliant"] else part["compliant_axes"]
    return tuple(_unit(axis) for axis in axes)


def _unit(vector: Sequence[float]) -> Vector:
    x, y, z = (np.array(vector) / norm(np.array(vector))).tolist()
    return (x, y, z)

"""A skill for two arms from demonstrations of one: one arm was led, the other stood still (as in the two-arm paper).

What is learned is one linear motion with compliance, by whatever `lmc` learner the registry offers, in the tool's own
attitude at the start of the phase. The coordinator then gives each arm its part of it: a configuration A to E, or the
relative task. Speed, stiffness and lead are this plug-in's, not the learner's.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from skillframe.config import build
from skillframe.demonstration.record import Demonstration
from skillframe.demonstration.together import common_frames
from skillframe.errors import InputError
from skillframe.extend.records import Document, LearnOptions
from skillframe.extend.registry import registry
from skillframe.frames import norm
from skillframe_dualarm.document import Arm, Mode, Phase, Vector, body, configured, relative

PRIMITIVE = "lmc"


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """What `learn --set` can change. The other keys go to the learner of the primitive.

    Attributes:
        configuration: "A" to "E", which arm gives way in what: A the first about its wrist, B the first about the tip,
            C the second, D both in rotation only, E both.
        mode: "independent", or "relative" for the relative task. Any other setting is one of `lmc`, which finds the
            push and the axes; speeds and stiffnesses are `dual_arm`'s own.
    """

    configuration: str = "B"
    mode: Mode = "independent"


def learn(demonstrations: Sequence[Demonstration], options: LearnOptions) -> Document:
    """A document's body from demonstrations of the arm that moves.

    Raises:
        InputError: no direction is common to the demonstrations, or their axes were asked for in base.
        UnknownName: no such configuration, point or setting.
    """
    ours = {key: value for key, value in options.settings.items() if key in Settings.__dataclass_fields__}
    theirs = {key: value for key, value in options.settings.items() if key not in ours}
    settings = build(Settings, ours, "--set")
    known = common_frames(demonstrations)  # without a tip of its own, it is the recorded tool point
    frames = _frames(known)
    at = options.at or ("tip" if "tip" in known else None)
    wanted = replace(options, at=at, axes="phase_start", settings=theirs)
    learner = registry().skill(PRIMITIVE).learn
    assert learner is not None
    phase = phase_from(learner(demonstrations, wanted), frames, settings.configuration)
    return body(relative(phase) if settings.mode == "relative" else phase)


def _frames(known: Mapping[str, Sequence[float]]) -> dict[str, Vector]:
    return {"wrist": (0.0, 0.0, 0.0), "tip": (0.0, 0.0, 0.0)} | {k: (v[0], v[1], v[2]) for k, v in known.items()}


def phase_from(learned: Document, frames: dict[str, Vector], configuration: str) -> Phase:
    """The two arms' phase from what one arm learned, axes in the tool's attitude at the start.

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

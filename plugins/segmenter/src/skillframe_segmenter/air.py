r"""A short way through the air, up to a touch, has a push: nobody but the hand moved the tool there.

An LMC asks whether one push explains all that was shown, within 25 degrees of what the hand may be off. If none does,
the environment must have turned the tool aside, so the skill gives way along that motion and has nowhere to go: run, it
stands where it is until its time is up, and ends well. In the air that conclusion is wrong. Nothing acts there but the
hand, and what the directions scatter by is its wandering, which is correlated over 15 mm (`straightness_m`) and does
not average out over less; a way up to a touch may be as short as 8 mm (`visits`). Of 45 such ways, with 8 degrees of
noise of the aim, the hand was off by 9 to 30 degrees. So where a phase

    has a motion but no push and no environment that drove it,
    touched nothing in more than half of its intervals,
    has a path shorter than the wandering is correlated over, in the mean of its demonstrations,

the learner is asked again for the push that explains it best, however far the hand was off, up to 90 degrees: a push
never goes against the motion that it makes. Which axes give way is decided as ever. A longer way in the air that no
push explains has a bend, and is left as it is, and so is what slides. All of this is our choice.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from skillframe.demonstration.record import Demonstration
from skillframe.extend.records import Document, LearnOptions

BOUND = "pyramid_max_rad"
FORWARDS = 0.5 * np.pi
Learner = Callable[[Sequence[Demonstration], LearnOptions], Document]


def learned_in_air(learn: Learner, parts: Sequence[Demonstration], options: LearnOptions) -> Document:
    """What a learner makes of the parts of a phase, asked again where they are a short way through the air.

    Args:
        learn: of the phase's kind of skill. Only one that tells its evidence as an LMC does is asked again.
        parts: of all demonstrations.
        options: handed to the learner. A bound of its own that a person gave is kept.

    Raises:
        InputError: parts that cannot be learned from.
    """
    body = learn(parts, options)
    if BOUND in options.settings or not _short_in_air(body):
        return body
    again = learn(parts, replace(options, settings={**options.settings, BOUND: FORWARDS}))
    found: dict[str, Any] = again["phases"][0]["translation"]
    if found["desired_direction"] is not None:
        off = np.degrees(found["evidence"]["pyramid_angle_rad"])
        found["evidence"]["message"] = (
            f"taken as it went: a short way through the air, along which the hand was off by {off:.0f} degrees"
        )
    return again


def _short_in_air(body: Document) -> bool:
    """Whether a learned phase moved without a push, mostly in the air, over less than a hand's wandering."""
    part: dict[str, Any] = body["phases"][0].get("translation") or {}
    evidence = part.get("evidence")
    if evidence is None or part["desired_direction"] is not None or part["fully_compliant"] or evidence["held"]:
        return False
    shown = evidence["demonstrations"]
    touching = np.concatenate([np.array(each["contact"], dtype=bool) for each in shown])
    path = float(np.mean([each["path"] for each in shown]))
    return float(touching.mean()) < 0.5 and path < body["settings"]["straightness_m"]

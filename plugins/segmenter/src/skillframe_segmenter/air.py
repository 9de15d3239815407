r"""Push of a short way through the air up to a touch, where only the teacher moves the tool.

If no push explains a motion, an LMC infers that the environment turned the tool aside, and is compliant along it. In
the air only wandering spreads the directions, correlated over 15 mm. So where a phase

    has a motion but no push and no environment that drove it,
    touched nothing in more than half of its intervals,
    has a mean path shorter than that correlation length,

it is learned again with the mean direction of its motions as the way that is given (`LearnOptions.toward`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from skillframe.demonstration import Demonstration
from skillframe.extend import Document, LearnOptions
from skillframe.frames import unit

Learner = Callable[[Sequence[Demonstration], LearnOptions], Document]


def learned_in_air(learn: Learner, parts: Sequence[Demonstration], options: LearnOptions) -> Document:
    """A phase learned from its parts, learned again where they are a short way through the air.

    Args:
        learn: of the phase's kind of skill; needs evidence as of an LMC.
        parts: of all demonstrations.
        options: handed to the learner; a way that they give is kept.

    Raises:
        InputError: parts that cannot be learned from.
    """
    body = learn(parts, options)
    if not _short_in_air(body):
        return body
    ways = np.array(
        [shown["mean_direction"] for shown in body["phases"][0]["translation"]["evidence"]["demonstrations"]]
    )
    mean = unit(ways.mean(axis=0))
    again = learn(parts, replace(options, toward=(float(mean[0]), float(mean[1]), float(mean[2]))))
    found: dict[str, Any] = again["phases"][0]["translation"]
    off = np.degrees(np.arccos(np.clip(unit(ways) @ mean, -1.0, 1.0).min()))
    found["evidence"]["message"] = (
        f"taken as it went: a short way through the air, along which the hand was off by {off:.0f} degrees"
    )
    return again


def _short_in_air(body: Document) -> bool:
    """Whether a learned phase moved without a push, mostly in the air, over less than a person's wandering correlates.

    That is 15 mm: 30 mm/s for 0.5 s.
    """
    part: dict[str, Any] = body["phases"][0].get("translation") or {}
    evidence = part.get("evidence")
    if evidence is None or part["desired_direction"] is not None or part["fully_compliant"] or evidence["held"]:
        return False
    shown = evidence["demonstrations"]
    touching = np.concatenate([np.array(each["contact"], dtype=bool) for each in shown])
    path = float(np.mean([each["path"] for each in shown]))
    return float(touching.mean()) < 0.5 and path < 0.015

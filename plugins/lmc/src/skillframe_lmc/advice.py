"""Confidence in a learned LMC phase and the recommended next step, a sentence each.

An open direction, or one that contradicts the motion, needs a demonstration from the other side; demonstrations without
a single motion are several phases. Without a direction the skill moves nothing.
"""

from __future__ import annotations

from math import degrees
from typing import Any, NamedTuple

import numpy as np

from skillframe.extend import Document
from skillframe_lmc.describe import known_rad
from skillframe_lmc.evidence import NO_TORQUE, NOT_ONE_MOTION
from skillframe_lmc.phase import Part, read_phase
from skillframe_lmc.words import direction_words

OTHER_SIDE = "add a demonstration from the other side"
CUT = "cut the demonstrations into phases: skillframe segment"
GOOD = "good; try it with skillframe run, prove it with skillframe campaign run"
STILL = "record a demonstration that moves the tool; this skill only holds still"
LIMP = "check whose force the wrench is (skillframe check; --set wrench-sign=teacher); this skill is only compliant"
NO_PUSH = "record demonstrations that agree on one push; this skill moves nothing by itself"


class _Named(NamedTuple):
    name: str
    part: Part

    @property
    def seen(self) -> dict[str, Any]:
        return self.part.evidence

    @property
    def doubtful(self) -> bool:
        return str(self.seen.get("message") or "").startswith("doubtful: ")


def advice(document: Document) -> tuple[str, str]:
    """Confidence, and the next step."""
    phase = read_phase(document)
    parts = [_Named("push", phase.translation), _Named("turn", phase.rotation)]
    return _sure(parts, len(document["learned_from"])), _next(parts, len(document["learned_from"]))


def _sure(parts: list[_Named], count: int) -> str:
    said = [text for each in parts if (text := _known(each))]
    told = "; ".join(said) or "no direction was found: what is free and what is held is all that was learned"
    return f"{told}; from {count} demonstration{'s' * (count != 1)}"


def _known(each: _Named) -> str:
    if each.part.desired_direction is None:
        return ""
    if each.seen.get("ambiguous"):
        open_rad = each.seen["feasible_half_width_rad"]
        return f"the {each.name} is open: up to {degrees(open_rad):.0f} degrees to either side explain as much"
    if each.doubtful:
        return str(each.seen["message"]).split(";")[0]
    if each.seen.get("message") == NO_TORQUE:
        return NO_TORQUE
    known = known_rad(each.part)
    return "" if known is None else f"the {each.name} is known to about {degrees(known):.0f} degrees"


def _next(parts: list[_Named], count: int) -> str:
    for each in parts:
        if each.seen.get("ambiguous") or each.doubtful:
            side = each.seen.get("other_side")
            return OTHER_SIDE if side is None else f"{OTHER_SIDE}, going towards {direction_words(np.array(side))}"
    if all(each.part.desired_direction is None for each in parts):
        if any(NOT_ONE_MOTION in str(each.seen.get("message")) for each in parts):
            return CUT
        moved = [each.part for each in parts if not each.seen.get("held")]
        if not moved:
            return STILL
        return LIMP if all(part.fully_compliant for part in moved) else NO_PUSH
    return f"{OTHER_SIDE}; one contradicts nothing" if count == 1 else GOOD

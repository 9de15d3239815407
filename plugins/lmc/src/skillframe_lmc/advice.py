"""How sure a learned LMC phase is, and what to do next, in a sentence each.

Where the demonstrations leave the direction open, or contradict the motion they show, one from the other side tells
more; where no single motion explains any of them, they are several phases. A single demonstration contradicts nothing.
"""

from __future__ import annotations

from math import degrees
from typing import Any, NamedTuple

from skillframe.extend.records import Document
from skillframe_lmc.describe import known_rad
from skillframe_lmc.phase import Part, read_phase

OTHER_SIDE = "add a demonstration from the other side"
CUT = "cut the demonstrations into phases: skillframe segment"
GOOD = "good; try it with skillframe run, prove it with skillframe campaign run"


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
    """How sure what was learned is, and what to do next."""
    phase = read_phase(document)
    parts = [_Named("push", phase.translation), _Named("turn", phase.rotation)]
    return _sure(parts, len(document["learned_from"])), _next(parts, len(document["learned_from"]))


def _sure(parts: list[_Named], count: int) -> str:
    said = [text for each in parts if (text := _known(each))]
    told = "; ".join(said) or "no direction was found: what is free and what is held is all that was learned"
    return f"{told}; from {count} demonstration{'s' * (count != 1)}"


def _known(each: _Named) -> str:
    """How well a direction is known, "" where there is none."""
    if each.part.desired_direction is None:
        return ""
    if each.seen.get("ambiguous"):
        open_rad = each.seen["feasible_half_width_rad"]
        return f"the {each.name} is open: up to {degrees(open_rad):.0f} degrees to either side explain as much"
    if each.doubtful:
        return str(each.seen["message"]).split(";")[0]
    known = known_rad(each.part)
    return "" if known is None else f"the {each.name} is known to about {degrees(known):.0f} degrees"


def _next(parts: list[_Named], count: int) -> str:
    if any(each.seen.get("ambiguous") or each.doubtful for each in parts):
        return OTHER_SIDE
    if all(each.part.desired_direction is None for each in parts):
        several = any("cut it into phases" in str(each.seen.get("message")) for each in parts)
        return CUT if several else GOOD
    return f"{OTHER_SIDE}; one contradicts nothing" if count == 1 else GOOD

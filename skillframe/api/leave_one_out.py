"""Leave one out: what each demonstration contributes to a learned direction, and which contradicts the others.

The skill is learned again without each demonstration. Compared are the direction, the share of the data that it
explains (`explained`), the half width of the set of directions that explain as much (`feasible_half_width_rad`), and
whether the learner leaves the direction open, as all went one way (`ambiguous`). A demonstration contradicts the others
if only without it there is a direction, or if it lowers the share by more than 0.2. It is needed if without it there is
no direction, or an open one, or if the set is more than 1.5 times as wide.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import acos, degrees
from typing import Any, NamedTuple

import numpy as np

from skillframe.api.learning import LearnedSkill
from skillframe.demonstration.record import Demonstration
from skillframe.document import file
from skillframe.errors import InputError
from skillframe.extend.records import Document, LearnOptions, SkillType

PARTS = (("translation", "push"), ("rotation", "turn"))


class Found(NamedTuple):
    """Compared figures of one part.

    Attributes:
        direction: (3,) or None.
        explained: share of the data that it explains.
        half_width: largest, of the set of directions that explain as much [rad].
        open: whether the demonstrations leave it open.
    """

    direction: np.ndarray[Any, np.dtype[np.float64]] | None
    explained: float | None
    half_width: float | None
    open: bool = False


def left_out(
    learned: LearnedSkill, demonstrations: Sequence[Demonstration], kind: SkillType, options: LearnOptions
) -> list[str]:
    """A sentence for each demonstration and each part that has a direction, with it or without it.

    Args:
        learned: from all of them.
        demonstrations: two or more.
        kind: of the skill.
        options: as it was learned.

    Raises:
        InputError: fewer than two, or a kind of skill that is not one motion with a direction.
    """
    if len(demonstrations) < 2:
        raise InputError("--leave-one-out", "compares demonstrations, and there is one", "give two or more")
    if len(learned.phases) != 1 or not any(part in learned.phases[0] for part, _ in PARTS):
        raise InputError("--leave-one-out", f"{kind.name} is not one motion with a direction", "leave it out")
    lines = []
    for i, demonstration in enumerate(demonstrations):
        name = demonstration.source or f"demonstration {i + 1}"
        others = [d for j, d in enumerate(demonstrations) if j != i]
        try:
            without = file.learned(kind, others, options)
        except InputError as error:
            lines.append(f"without {name} nothing is learned: {error}")
            continue
        told = [said(name, word, found(learned.document, part), found(without, part)) for part, word in PARTS]
        lines += [text for text in told if text]
    return lines


def found(document: Document, part: str) -> Found:
    """The figures of one part of a document's first phase."""
    values = document["phases"][0].get(part) or {}
    direction, evidence = values.get("desired_direction"), values.get("evidence") or {}
    return Found(
        None if direction is None else np.array(direction),
        evidence.get("explained"),
        evidence.get("feasible_half_width_rad"),
        bool(evidence.get("ambiguous")),
    )


def said(name: str, word: str, whole: Found, without: Found) -> str:
    """The effect of leaving one out on a part, in words. "" if there is no direction either way.

    Args:
        name: of the demonstration.
        word: "push" or "turn".
        whole: with it.
        without: without it.
    """
    if whole.direction is None:
        contradicts = f"{name} contradicts the others: without it there is a {word}, with it none"
        return "" if without.direction is None else contradicts
    if without.direction is None:
        return f"{name} is needed: without it there is no {word}"
    turned = acos(float(np.clip(whole.direction @ without.direction, -1.0, 1.0)))
    by = round(degrees(turned))
    moves = f"without it the {word} turns by {by} degree{'s' * (by != 1)}"
    shares = whole.explained, without.explained
    if shares[0] is not None and shares[1] is not None and shares[1] - shares[0] > 0.2:
        return (
            f"{name} contradicts the others: with it the {word} explains {100.0 * shares[0]:.0f} % of what was shown, "
            f"without it {100.0 * shares[1]:.0f} %; {moves}"
        )
    if without.open and not whole.open:
        return f"{name} is needed: without it all others went one way, and leave the {word} open; {moves}"
    known, then = whole.half_width, without.half_width
    if known is not None and then is not None and then > 1.5 * known:
        return (
            f"{name} is needed: with it the {word} is known to about {degrees(known):.0f} degrees, without it to "
            f"{degrees(then):.0f}; {moves}"
        )
    return f"{name} agrees: {moves}"

"""Whose votes decide the push: intervals, contact modes, or the contact alone.

Whether a push exists is a vote. Intervals vote demonstration by demonstration (`directions`). Where contact modes push
to one side, they vote in their place (`modes`), and which push it is, all groups of intervals say together
(`expected`). Where all agree on no push, the contact is asked alone. With `concatenated` all intervals vote as those of
one demonstration, as the papers print it, and none of that is done.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, NamedTuple

import numpy as np

from skillframe.frames import unit
from skillframe_lmc.directions import Choice, choose
from skillframe_lmc.expected import expected_push
from skillframe_lmc.heading import heading
from skillframe_lmc.intervals import Motion, touching
from skillframe_lmc.modes import choose_of, contact_modes, one_sided
from skillframe_lmc.sectors import Sectors, concatenated, sectors
from skillframe_lmc.settings import Settings

FEWEST_INTERVALS = 3  # fewer say nothing about an intersection


class Votes(NamedTuple):
    """The direction that was chosen, the sectors that voted, and the contact modes where these decided."""

    choice: Choice | None
    given: Sequence[Sectors]
    modes: Sequence[Sectors] = ()


def voted(
    name: Literal["translation", "rotation"], moving: Sequence[Motion], settings: Settings, turned: bool
) -> Votes:  # fmt: skip
    """The votes of motions that the teacher drove. There is no choice where one of them has too few intervals.

    Args:
        name: the part.
        moving: the demonstrations that moved it.
        settings: of the learner.
        turned: the tool turned, so that contacts turned with it.
    """
    given = [sectors(m, teacher_driven_only=name == "rotation") for m in moving]
    if any(len(g.contact) < min(FEWEST_INTERVALS, len(m.work)) for g, m in zip(given, moving, strict=True)):
        return Votes(None, given)
    if settings.concatenated:
        return Votes(choose([concatenated(given)], settings), given)
    choice = choose(given, settings, heading(moving, turned and name == "translation"))
    modes = _modes(moving, choice) if settings.contact_modes and not turned else []
    choice = choose_of(modes, settings) if modes else choice
    if modes and settings.expected and choice.direction is not None:
        choice = choice._replace(direction=expected_push(moving))
    return Votes(choice, given, modes)


def touched(
    name: Literal["translation", "rotation"], moving: list[Motion], votes: Votes, settings: Settings
) -> tuple[list[Motion], Votes]:  # fmt: skip
    """The motion in contact and its votes, if these agree on a push where all intervals together do not.

    A hand that lets go lets the tool spring back and takes it up from elsewhere: what it does in the air is no push.
    """
    contact = [touching(motion) for motion in moving]
    if not settings.concatenated and all(len(motion.work) >= FEWEST_INTERVALS for motion in contact):
        again = voted(name, contact, settings, turned=False)
        if again.choice is not None and again.choice.direction is not None:
            return contact, again
    return moving, votes


def _modes(moving: Sequence[Motion], choice: Choice) -> list[Sectors]:
    """The contact modes, if they are to choose the direction in place of the intervals: faces of one side."""
    modes = contact_modes(moving)
    way = sum(unit(m.displacement.sum(axis=0)) for m in moving) if choice.direction is None else choice.direction
    return modes if one_sided(modes, unit(np.asarray(way))) else []

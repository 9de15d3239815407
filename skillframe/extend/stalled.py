"""What a kind of skill is told that is to find the way on where another has stalled: the exception strategy's side.

A kind of skill can act as one if its record has `exception`, which makes a body of a document of its own kind out of a
`Stalled`. Its skill is run as any other, with three things agreed on (ours):

- it begins pressed against something, or just above it, and **the first pose that it observes is the one to search
  about**: the nominal axis at the height of the stall, in the nominal attitude, wherever the tool has slid to;
- SUCCESS means that the way on is found: the skill that stalled goes on from there;
- FAILURE means that it is not, with the reason in words.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from skillframe.demonstration.record import Demonstration
    from skillframe.extend.records import Document, LearnOptions


@dataclass(frozen=True, slots=True, kw_only=True)
class Stalled:
    """Where a skill stalls, and what is known of the way on.

    Attributes:
        way: (3,) unit vector along which the other skill goes on, in base axes.
        radius: distance from the nominal axis within which the way on is [m].
        near: distance within which it likely is [m]; None: no part of that is likelier.
        tilt: angle within which the fixture's attitude is [rad].
        friction: between tool and fixture, as stated.
        frame: the `frame` block of the document that the body will stand in.
        options: points and axes of learning, and the settings that nobody else takes.
        blind: demonstrations of a search; none if there are none.
    """

    way: tuple[float, float, float]
    radius: float
    tilt: float
    friction: float
    frame: Document
    options: LearnOptions
    blind: Sequence[Demonstration] = field(default_factory=tuple)
    near: float | None = None

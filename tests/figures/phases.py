"""How well phases are found and followed: what is missed, what is false, how late. For the tables over many seeds.

A change is missed if no boundary is within 0.3 s of the interval in which it truly happens, and a boundary is false if
it is farther than 0.35 s from every such interval. One boundary may serve two changes, so recall flatters who cuts too
often: read missed and false together.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from skillframe.demonstration.record import Demonstration
from skillframe.extend import Document, LearnOptions
from skillframe.extend.registry import registry

MISSED_S, FALSE_S = 0.30, 0.35
Interval = tuple[float, float]


class Score(NamedTuple):
    """Changes, how many were missed, false boundaries, and the errors [s] of those found. Late is positive."""

    changes: int
    missed: int
    false: int
    errors: list[float]

    def __add__(self, other: tuple[Any, ...]) -> Score:
        return Score(*(a + b for a, b in zip(self, other, strict=True)))

    @property
    def near(self) -> int:
        """Changes found within 0.3 s."""
        return self.changes - self.missed

    @property
    def largest(self) -> float:
        """The largest error of those found [s]."""
        return max((abs(e) for e in self.errors), default=0.0)

    def percentile(self, q: float) -> float:
        """A percentile of |error| [s]."""
        return float(np.percentile(np.abs(self.errors), q)) if self.errors else float("nan")


NOTHING = Score(0, 0, 0, [])


def distance(time: float, change: Interval) -> float:
    """How long after a change a time is [s]. Negative before it, zero within it."""
    return time - float(np.clip(time, *change))


def score(changes: Sequence[Interval], boundaries: Sequence[float]) -> Score:
    """Boundaries against the truth."""
    nearest = [min((distance(b, c) for b in boundaries), key=abs, default=np.inf) for c in changes]
    found = [e for e in nearest if abs(e) <= MISSED_S]
    false = sum(all(abs(distance(b, c)) > FALSE_S for c in changes) for b in boundaries)
    return Score(len(changes), len(changes) - len(found), false, found)


def policy(demonstrations: Sequence[Demonstration], options: LearnOptions | None = None, **settings: Any) -> Document:
    """What `skillframe segment` learns."""
    learn = registry().skill("policy").learn
    assert learn is not None
    chosen = options or LearnOptions(settings=settings)
    return learn(demonstrations, chosen)


def phases_of(document: Document) -> int:
    """How many phases were found."""
    return len(document["phase_model"]["successors"])


def one_story(document: Document) -> bool:
    """Whether all demonstrations go through the same phases."""
    return len({tuple(row["labels"]) for row in document["demonstrations"]}) == 1

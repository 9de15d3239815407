r"""Standing force: what a tool that stands while it is pushed says of the push.

Intervals are cut by path, so that a press - a way through the air, then a force on a surface that does not give way -
has no interval in contact, and the way alone would decide. The sector between the motion v and the push -F of an
interval (`sectors`) has an equation at v -> 0 too: nothing moves for any push within the friction cone about the
normal, and what the teacher exerted is -F itself. A standing stretch therefore votes with the sector of no width,

    v := -F / |F|,        angle(D, v) <= alpha + beta,

once for each 0.1 s. A demonstration was pressed if, beyond half of its excursion, the tool stood for 0.5 s in all under
a force of twice what it met on its way (and at least what counts as contact), within 45 degrees of the way's chord.
Its motion then votes only where it met as much, and half of the standing force: what a wrench reads in the air -
inertia, what is left of the weight, a teacher's grip - is no contact and says nothing of a sector. Nor did the
environment turn the tool aside where it did not touch, so that compliant axes come from the motion in contact, if it is
long enough to be a motion. All of these figures are our choice.

Standing force is asked only if every demonstration was pressed: where the motion alone gives no direction, and where
nothing was met on the way (its median force is under 0.15 of the standing one, and fewer than three intervals are in
contact). In the second case sectors of the way hold nothing but what the sensor reads in the air, and the push is

    D ~ u / s^2 + f / p^2,      u = mean of the headings over 0.1 s of the way, f = mean of the votes,

two measures of one direction weighed by their variances (maximum likelihood of two normal errors). s is the standard
error of u, from the scatter of its headings over 0.5 s, of which half count, because a wandering hand's neighbouring
ones are alike, and at least 2 degrees. So a bent way counts little. p is
5 degrees: a hand that stands leans on one side throughout, so that its own scatter tells nothing of that.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, radians
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float, norm, unit
from skillframe_lmc.intervals import BLOCK_S, Motion, Track, moving_blocks, touching
from skillframe_lmc.sectors import Sectors, sectors

LEAST_STANDING, VOTE_S = 0.5, 0.1  # s
HARDER, IN_CONTACT = 2.0, 0.5  # against the way's median force; share of the standing force
ALONG = cos(radians(45.0))
AIR, FEWEST_TOUCHED = 0.15, 3  # median force of the way against the standing one; intervals in contact
HEADING_S, WANDER_S = 0.1, 0.5  # s
LEAST_ERROR, LEANING = radians(2.0), radians(5.0)


class Press(NamedTuple):
    """One demonstration's standing force.

    Attributes:
        votes: (K, 3) unit directions of the teacher's push, one for each 0.1 s.
        force: median strength [N].
        seconds: how long the tool stood under it.
        motion: the demonstration's motion, its intervals in contact only.
        way: (3,) mean heading of the way there, unit vector.
        error: standard error of that heading [rad].
        resistance: median force on the way [N].
    """

    votes: Float
    force: float
    seconds: float
    motion: Motion
    way: Float
    error: float
    resistance: float

    @property
    def in_air(self) -> bool:
        """Whether nothing was met on the way."""
        return self.resistance < AIR * self.force and len(self.motion.work) < FEWEST_TOUCHED

    @property
    def push(self) -> Float:
        """The push (3,) that way and standing force tell together, weighed by their variances."""
        return unit(self.way / self.error**2 + unit(self.votes.mean(axis=0)) / LEANING**2)

    @property
    def sectors(self) -> Sectors:
        """The sectors of the motion in contact, and those of the standing force, which have no width."""
        moved, count = sectors(self.motion), len(self.votes)
        return Sectors(
            np.concatenate([moved.motion, self.votes]), np.concatenate([moved.push, np.zeros((count, 3))]),
            np.concatenate([moved.contact, np.zeros(count, dtype=bool)]),
        )  # fmt: skip


def presses(tracks: Sequence[Track], motions: Sequence[Motion]) -> list[Press] | None:
    """The standing force of every demonstration, or None if one was not pressed."""
    found = [p for track, motion in zip(tracks, motions, strict=True) if (p := press(track, motion)) is not None]
    return found if found and len(found) == len(tracks) else None


def press(track: Track, motion: Motion) -> Press | None:
    """The standing force of one demonstration, or None if it was not pressed."""
    away = norm(track.position - track.position[0])
    moves = np.append(moving_blocks(np.diff(track.position, axis=0), np.diff(track.time)), 0.0) > 0.0
    strength = norm(track.force)
    way = strength[moves]
    least = max(motion.load_min, HARDER * float(np.median(way))) if len(way) else np.inf
    standing = np.flatnonzero(~moves & (away > 0.5 * motion.excursion) & (strength >= least))
    size = round(VOTE_S / BLOCK_S)
    count = len(standing) // size
    if count * VOTE_S < LEAST_STANDING:
        return None
    votes = -unit(track.force[standing[: count * size]].reshape(count, size, 3).mean(axis=1))
    chord = unit(track.position[standing[0]] - track.position[0])
    if unit(votes.mean(axis=0)) @ chord < ALONG:
        return None
    force = float(np.median(strength[standing]))
    contact = touching(motion._replace(load_min=max(least, IN_CONTACT * force)))
    heading, error = _heading(track.position[: standing[0] + 1], moves[: standing[0] + 1] > 0.0)
    return Press(votes, force, count * VOTE_S, contact, heading, error, float(np.median(way)))


def _heading(position: Float, moves: NDArray[np.bool_]) -> tuple[Float, float]:
    """Mean heading (3,) of a way in blocks (B, 3), each moment counted once, and its standard error per axis [rad]."""
    ahead = round(HEADING_S / BLOCK_S)
    steps = (position[ahead:] - position[:-ahead])[moves[:-ahead] & moves[ahead:]]
    size = round(WANDER_S / BLOCK_S)
    count = len(steps) // size
    if count < 2:
        return unit(position[-1] - position[0]), LEANING
    headings = unit(steps)
    mean = unit(headings.mean(axis=0))
    parts = headings[: count * size].reshape(count, size, 3).mean(axis=1)
    across = parts - (parts @ mean)[:, None] * mean
    scatter = np.sqrt((across**2).sum() / (2.0 * (count - 1)))
    return mean, max(LEAST_ERROR, float(scatter / np.sqrt(count / 2.0)))

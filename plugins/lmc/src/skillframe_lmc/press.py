r"""Standing force: the push of a tool that is pressed at rest.

A press on a rigid surface has no interval in contact, as these are cut by path. At rest nothing moves for any push
within the friction cone, and the teacher's push is -F, so rest votes every 0.1 s with a sector of no width,

    v := -F / |F|,        angle(D, v) <= alpha + beta.

A demonstration was pressed if, beyond half of its excursion, the tool rested for 0.5 s under twice the force on its way
(at least the contact limit), within 45 degrees of the way's chord. Its motion votes, and gives compliant axes, only
where it met that force and half of the standing one; smaller readings are inertia, weight or grip.

It is used only if every demonstration was pressed: where the motion gives no direction, and where nothing was met on
the way (median force under 0.15 of the standing one, fewer than three intervals in contact). Then the push is

    D ~ u / s^2 + f / p^2,      u = mean of the headings over 0.1 s of the way, f = mean of the votes,

weighted by variances (maximum likelihood). s is the standard error of u from headings over 0.5 s, half of them
independent, at least 2 degrees. p is 5 degrees, because a teacher at rest leans to one side throughout.

Where the motion does decide, a standing force outside its plateau by more than p contradicts it, and the push is
doubtful: a hand that leads an arm through air may push far aside of the way.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, radians
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float, norm, unit
from skillframe_lmc.intervals import BLOCK_S, Motion, Track, moving_blocks, touching
from skillframe_lmc.posterior import Choice
from skillframe_lmc.sectors import Sectors, sectors

LEAST_STANDING, VOTE_S = 0.5, 0.1  # s
HARDER, IN_CONTACT = 2.0, 0.5  # times the way's median force; share of the standing force
ALONG = cos(radians(45.0))
AIR, FEWEST_TOUCHED = 0.15, 3  # median force of the way against the standing one; intervals in contact
HEADING_S, WANDER_S = 0.1, 0.5  # s
LEAST_ERROR, LEANING = radians(2.0), radians(5.0)


class Press(NamedTuple):
    """Standing force of one demonstration.

    Attributes:
        votes: (K, 3) unit directions of the teacher's push, one for each 0.1 s.
        force: median [N].
        seconds: duration of rest under it.
        motion: the demonstration's intervals in contact.
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
        """Push (3,) of way and standing force, weighted by their variances."""
        return unit(self.way / self.error**2 + unit(self.votes.mean(axis=0)) / LEANING**2)

    @property
    def sectors(self) -> Sectors:
        """Sectors of the motion in contact, and those of no width of the standing force."""
        moved, count = sectors(self.motion), len(self.votes)
        return Sectors(
            np.concatenate([moved.motion, self.votes]), np.concatenate([moved.push, np.zeros((count, 3))]),
            np.concatenate([moved.contact, np.zeros(count, dtype=bool)]),
        )  # fmt: skip


def presses(tracks: Sequence[Track], motions: Sequence[Motion]) -> list[Press] | None:
    """Standing force of every demonstration, or None if one was not pressed."""
    found = [p for track, motion in zip(tracks, motions, strict=True) if (p := press(track, motion)) is not None]
    return found if found and len(found) == len(tracks) else None


def contradiction(found: Sequence[Press], moved: Choice | None) -> float:
    """Angle [rad] of the standing force to the push of the motion, 0 without one or within its plateau and a lean."""
    if moved is None or moved.direction is None:
        return 0.0
    stood = unit(np.sum([unit(p.votes.mean(axis=0)) for p in found], axis=0))
    off = float(np.arccos(np.clip(stood @ moved.direction, -1.0, 1.0)))
    return off if off > moved.half_width + LEANING else 0.0


def press(track: Track, motion: Motion) -> Press | None:
    """Standing force of one demonstration, or None if it was not pressed."""
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
    """Mean heading (3,) of a way in blocks (B, 3), by time, and its standard error per axis [rad]."""
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

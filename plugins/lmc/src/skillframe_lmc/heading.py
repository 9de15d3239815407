r"""Where two or more demonstrations headed as a whole, and the benefit of the doubt that this heading gets.

The chord of a demonstration is the unit vector c from where its motion began to where it ended. A person's wavering
bends the path but hardly the chord, because the parts hold the ends: of pegs shown with 15 degrees of aim noise, two
chords' mean lies within 2 degrees of the hole. What pushed the tool aside in one demonstration pushed it back in one
from the other side, so two things are believed of the push D unless the votes clearly say otherwise:

    it lies in the plane that the chords span     (normal w: a push out of it never moved anything)
    it points along the chords' mean h            (as every demonstration did, were it not for the contact)

Otherwise the choice within the feasible set would follow the accident of the few independent aims a person takes in
some seconds. Each departure lessens the depth by kappa times its size, up to 0.15 rad:

    P(D) = kappa min(|D . w|, 0.15) + kappa min(angle(D, h), 0.15),      kappa = 0.5

A depth of clear votes changes by 1 rad per rad; kappa asks for three votes in four. Beyond the cap nothing more is held
against a direction, so that a valley shown on one slope only, or from two sides by unequal ways, keeps its votes. One
demonstration, or chords more than 60 degrees from their mean, have no heading. All of this is ours. Its price: pegs
shown from tilts of 8 and -4 degrees, whose chords' mean is 6 degrees off, end half a degree farther off than without.

Where the tool turned and a chord lies more than 45 degrees from the mean push edge of all, the parts swung the learning
point (a coupler's flange, 150 mm behind its face: 50 to 70 degrees; pegs: 24 to 36). Such chords are no heading, and
the sectors of such a motion, which begin at the swing and end at the push, share little but their ends. So h is the
mean of the push edges there, if each demonstration's lies within 20 degrees of it, with kappa = 1 among pyramids of at
least 14 degrees: a face is put flush by a push within its friction cone, and friction that the rim met on both sides
cancels in this mean. docs/evidence/lmc.md says what it is worth. Couplers were in view when the angles were set.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import radians
from typing import NamedTuple

import numpy as np

from skillframe.frames import Float, norm, unit
from skillframe_lmc.intervals import Motion
from skillframe_lmc.sectors import sectors

GAIN, CAP = 0.5, 0.15  # kappa; and the departure beyond which nothing more is held against a direction [rad]
PLANE_SPAN = 0.15  # share of a chord that counts as leaving a line or a plane (8.6 degrees)
AGREEMENT = 0.5  # length of the mean of the chords: 60 degrees off
SWUNG, PUSHED = radians(45.0), radians(20.0)  # a chord farther from the push was swung; a push as far is no agreement
SWUNG_GAIN, SWUNG_PYRAMID = 1.0, radians(14.0)  # kappa and least half-opening of the pyramids, of a swung point


class Heading(NamedTuple):
    """Mean (3,) and normal of the plane (3,) of the chords, each None where the demonstrations do not show it.

    `swung`: the chords are those of a point that was swung, and the mean is that of the pushes.
    """

    mean: Float | None
    normal: Float | None
    swung: bool = False

    @property
    def least_pyramid(self) -> float:
        """Least half-opening of the pyramids [rad], or 0 to leave it to the settings."""
        return SWUNG_PYRAMID if self.swung else 0.0


NO_HEADING = Heading(None, None)


def heading(motions: Sequence[Motion], turned: bool = False) -> Heading:
    """The heading of one part of several demonstrations that moved it, and whether the tool turned meanwhile."""
    if len(motions) < 2:
        return NO_HEADING
    chords = np.array([unit(m.displacement.sum(axis=0)) for m in motions])
    if turned and (push := _push(motions)) is not None and _farthest(chords, push) > SWUNG:
        return Heading(push, None, swung=True)
    mean = chords.mean(axis=0)
    return Heading(unit(mean) if norm(mean) >= AGREEMENT else None, _normal(chords))


def _push(motions: Sequence[Motion]) -> Float | None:
    """The mean push edge (3,) of all demonstrations, each counted once, or None where they do not agree on it."""
    edges = [given.push[given.contact] for given in map(sectors, motions)]
    if not all(len(edge) for edge in edges):
        return None
    pushes = unit(np.array([edge.mean(axis=0) for edge in edges]))
    mean = unit(pushes.mean(axis=0))
    return mean if _farthest(pushes, mean) <= PUSHED else None


def _farthest(directions: Float, one: Float) -> float:
    """Largest angle between directions (n, 3) and one (3,) [rad]."""
    return float(np.arccos(np.clip(directions @ one, -1.0, 1.0)).max())


def _normal(chords: Float) -> Float | None:
    """Normal of the plane that the chords (n, 3) span, or None if they span a line or all of space."""
    _, values, axes = np.linalg.svd(chords)
    least = PLANE_SPAN * np.sqrt(len(chords))
    spread = np.append(values, np.zeros(3))
    return axes[2] if spread[1] >= least > spread[2] else None


def doubt(directions: Float, given: Heading) -> Float:
    """P (C,) of directions (C, 3) [rad]."""
    result = np.zeros(len(directions))
    if given.normal is not None:
        result += GAIN * np.minimum(np.abs(directions @ given.normal), CAP)
    if given.mean is not None:
        gain = SWUNG_GAIN if given.swung else GAIN
        result += gain * np.minimum(np.arccos(np.clip(directions @ given.mean, -1.0, 1.0)), CAP)
    return result

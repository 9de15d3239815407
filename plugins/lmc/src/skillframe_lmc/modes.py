r"""Contact modes: the intervals of all demonstrations pooled, and gathered by what touched and which way it slid.

A push D passes a task iff it lies in the sector of *every* contact that has to be passed (Fig. 5 of the overview
paper). A mean over intervals asks something else: how long the person slid on each. On a floor with a ramp behind it
the floor holds 60 to 80 % of the intervals, draws the choice towards the middle of its own sector, and a ramp of less
than 20 % is thrown out as outliers (`directions`, which treats each demonstration as one vote). So intervals in contact
are counted here as modes: with m the push edge and v the motion of an interval,

    N(k) = { j : angle(m_j, m_k) <= 20 degrees  and  angle(v_j, v_k) <= 40 degrees }

the largest N(k) is a mode, and is taken away; the next largest of what is left is the next, while it has 5 intervals or
more. The modes that hold the first 85 % vote, each as a demonstration of its own in A(D) and M(D), where the largest
counts for no more than twice the second: so the result does not depend on how long a floor was slid on. What is left
out is rolling over an edge: 5 to 8 intervals whose force turns from one face to the next, which contradict both. Where
a third mode or a later one still leaves no push inside all sectors (a mean depth under 0), it is left out as well, the
smallest first, as long as those that are left hold the share of intervals that must agree (`quantile`). What
came before the farthest-back point along a demonstration's chord is a wrong first try and does not vote. The rule and
its constants are our choice, because the directions learned on simulated humps then lay inside the pushes that pass (28
of 28 against 8 by intervals); the papers do not say how intervals are weighed.

Modes choose where two or more of them pushed the tool to the same side of the push, and where the tool did not turn. In
a valley, where they balance, means lose nothing (their mean force is itself a push that passes), and their many votes
average a person's wandering: valleys of 30 degrees at 15 degrees of noise are 12 degrees off at most by modes, 7 by
intervals (10 pairs). A tool that turns takes its contacts with it, so that one contact makes several modes: pegs were 5
degrees off by modes, 2 by intervals, and couplers up to 40.

A mode also says where the tool must give way: a contact pushed it along m, so along the part of m that is square to D.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, radians

import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float, norm, unit
from skillframe_lmc.directions import Choice, choose
from skillframe_lmc.intervals import Motion
from skillframe_lmc.sectors import Sectors, misses, sectors
from skillframe_lmc.settings import Settings

SAME_PUSH, SAME_MOTION = cos(radians(20.0)), cos(radians(40.0))
FEWEST = 5
SHARE = 0.85
MOST = 2  # times the second largest mode is what the largest counts for
SAME_SIDE = 0.5  # |sum| / sum of |.| of what the modes pushed sideways: 1 if all to one side, 0 if they balance


def groups(motions: Sequence[Motion]) -> list[Sectors]:
    """All intervals in contact of a part's demonstrations in groups N, the largest first, down to single intervals."""
    pooled = [_touching(sectors(without_wrong_try(motion))) for motion in motions]
    motion = np.concatenate([each.motion for each in pooled])
    push = np.concatenate([each.push for each in pooled])
    alike = (push @ push.T >= SAME_PUSH) & (motion @ motion.T >= SAME_MOTION)
    left, found = np.ones(len(alike), dtype=bool), list[Sectors]()
    while left.any():
        rows = np.flatnonzero(alike[np.argmax((alike & left).sum(axis=1) * left)] & left)
        found.append(_some(motion, push, rows))
        left[rows] = False
    return found


def contact_modes(motions: Sequence[Motion]) -> list[Sectors]:
    """The modes of a part's demonstrations, the largest first. Empty if too few intervals were in contact."""
    each = groups(motions)
    sizes = [len(group.contact) for group in each]
    count = 0
    while count < len(each) and sizes[count] >= FEWEST:
        if _enough(sizes[:count], sizes[count], sum(sizes[count:])):
            break
        count += 1
    return each[:count]


def choose_of(modes: Sequence[Sectors], settings: Settings) -> Choice:
    """The push inside the sectors of all modes, or without the smallest, as far as they are outliers by their share."""
    left, whole = list(modes), sum(len(mode.contact) for mode in modes)
    while True:
        choice = choose(left, settings)
        held = sum(len(mode.contact) for mode in left[:-1])
        inside = choice.direction is not None and depth(choice.direction, left) >= 0.0
        if inside or len(left) < 3 or held < settings.quantile * whole:
            return choice
        left.pop()


def depth(direction: Float, modes: Sequence[Sectors]) -> float:
    """How deep a push (3,) lies in the sectors of the mode that it lies in least, a mean over its intervals [rad]."""
    return min(float(misses(direction[None], mode)[1].mean()) for mode in modes)


def mean_pushes(modes: Sequence[Sectors]) -> Float:
    """Mean push edge (n, 3) of each mode."""
    return np.array([mode.push.mean(axis=0) for mode in modes]).reshape(-1, 3)


def one_sided(modes: Sequence[Sectors], push: Float) -> bool:
    """Whether two or more modes pushed the tool to the same side of a push (3,), so that means are no intersection."""
    aside = mean_pushes(modes)
    aside = aside - (aside @ push)[:, None] * push
    return len(modes) > 1 and bool(norm(aside.sum(axis=0)) > SAME_SIDE * norm(aside).sum())


def without_wrong_try(motion: Motion) -> Motion:
    """The same motion from its farthest-back point along the chord on. Path and duration stay those of the whole."""
    chord = unit(motion.displacement.sum(axis=0))
    along = np.concatenate([[0.0], np.cumsum(motion.displacement @ chord)])
    first = int(np.argmin(along))
    return motion._replace(
        displacement=motion.displacement[first:], load=motion.load[first:], work=motion.work[first:]
    )  # fmt: skip


def _touching(given: Sectors) -> Sectors:
    return _some(given.motion, given.push, np.flatnonzero(given.contact))


def _some(motion: Float, push: Float, rows: NDArray[np.intp]) -> Sectors:
    return Sectors(motion[rows], push[rows], np.ones(len(rows), dtype=bool))


def _enough(sizes: Sequence[int], following: int, rest: int) -> bool:
    """Whether modes of these sizes hold `SHARE`, before one of size `following` out of `rest` intervals."""
    if not sizes:
        return False
    second = sizes[1] if len(sizes) > 1 else following
    held = sum(sizes[1:]) + min(sizes[0], MOST * second)
    return held >= SHARE * (held + rest)

r"""How far friction holds a compliant tool behind its path, and gains with which a spiral does not stand still.

    tip at rest    <=>    |K r e_r + D v e_t| < mu N          K across the push, v fed forward along the path
    dead band      r_0 = mu N / K                             commanded before the tip moves, and its lag after

Below r_0 a spiral winds up in the air: the tip stays where it touched, then leaves in a jump of sqrt(r^2 - r_0^2), and
the disc between is never looked at. `freed` keeps r_0 below the pitch by a stiffer hand and a lighter push. All of it
is ours; docs/evidence/search.md has what it is worth.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from skillframe.frames import Float, norm, unit
from skillframe_search.contact import Samples

STIFFEST = 4000.0  # N/m: what a cobot's wrist holds still in contact
SHARE = 0.5  # of the pitch: what is left of the dead band where it had been more than the pitch
SLIDING_M_S, FEWEST = 0.004, 20


class Gains(NamedTuple):
    """What a search presses with [N], and how stiffly it moves across that [N/m]."""

    push: float
    stiffness: float


def dead_band(friction: float, gains: Gains) -> float:
    """Distance from the start that is commanded before the tip moves [m]."""
    return friction * gains.push / gains.stiffness


def freed(friction: float, gains: Gains, pitch: float) -> Gains:
    """The same gains, or stiffer and then lighter ones where friction would hold a spiral back by over a pitch [m]."""
    if dead_band(friction, gains) <= pitch:
        return gains
    wanted = friction * gains.push / (SHARE * pitch)
    stiffness = max(min(wanted, STIFFEST), gains.stiffness)
    return Gains(min(gains.push, SHARE * pitch * stiffness / friction), stiffness)


def friction_of(pooled: Samples, push: Float) -> float | None:
    """Coulomb's coefficient from what was felt while the tool slid, or None where it hardly did.

    Median over bins of the force against the motion over the force against the push.
    """
    rate, force = pooled.rate[:, :3], pooled.wrench[:, :3]
    across = rate - (rate @ push)[:, None] * push
    pressed = -(force @ push)
    sliding = (norm(across) > SLIDING_M_S) & (pressed > 0.0)
    if int(sliding.sum()) < FEWEST:
        return None
    against = -(force[sliding] * unit(across[sliding])).sum(axis=1)
    return max(float(np.median(against / pressed[sliding])), 0.0)

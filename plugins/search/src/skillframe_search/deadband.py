r"""Lag of a compliant tool due to friction, and gains that keep it below a spiral's pitch.

    tip at rest    <=>    |K r e_r + D v e_t| < mu N          K across the push, v fed forward along the path
    dead band      r_0 = mu N / K                             commanded before the tip moves, and its lag after

Below r_0 a spiral's tip stays where it touched, then jumps by sqrt(r^2 - r_0^2) and skips the disc between. `freed`
prevents this; effect: docs/evidence/search.md.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from skillframe.frames import Float, norm, unit
from skillframe_search.contact import Samples

STIFFEST = 4000.0  # N/m: stable in contact at a cobot's wrist
SHARE = 0.5  # of the pitch: the dead band after `freed`


class Gains(NamedTuple):
    """Push [N] and stiffness across it [N/m]."""

    push: float
    stiffness: float


def dead_band(friction: float, gains: Gains) -> float:
    """Commanded distance before the tip moves [m]."""
    return friction * gains.push / gains.stiffness


def freed(friction: float, gains: Gains, pitch: float) -> Gains:
    """Stiffer, then lighter gains where the dead band exceeds a spiral's pitch [m], else the given ones."""
    if dead_band(friction, gains) <= pitch:
        return gains
    wanted = friction * gains.push / (SHARE * pitch)
    stiffness = max(min(wanted, STIFFEST), gains.stiffness)
    return Gains(min(gains.push, SHARE * pitch * stiffness / friction), stiffness)


def friction_of(pooled: Samples, push: Float) -> float | None:
    """Coulomb's coefficient while the tool slid (median), or None where it hardly did."""
    rate, force = pooled.rate[:, :3], pooled.wrench[:, :3]
    across = rate - (rate @ push)[:, None] * push
    pressed = -(force @ push)
    sliding = (norm(across) > 0.004) & (pressed > 0.0)  # faster than 4 mm/s
    if int(sliding.sum()) < 20:
        return None
    against = -(force[sliding] * unit(across[sliding])).sum(axis=1)
    return max(float(np.median(against / pressed[sliding])), 0.0)

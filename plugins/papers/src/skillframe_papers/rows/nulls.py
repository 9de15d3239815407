"""Null pushes without sectors, for rows that claim a benefit of the sectors' intersection.

Over the learner's intervals: mean direction of motion, minus mean direction of the contact force, their bisector, and
the mean chord from start to end. By hand: straight down in base.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from skillframe_lmc.intervals import Motion, track, translation
from skillframe_lmc.settings import Settings

from skillframe.demonstration import Demonstration
from skillframe.frames import Float, norm, unit
from skillframe_papers.rows.harness import DOWN

BY_HAND = "by hand: straight down"


def pushes(group: Sequence[Demonstration], frame: str = "tip") -> dict[str, Float]:
    """Each null's push (3,) in base, at a point of the tool, NaN without one."""
    motions = list[Motion]()
    for each in group:
        point = np.array(each.meta["frames"][frame])
        motions.append(translation(track(each, point, point, "base"), Settings()))
    moved = unit(np.concatenate([m.displacement for m in motions]))
    touched = np.concatenate([m.load[norm(m.load) > m.load_min] for m in motions])
    motion, force = _mean(moved), -_mean(unit(touched))
    chords = _mean(np.array([unit(m.displacement.sum(axis=0)) for m in motions]))
    return {
        "mean motion": motion, "minus mean force": force, "bisector": unit(motion + force), "mean chord": chords,
        BY_HAND: DOWN,
    }  # fmt: skip


def _mean(directions: Float) -> Float:
    return unit(directions.mean(axis=0)) if len(directions) else np.full(3, np.nan)

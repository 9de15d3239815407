"""Nulls: pushes that know nothing of sectors, for rows that claim that the sectors' intersection is worth something.

Over the intervals into which the learner cuts a recording: the mean direction of motion, minus the mean direction of
the contact force, the bisector of both, and the mean of the chords from start to end. By hand: straight down in base.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from skillframe_lmc.intervals import Motion, track, translation
from skillframe_lmc.settings import Settings

from skillframe.demonstration.record import Demonstration
from skillframe.frames import Float, norm, unit
from skillframe_papers.bars import ahead, counted

BY_HAND = "by hand: straight down"
DOWN = np.array([0.0, 0.0, -1.0])


def pushes(group: Sequence[Demonstration], frame: str = "tip") -> dict[str, Float]:
    """Each null's push (3,) in base, from demonstrations taken at a point of their tool. NaN where it has none."""
    motions = [_motion(each, frame) for each in group]
    moved = unit(np.concatenate([m.displacement for m in motions]))
    touched = np.concatenate([m.load[norm(m.load) > m.load_min] for m in motions])
    motion, force = _mean(moved), -_mean(unit(touched))
    chords = _mean(np.array([unit(m.displacement.sum(axis=0)) for m in motions]))
    return {
        "mean motion": motion, "minus mean force": force, "bisector": unit(motion + force), "mean chord": chords,
        BY_HAND: DOWN,
    }  # fmt: skip


def _motion(demonstration: Demonstration, frame: str) -> Motion:
    point = np.array(demonstration.meta["frames"][frame])
    return translation(track(demonstration, point, point, "base"), Settings())


def _mean(directions: Float) -> Float:
    return unit(directions.mean(axis=0)) if len(directions) else np.full(3, np.nan)


def judged_beside(hits: int, nulls: Mapping[str, int], count: int, *, quick: bool) -> tuple[list[str], str]:
    """Nulls that ours is ahead of, and a sentence with all of them.

    Args:
        hits: of the method, out of `count`.
        nulls: of each null, by name.
        count: sets of demonstrations.
        quick: see `bars.ahead`.
    """
    behind = [name for name, each in nulls.items() if ahead(hits, each, count, quick=quick)]
    told = ", ".join(f"{name} {counted(each, count)}" for name, each in nulls.items())
    return behind, f"Nulls: {told}. Behind by their intervals: {', '.join(behind) or 'none'}."

"""Whether a demonstration looks like several phases, by the directions of motion in contact.

From the first contact to the last, windows of 0.25 s count in which the tool moves at a quarter of its usual speed or
more, and feels 0.3 of the 95 % quantile of the force. Successive windows whose motions differ by less than 60 degrees,
with 0.1 m per radian, are one stretch, which counts if it lasts 1 s and covers 20 mm or 15 degrees. Two of different
directions are two phases; so is a rotation (0.9 of the motion, less than 20 mm) after 1 s of the same contact without
rotation. One push into a corner can look like two, so more than half of a set must look like several phases.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skillframe.demonstration.contact import Contact, free_air_level
from skillframe.demonstration.record import Demonstration
from skillframe.frames import Float, norm, rotation_vector

WINDOW_S, LEVER_M = 0.25, 0.1
SHARE = 0.3
LONG_S, FAR_M = 1.0, 0.02


@dataclass(slots=True)
class Stretch:
    """Motion in one direction.

    Attributes:
        start: first sample, from the start of the recording [s].
        windows: how many, each of `WINDOW_S`.
        motion: (6,) displacement over `LEVER_M`, and rotation [rad], base frame.
    """

    start: float
    windows: int
    motion: Float

    @property
    def far(self) -> bool:
        """Whether it is long enough to be a phase."""
        moved, turned = float(norm(self.motion[:3])) * LEVER_M, float(norm(self.motion[3:]))
        return self.windows * WINDOW_S >= LONG_S and (moved >= FAR_M or turned >= np.deg2rad(15.0))

    def words(self) -> str:
        """Its motion in words: "turns by 38 degrees" or "moves by 51 mm"."""
        if self.turns:
            return f"turns by {np.rad2deg(float(norm(self.motion[3:]))):.0f} degrees"
        return f"moves by {float(norm(self.motion[:3])) * LEVER_M * 1e3:.0f} mm"

    @property
    def turns(self) -> bool:
        """Whether it mainly rotates."""
        return bool(norm(self.motion[3:]) > 0.9 * norm(self.motion))


def several_phases(demonstration: Demonstration, contacts: list[Contact]) -> str:
    """Why a demonstration looks like several phases, in words, or ""."""
    if not contacts:
        return ""
    zero = float(demonstration.time[0])
    ways = list[Stretch]()
    for stretch in filter(lambda s: s.far, _stretches(demonstration, contacts)):
        if not any(_alike(stretch.motion, way.motion) or _goes_on(stretch.motion, way.motion) for way in ways):
            ways.append(stretch)
    if len(ways) > 1:
        first, then = ways[:2]
        begun = f"in contact it {first.words()} from {first.start:.1f} s"
        return f"{begun}, and {then.words()} another way from {then.start:.1f} s"
    touched = [c.start - zero for c in contacts if ways and c.start - zero <= ways[0].start + WINDOW_S]
    hardly_moves = bool(ways) and float(norm(ways[0].motion[:3])) * LEVER_M < FAR_M
    if hardly_moves and ways[0].turns and ways[0].start - touched[-1] >= LONG_S:
        return f"it {ways[0].words()} from {ways[0].start:.1f} s, after {ways[0].start - touched[-1]:.1f} s in contact"
    return ""


def _stretches(d: Demonstration, contacts: list[Contact]) -> list[Stretch]:
    edges = np.searchsorted(d.time, np.arange(contacts[0].start, contacts[-1].stop + 1e-9, WINDOW_S))
    edges = np.unique(np.minimum(edges, len(d.time) - 1))
    rotation = d.pose.rotation[edges]
    moved = np.diff(d.position[edges], axis=0) / LEVER_M
    turned = rotation_vector(rotation[1:] @ rotation[:-1].swapaxes(-1, -2))
    motions = np.concatenate([moved, turned], axis=-1)
    pace = norm(motions)
    strength = norm(d.wrench[:, :3] - free_air_level(d.time, d.wrench)[:3])
    felt = np.add.reduceat(strength, edges)[:-1] / np.maximum(np.diff(edges), 1)
    least = SHARE * float(np.quantile(strength, 0.95))
    result = list[Stretch]()
    for edge, motion, size, force in zip(edges, motions, pace, felt, strict=False):
        if force < least or size < max(0.25 * float(np.quantile(pace, 0.9)), 0.01):
            continue
        if result and _alike(result[-1].motion, motion):
            result[-1].motion = result[-1].motion + motion
            result[-1].windows += 1
        else:
            result.append(Stretch(float(d.time[edge] - d.time[0]), 1, motion))
    return result


def _goes_on(motion: Float, way: Float) -> bool:
    parts = [part for part in (slice(0, 3), slice(3, 6)) if norm(motion[part]) > SHARE * norm(motion)]
    return all(norm(way[part]) > SHARE * norm(way) and _alike(motion[part], way[part]) for part in parts)


def _alike(one: Float, other: Float) -> bool:
    return bool(one @ other > np.cos(np.deg2rad(60.0)) * norm(one) * norm(other))

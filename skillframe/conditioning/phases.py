"""Does a demonstration look like several phases? Judged by the ways that the tool moves while it is in contact.

From the first contact to the last, windows of 0.25 s are taken in which the tool moves at a quarter of its usual pace
at least. Windows in a row whose motions differ by less than 60 degrees, with 0.1 m to a radian, are one stretch. A
stretch counts if it lasts 1 s and covers 20 mm or 15 degrees. Two that go different ways are two phases; so is one that
turns after 1 s of contact in which nothing turned. A slide, or an insertion after some feeling around, is one phase.

One push into a corner can look like two, along one wall and then along the other: of 15 simulated demonstrations of
that task one did. So it takes more than half of a set for a set to look so. All of this is our choice; the segmenter
looks at the wrenches, and takes longer.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skillframe.conditioning.contact import Contact
from skillframe.demonstration.record import Demonstration
from skillframe.frames import Float, norm, rotation_vector

WINDOW_S, LEVER_M = 0.25, 0.1
SLOW = 0.25
APART = np.cos(np.deg2rad(60.0))
LONG_S, FAR_M, FAR_RAD = 1.0, 0.02, np.deg2rad(15.0)
MAINLY = 0.7


@dataclass(slots=True)
class Stretch:
    """Motion one way.

    Attributes:
        start: first sample, from the start of the recording [s].
        windows: how many, each of `WINDOW_S`.
        motion: (6,) displacement over `LEVER_M`, and turning [rad], base frame.
    """

    start: float
    windows: int
    motion: Float

    @property
    def far(self) -> bool:
        """Is it long enough to be a phase?"""
        moved, turned = float(norm(self.motion[:3])) * LEVER_M, float(norm(self.motion[3:]))
        return self.windows * WINDOW_S >= LONG_S and (moved >= FAR_M or turned >= FAR_RAD)

    def words(self) -> str:
        """The way it goes: "turns by 38 degrees" or "moves by 51 mm"."""
        if self.turns:
            return f"turns by {np.rad2deg(float(norm(self.motion[3:]))):.0f} degrees"
        return f"moves by {float(norm(self.motion[:3])) * LEVER_M * 1e3:.0f} mm"

    @property
    def turns(self) -> bool:
        """Is it turning rather than moving?"""
        return bool(norm(self.motion[3:]) > MAINLY * norm(self.motion))


def several_phases(demonstration: Demonstration, contacts: list[Contact]) -> str:
    """Why a demonstration looks like several phases, in words. "" if it looks like one.

    Args:
        demonstration: the recording.
        contacts: its intervals in contact.
    """
    if not contacts:
        return ""
    touched = contacts[0].start - float(demonstration.time[0])
    ways = list[Stretch]()
    for stretch in filter(lambda s: s.far, _stretches(demonstration, contacts)):
        if not any(_alike(stretch.motion, way.motion) for way in ways):
            ways.append(stretch)
    if len(ways) > 1:
        first, then = ways[:2]
        begun = f"in contact it {first.words()} from {first.start:.1f} s"
        return f"{begun}, and {then.words()} another way from {then.start:.1f} s"
    if ways and ways[0].turns and ways[0].start - touched >= LONG_S:
        return f"it {ways[0].words()} from {ways[0].start:.1f} s, after {ways[0].start - touched:.1f} s in contact"
    return ""


def _stretches(d: Demonstration, contacts: list[Contact]) -> list[Stretch]:
    edges = np.searchsorted(d.time, np.arange(contacts[0].start, contacts[-1].stop + 1e-9, WINDOW_S))
    edges = np.unique(np.minimum(edges, len(d.time) - 1))
    rotation = d.pose.rotation[edges]
    moved = np.diff(d.position[edges], axis=0) / LEVER_M
    turned = rotation_vector(rotation[1:] @ rotation[:-1].swapaxes(-1, -2))
    motions = np.concatenate([moved, turned], axis=-1)
    pace = norm(motions)
    result = list[Stretch]()
    for edge, motion, size in zip(edges, motions, pace, strict=False):
        if size < max(SLOW * float(np.quantile(pace, 0.9)), 0.01):
            continue
        if result and _alike(result[-1].motion, motion):
            result[-1].motion = result[-1].motion + motion
            result[-1].windows += 1
        else:
            result.append(Stretch(float(d.time[edge] - d.time[0]), 1, motion))
    return result


def _alike(one: Float, other: Float) -> bool:
    return bool(one @ other > APART * norm(one) * norm(other))

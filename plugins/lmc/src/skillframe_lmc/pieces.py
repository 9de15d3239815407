r"""Pieces: what each short part of the path shows about the push.

A demonstration is cut by path, and a piece \(k\) has

    v_k: unit vector of its motion,    m_k = -F_k / |F_k|,    in contact or not,    its length l_k,

at the point c where the tool touches. A tool that turns is cut by hypot(|dx|, r |w|), r = 100 mm, which is a piece's
length in contact, so that a pivot counts too; t_k = r |w| / hypot(r |w|, |dx|) is the share in which it turned. Without
contact its length is |dx|. A turn is cut by its angle, with the torque at the teacher's hand in place of the force.

**Loops.** Where the path comes back to within a step of where it was, and was more than two steps away meanwhile, what
lay between is left out: a wrong first try, or a tool that springs back when it is let go.

**Releases.** A teacher who waits for the tool to break free stores a push, which then throws the tool, faster than
anybody slides it and not along the push. So a piece of a translation counts at most the path at the demonstration's
typical speed in contact, in the time that the piece took.

**Edge.** A push D without a torque makes the tool go on if it does more work than friction takes. Friction grows with
the contact's force F, so that this is D.g > 0 with

    g = v - F (F.v + T.w / |F|) / |F|,      edge: m turned towards s = v - (v.m) m by -atan(T.w / (|F| |s|)),

the torque T taken at c, and at most 30 degrees, because T.w / |F| is noise where F is small. Without a turn the edge is
m, as for Coulomb friction. If a turn is pushed as well, the skill exerts the torque itself, and the edge is m.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import radians
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float, cross, dot, norm, rotation_vector, unit
from skillframe_lmc.intervals import Motion, Track, cut, moving_blocks, typical_speed
from skillframe_lmc.settings import LEVER_M, Settings

MOST_TILT = radians(30.0)
ALONG_LOAD = 0.05  # sine of the angle between motion and load below which they span no plane: 3 degrees


class Pieces(NamedTuple):
    """K pieces of several demonstrations.

    Attributes:
        motion: (K, 3) unit v.
        push: (K, 3) unit m; v where free.
        edge: (K, 3) unit far edge of the sector; v where free.
        contact: (K,) whether the tool touched.
        length: (K,) [m or rad].
        turning: (K,) share in which it turned; 0 of a turn.
        demonstration: (K,) number of the demonstration.
    """

    motion: Float
    push: Float
    edge: Float
    contact: NDArray[np.bool_]
    length: Float
    turning: Float
    demonstration: NDArray[np.intp]


def pushed(tracks: Sequence[Track], motions: Sequence[Motion], settings: Settings, *, turned_too: bool) -> Pieces:
    """Pieces of the translation.

    Args:
        tracks: at the point where the tool touches, with the torque at that point.
        motions: the same demonstrations' translation, which says from which force on the tool touches.
        settings: `step_m`, `contact_only`.
        turned_too: the skill pushes a turn as well.
    """
    found = []
    for i, (track, motion) in enumerate(zip(tracks, motions, strict=True)):
        points = np.concatenate([track.position, 2.0 * LEVER_M * track.quaternion], axis=1)
        which = _without_loops(points, cut(points, 0.75 * settings.step_m), settings.step_m)
        x, w, force, torque, elapsed = _between(track, which)
        slid, swung = norm(x), LEVER_M * norm(w)
        length = np.hypot(slid, swung)
        torque = np.zeros_like(torque) if turned_too else torque
        each = _shown(x, force, dot(torque, w), motion.load_min, length, i)._replace(turning=swung / length)
        touching = each.contact if each.contact.any() else np.ones_like(each.contact)
        steady = typical_speed(length[touching], elapsed[touching]) * elapsed
        each = each._replace(length=np.minimum(np.where(each.contact, length, slid), steady))
        found.append(some(each, each.length > 0.0))
    return _counted(found, settings)


def turned(tracks: Sequence[Track], motions: Sequence[Motion], settings: Settings) -> Pieces:
    """Pieces of the rotation, with the force's work in place of the torque's, without those the environment drove.

    In contact that turned the tool by itself, the axis is over 90 degrees from the push, and the sector accepts turns
    to either side.
    """
    found, step = [], settings.step_m / LEVER_M
    for i, (track, motion) in enumerate(zip(tracks, motions, strict=True)):
        points = 2.0 * track.quaternion
        which = _without_loops(points, cut(points, 0.5 * step), step)
        x, w, force, torque, _ = _between(track, which)
        each = _shown(w, torque, dot(force, x), motion.load_min, norm(w), i)
        found.append(some(each, ~each.contact | (dot(each.motion, each.push) >= 0.0)))
    return _counted(found, settings)


def until_left(pieces: Pieces) -> Pieces:
    """Each demonstration's pieces up to its last in contact, or all without any."""
    index = np.arange(len(pieces.contact))
    last = np.full(int(pieces.demonstration.max(initial=0)) + 1, -1)
    np.maximum.at(last, pieces.demonstration[pieces.contact], index[pieces.contact])
    ends = last[pieces.demonstration]
    return some(pieces, (index <= ends) | (ends < 0))


def whole_witness(name: str, settings: Settings) -> float:
    """Length on which a contact becomes a whole witness: three pieces of a translation [m], four of a turn [rad]."""
    return 2.25 * settings.step_m if name == "translation" else 2.0 * settings.step_m / LEVER_M


def _between(track: Track, which: NDArray[np.intp]) -> tuple[Float, Float, Float, Float, Float]:
    """Translation, turn, mean force and mean torque (K, 3) between knots (K, 2), and the time (K,) it took.

    The means are weighted by path without rests.
    """
    first, last = which[:, 0], which[:, 1]
    R = track.rotation
    fine = np.concatenate([np.diff(track.position, axis=0), 2.0 * LEVER_M * np.diff(track.quaternion, axis=0)], axis=1)
    speed = norm(fine) * moving_blocks(fine, np.diff(track.time)) + 1e-9
    load = _median_of_three(np.concatenate([track.force, track.torque], axis=1))
    between = 0.5 * (load[1:] + load[:-1])
    total = np.concatenate([np.zeros((1, 7)), np.cumsum(np.column_stack([between * speed[:, None], speed]), axis=0)])
    part = total[last] - total[first]
    mean = part[:, :6] / part[:, 6:]
    turn = rotation_vector(R[last] @ np.swapaxes(R[first], -1, -2))
    elapsed = track.time[last] - track.time[first]
    return track.position[last] - track.position[first], turn, mean[:, :3], mean[:, 3:], elapsed


def _median_of_three(values: Float) -> Float:
    """Each row's median with its neighbours (B, n), which removes the spike of a touch-down (20 ms)."""
    before, after = np.vstack([values[:1], values[:-1]]), np.vstack([values[1:], values[-1:]])
    low, high = np.minimum(before, after), np.maximum(before, after)
    return np.clip(values, low, high)


def _shown(moved: Float, load: Float, other_work: Float, least: float, length: Float, demonstration: int) -> Pieces:
    size = norm(load)
    v, m = unit(moved), -unit(load)
    contact = (size >= least) & (norm(cross(v, m)) >= ALONG_LOAD)
    aside = moved - dot(moved, m)[:, None] * m
    tilt = np.clip(-np.arctan2(other_work, np.maximum(size, 1e-9) * norm(aside)), -MOST_TILT, MOST_TILT)[:, None]
    edge = np.cos(tilt) * m + np.sin(tilt) * unit(aside)
    free = ~contact[:, None]
    count = len(length)
    return Pieces(
        v, np.where(free, v, m), np.where(free, v, edge), contact, length, np.zeros(count),
        np.full(count, demonstration),
    )  # fmt: skip


def _without_loops(points: Float, kept: NDArray[np.intp], step: float) -> NDArray[np.intp]:
    """Pairs (K, 2) of neighbouring knots `kept` of a path that are in no loop."""
    path = points[kept]
    step = max(step, 1.1 * float(np.median(norm(np.diff(path, axis=0))))) if len(path) > 1 else step
    apart = norm(path[:, None] - path[None])
    left = list[int]()
    for i in range(len(path)):
        away = apart[i, left]
        back = int(np.argmax(away < step)) if len(left) else 0
        if len(left) and away[back] < step and away[back:].max() > 2.0 * step:
            left = left[: back + 1]
        left.append(i)
    knot = np.array(left)
    follows = np.flatnonzero(np.diff(knot) == 1)
    pairs = np.column_stack([kept[knot[follows]], kept[knot[follows + 1]]]).reshape(-1, 2)
    return pairs[norm(points[pairs[:, 1]] - points[pairs[:, 0]]) > 0.0]


def pooled(each: Sequence[Pieces]) -> Pieces:
    """Pieces of several demonstrations as one."""
    parts: list[Any] = [np.concatenate(values) for values in zip(*each, strict=True)]
    return Pieces(*parts)


def some(pieces: Pieces, which: NDArray[np.bool_]) -> Pieces:
    """Pieces of which `which` (K,) is true."""
    kept: list[Any] = [values[which] for values in pieces]
    return Pieces(*kept)


def _counted(found: Sequence[Pieces], settings: Settings) -> Pieces:
    shown = pooled(found)
    return some(shown, shown.contact) if settings.contact_only else shown

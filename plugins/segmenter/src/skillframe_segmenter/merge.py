r"""Join phases that are one linear motion with compliance: those that one desired direction explains.

600 directions D, and "none", are tested on every window, translation and rotation apart; with M the projector of
`emission`, a window that moves (|u| > 1/2) accepts D if

    along > 0.38   and   (beside < 0.3   or   angle(M D, u) < 25 degrees),

with `along` and `beside` the parts of M D along the motion and across it (either, because on a shallow slope a small
error of aim is a large one of motion); a window at rest accepts D if |M D| < 1/2, and accepts "none". A rotation within
2.5 degrees of the phase's start, or a third of the angles turned, is tremor and counts as rest; so does a translation
if both hold, with 5 mm.

The votes of a group are the largest share of windows that accept one D, in the worst phase and demonstration (of four
windows or more), the smaller of translation and rotation. The best pair is joined while its votes are at least max(0.6,
min(0.78, base - 0.05)), base being the worse of the two alone. Shares of short intervals, over which aim wanders, are
shrunk towards the phase's by 10 windows. At 20 degrees wavering splits one motion, at 30 lowering and sliding become
one.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float, norm, unit
from skillframe_segmenter.emission import Observed

DIRECTIONS = 600


@lru_cache(maxsize=2)
def sphere(count: int) -> Float:
    """(count, 3) unit vectors, evenly spread on Fibonacci's lattice."""
    i = np.arange(count) + 0.5
    z = 1.0 - 2.0 * i / count
    angle = np.pi * (1.0 + np.sqrt(5.0)) * i
    radius = np.sqrt(1.0 - z * z)
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle), z])


def _accepted(motion: Float, free: Float, angle: float, held: bool) -> Float:
    """(D + 1,) share of windows that accept each direction, "none" last, for motion (W, 3), free (W, 3, 3)."""
    count = len(motion)
    allowed = (free.reshape(3 * count, 3).astype(np.float32) @ sphere(DIRECTIONS).T.astype(np.float32)).reshape(
        count, 3, DIRECTIONS
    )
    size = np.einsum("wid,wid->wd", allowed, allowed)
    along = np.einsum("wid,wi->wd", allowed, unit(motion).astype(np.float32))
    moving = (norm(motion)[:, None] > 0.5) & (not held)
    beside = size - along * along < np.maximum(0.3, np.tan(angle) * along) ** 2
    accepts = np.where(moving, (along > 0.38) & beside, size < 0.5**2)
    return np.append(accepts.mean(axis=0), float((~moving).mean()))


def leaning(shares: Float, sizes: Float) -> Float:
    """Shares (cells, 2, D + 1) of a phase, shrunk to their mean by 10 windows, with sizes (cells,)."""
    if len(sizes) < 2:
        return shares
    weight = sizes[:, None, None]
    mean = (weight * shares).sum(axis=0) / sizes.sum()
    result: Float = (weight * shares + 10.0 * mean) / (weight + 10.0)
    return result


def _votes(group: Sequence[int], shares: Sequence[Float]) -> float:
    cells = np.concatenate([shares[k] for k in group])
    return float(cells.min(axis=0).max(axis=-1).min()) if len(cells) else 0.0


def groups_of_one_motion(
    seen: Observed, travelled: Float, labels: Sequence[NDArray[np.intp]], phases: int, angle: float, least: float
) -> list[int]:
    """The group of each phase, where phases of one group are one motion.

    Args:
        seen: all windows.
        travelled: (W, 6) displacement and turn since the start of the demonstration [m, rad].
        labels: phase of each window, by demonstration.
        phases: number of phases.
        angle: of acceptance [rad].
        least: least votes of a group.
    """
    first = np.concatenate([[0], np.cumsum([len(x) for x in labels])])
    shares = []
    for k in range(phases):
        cells, sizes = [], []
        for each, offset in zip(labels, first[:-1], strict=True):
            mine = offset + np.flatnonzero(each == k)
            if len(mine) < 4:  # windows
                continue
            runs = np.split(mine, np.flatnonzero(np.diff(mine) > 1) + 1)
            parts = [(travelled[run] - travelled[run[0]]).reshape(-1, 2, 3) for run in runs]
            far = np.max([norm(part).max(axis=0) for part in parts], axis=0)
            path = np.sum([norm(np.diff(part, axis=0)).sum(axis=0) for part in parts], axis=0)
            near, trembles = far < (5e-3, float(np.deg2rad(2.5))), far < 1.0 / 3.0 * path
            held = np.array([near[0] and trembles[0], near[1] or trembles[1]])
            some = mine[np.linspace(0, len(mine) - 1, min(len(mine), 150)).astype(int)]
            u = seen.motion[some].reshape(-1, 2, 3)
            cells.append([_accepted(u[:, p], seen.free[some, p], angle, bool(held[p])) for p in range(2)])
            sizes.append(len(mine))
        shares.append(leaning(np.array(cells).reshape(-1, 2, DIRECTIONS + 1), np.array(sizes, dtype=float)))
    groups = [[k] for k in range(phases)]
    while len(groups) > 1:
        alone = [_votes(g, shares) for g in groups]
        pairs = [(i, j) for i in range(len(groups)) for j in range(i)]
        score, (i, j) = max((_votes(groups[i] + groups[j], shares), (i, j)) for i, j in pairs)
        if score < max(least, min(0.78, min(alone[i], alone[j]) - 0.05)):
            break
        groups[j] += groups.pop(i)
    return [next(g for g, members in enumerate(groups) if k in members) for k in range(phases)]

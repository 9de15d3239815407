r"""Which phases are one linear motion with compliance: those that one desired direction explains.

The paper's valley is the test: sliding down either side is one LMC, and so is the approach, although velocities and
wrenches are opposite. 600 directions D on the sphere, and "none", are put to every window, translation and rotation
apart; with M the projector of `emission`, a window that moves (|u| > 1/2) accepts D if

    along > 0.38   and   (beside < 0.3   or   angle(M D, u) < 25 degrees),

with `along` and `beside` the parts of M D along the motion and across it (on a shallow slope a small error of the aim
is a large one of the motion, so either measure will do); a window at rest accepts D if |M D| < 1/2, and accepts
"none". A tool that never gets 2.5 degrees away from where the phase found it, or no farther than a third of the angles
it turns through, trembles in a soft hand: its rotation is at rest throughout; and so is its translation if both hold,
with 5 mm.

The votes of a group of phases are the largest share of windows that one D finds, in the worst phase and demonstration
(of four windows or more); the smaller of translation and rotation counts. The best pair is joined as long as its votes
are at least max(0.6, min(0.78, base - 0.05)), base being the worse of the two alone. A person's aim wanders in about
half a second, so that a shorter interval is one look at it, and one look must not have a veto: the shares of a
demonstration's windows are drawn to those of the whole phase by as much as 10 windows weigh. All constants are ours;
the angle is the delicate one: at 20 degrees one motion stays in parts when the person's aim wavers, at 30 lowering and
sliding become one.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float, norm, unit
from skillframe_segmenter.emission import Observed

DIRECTIONS, FEWEST, MOST = 600, 4, 150
WANDERING = 10.0  # windows
MOVING, ALONG, BESIDE, STILL = 0.5, 0.38, 0.3, 0.5
BEST_BAR, SLACK = 0.78, 0.05
HELD = (5e-3, float(np.deg2rad(2.5)))  # m, rad
TREMBLING = 1.0 / 3.0


@lru_cache(maxsize=2)
def sphere(count: int) -> Float:
    """(count, 3) unit vectors, evenly spread: Fibonacci's lattice."""
    i = np.arange(count) + 0.5
    z = 1.0 - 2.0 * i / count
    angle = np.pi * (1.0 + np.sqrt(5.0)) * i
    radius = np.sqrt(1.0 - z * z)
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle), z])


def _accepted(motion: Float, free: Float, angle: float, held: bool) -> Float:
    """(D + 1,) share of windows that accept each direction, "none" last. Motion is (W, 3), free (W, 3, 3)."""
    count = len(motion)
    allowed = (free.reshape(3 * count, 3).astype(np.float32) @ sphere(DIRECTIONS).T.astype(np.float32)).reshape(
        count, 3, DIRECTIONS
    )
    size = np.einsum("wid,wid->wd", allowed, allowed)
    along = np.einsum("wid,wi->wd", allowed, unit(motion).astype(np.float32))
    moving = (norm(motion)[:, None] > MOVING) & (not held)
    beside = size - along * along < np.maximum(BESIDE, np.tan(angle) * along) ** 2
    accepts = np.where(moving, (along > ALONG) & beside, size < STILL**2)
    return np.append(accepts.mean(axis=0), float((~moving).mean()))


def _shares(
    seen: Observed, travelled: Float, labels: Sequence[NDArray[np.intp]], phases: int, angle: float
) -> list[Float]:
    """For each phase (cells, 2, D + 1): shares in each demonstration where it has windows enough."""
    first = np.concatenate([[0], np.cumsum([len(x) for x in labels])])
    result = []
    for k in range(phases):
        cells, sizes = [], []
        for each, offset in zip(labels, first[:-1], strict=True):
            mine = offset + np.flatnonzero(each == k)
            if len(mine) < FEWEST:
                continue
            held = _held(travelled, mine)
            some = mine[np.linspace(0, len(mine) - 1, min(len(mine), MOST)).astype(int)]
            u = seen.motion[some].reshape(-1, 2, 3)
            cells.append([_accepted(u[:, p], seen.free[some, p], angle, bool(held[p])) for p in range(2)])
            sizes.append(len(mine))
        result.append(_leaning(np.array(cells).reshape(-1, 2, DIRECTIONS + 1), np.array(sizes, dtype=float)))
    return result


def _leaning(shares: Float, sizes: Float) -> Float:
    """Shares (cells, 2, D + 1) of a phase, each drawn to their mean by `WANDERING` windows. Sizes (cells,)."""
    if len(sizes) < 2:
        return shares
    weight = sizes[:, None, None]
    mean = (weight * shares).sum(axis=0) / sizes.sum()
    result: Float = (weight * shares + WANDERING * mean) / (weight + WANDERING)
    return result


def _held(travelled: Float, windows: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Whether translation and rotation (2,) stay where the runs of windows began."""
    runs = np.split(windows, np.flatnonzero(np.diff(windows) > 1) + 1)
    parts = [(travelled[run] - travelled[run[0]]).reshape(-1, 2, 3) for run in runs]
    far = np.max([norm(part).max(axis=0) for part in parts], axis=0)
    path = np.sum([norm(np.diff(part, axis=0)).sum(axis=0) for part in parts], axis=0)
    near, trembles = far < HELD, far < TREMBLING * path
    return np.array([near[0] and trembles[0], near[1] or trembles[1]])


def _votes(group: Sequence[int], shares: Sequence[Float]) -> float:
    cells = np.concatenate([shares[k] for k in group])
    return float(cells.min(axis=0).max(axis=-1).min()) if len(cells) else 0.0


def groups_of_one_motion(
    seen: Observed, travelled: Float, labels: Sequence[NDArray[np.intp]], phases: int, angle: float, least: float
) -> list[int]:
    """The group of each phase. Phases of one group are one motion.

    Args:
        seen: all windows.
        travelled: (W, 6) displacement and turn since the start of the demonstration [m, rad].
        labels: phase of each window, by demonstration.
        phases: how many there are.
        angle: of acceptance [rad].
        least: least votes of a group.
    """
    shares = _shares(seen, travelled, labels, phases, angle)
    groups = [[k] for k in range(phases)]
    while len(groups) > 1:
        alone = [_votes(g, shares) for g in groups]
        pairs = [(i, j) for i in range(len(groups)) for j in range(i)]
        score, (i, j) = max((_votes(groups[i] + groups[j], shares), (i, j)) for i, j in pairs)
        if score < max(least, min(BEST_BAR, min(alone[i], alone[j]) - SLACK)):
            break
        groups[j] += groups.pop(i)
    return [next(g for g, members in enumerate(groups) if k in members) for k in range(phases)]

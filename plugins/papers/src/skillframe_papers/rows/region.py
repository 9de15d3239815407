r"""Row 36: starts from which a learned push converges, predicted by Coulomb's law.

A ball that starts on one side of a valley of slope a slides to the bottom under a learned push iff

    t < a - atan(mu)

where t is the tilt of the push from the valley's -z towards that slope (statics; rows 1 and 2). Teachers aim off by up
to 15 degrees and half of them show one side only, so each learned push has a region of its own. The valley is tilted
near the limit of a push straight down. Nulls: all converge, none does, and the region of that push.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import degrees, radians
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.extend import Document, RowResult, RowRun
from skillframe.frames import Float, rotate
from skillframe.world import Scene, displacement
from skillframe_papers.rows.harness import (
    DOWN,
    Ran,
    TaughtSet,
    compared,
    executed,
    lmc,
    not_behind,
    seeds,
    shown,
    teacher,
    world,
)
from skillframe_papers.rows.uneven_demonstrations import aimed

OFF_DEG, BESIDE_DEG = 15.0, 10.0  # errors of aim, and tilts of the valley from the limit
NEAR_M, FAR_M = 0.01, 0.06  # starts from the valley's bottom
OURS, STRAIGHT = "the learned push's own region", "the region of a push straight down"
ALL, NONE = "every start converges", "no start converges"


class Starts(NamedTuple):
    """Starts of trials: side (N,), +1 or -1, orientation of the valley (N, 3, 3), and quantities."""

    side: Float
    turn: Float
    draws: dict[str, Float]


def starts(scene: Scene, limit: float, count: int, seed: int) -> Starts:
    """Starts above either slope of valleys tilted near the limit [rad] of a push straight down."""
    rng = np.random.default_rng([seed, 1])
    side = np.where(np.arange(count) % 2 == 0, 1.0, -1.0)
    tilt = side * (limit + np.radians(rng.uniform(-BESIDE_DEG, BESIDE_DEG, count)))
    moved = displacement({"fixture.tilt_y": tilt}, "fixture", count)
    assert moved is not None
    away, nominal, slope = side * rng.uniform(NEAR_M, FAR_M, count), np.array(scene.start_tip), radians(45.0)
    seen = np.stack([away, np.zeros(count), nominal[2] + np.abs(away) * np.tan(slope)], axis=-1)
    offset = rotate(moved.rotation, seen) - nominal
    offset[:, 2] -= scene.start_lift(offset, np.zeros_like(offset))
    draws = {"fixture.tilt_y": tilt} | {f"start.offset_{a}": offset[:, i] for i, a in enumerate("xyz")}
    return Starts(side, moved.rotation, draws)


def converges(push: Float, given: Starts, limit: float) -> NDArray[np.bool_]:
    """Predicted convergence (N,) of a push (3,) in base, with the limit of its tilt [rad]."""
    x, _, z = rotate(np.swapaxes(given.turn, -1, -2), np.broadcast_to(push, (len(given.side), 3))).T
    borne: NDArray[np.bool_] = np.arctan2(given.side * x, -z) < limit
    return borne


def _learned(job: RowRun, scene: Scene, seed: int) -> Document:
    off = radians(np.random.default_rng([seed, 0]).uniform(-OFF_DEG, OFF_DEG))
    told = aimed(scene, np.array([np.sin(off), 0.0, -np.cos(off)]), scene.task.starts)
    return lmc(shown(told, teacher(job), count=1 + seed % 2, seed=seed))


class Tried(NamedTuple):
    """One set: error of its push [rad], predictions, and outcomes (N,)."""

    off: float
    told: dict[str, NDArray[np.bool_]]
    success: NDArray[np.bool_]


def region(job: RowRun) -> RowResult:
    """Row 36: starts whose convergence theory predicts correctly."""
    scene = world(job, "valley", tolerance=0.002)
    limit, found = float(scene.analytic["largest_tilt_rad"]), list[Tried]()
    sets = seeds(job, 71_000, job.count(10, 2))
    documents = [_learned(job, scene, seed) for seed in sets]
    given = [starts(scene, limit, job.count(20, 10), seed) for seed in sets]
    trials = [
        TaughtSet({OURS: document}, each.draws, (seed, 2))
        for document, each, seed in zip(documents, given, sets, strict=True)
    ]
    ends = executed(job, scene, trials, duration_s=12.0)[OURS]
    for document, each, end in zip(documents, given, ends, strict=True):
        push, nothing = document["phases"][0]["translation"]["desired_direction"], np.zeros(len(each.side), dtype=bool)
        told = {
            OURS: nothing if push is None else converges(np.array(push), each, limit),
            STRAIGHT: converges(DOWN, each, limit), ALL: ~nothing, NONE: nothing,
        }  # fmt: skip
        off = np.nan if push is None else float(np.arctan2(push[0], -push[2]))
        job.tell(f"push {degrees(off):+.1f} degrees off, {int(end.success.sum())} of {len(end.success)} converge")
        found.append(Tried(off, told, end.success))
    right = {name: sum(int((each.told[name] == each.success).sum()) for each in found) for name in found[0].told}
    return result(job, right, found)


def result(job: RowRun, right: Mapping[str, int], found: list[Tried]) -> RowResult:
    """Row 36 of starts about which each prediction is right."""
    count = sum(len(each.success) for each in found)
    hits = {name: Ran.of(each, count) for name, each in right.items()}
    nulls = {name: each for name, each in hits.items() if name != OURS}
    off = np.degrees(np.abs([each.off for each in found]))
    converged = sum(int(each.success.sum()) for each in found)
    return RowResult(
        ours=f"right about {hits[OURS]} starts near the border; nulls: "
        + ", ".join(f"{name} {each.hits}" for name, each in nulls.items()),
        verdict=compared(job, [hits[OURS]], not not_behind(job, hits[OURS], nulls)), values={"share": hits[OURS].share},
        head=("predicted by", "right about"), rows=[(name, str(each)) for name, each in hits.items()],
        difference=f"The valley is tilted up to {BESIDE_DEG:g} degrees more or less than a push straight down bears. "
        f"Starts are {1e3 * NEAR_M:g} to {1e3 * FAR_M:g} mm from its bottom, and {converged} converge. Learned "
        f"pushes are {np.nanmin(off):.1f} to {np.nanmax(off):.1f} degrees off, taught by people who aim off by up to "
        f"{OFF_DEG:g}, half of whom show one side only. Theory knows slopes and friction, the learner does not.",
    )  # fmt: skip

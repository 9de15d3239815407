r"""Row 36 of the papers' results: from which starts a learned push converges, told beforehand by Coulomb's law.

A ball that starts on one side of a valley of slope a, pushed along what was learned, slides to the bottom iff

    t < a - atan(mu)

where t is the tilt of the push from the valley's own -z towards the slope it starts on (statics; rows 1 and 2). The
people who teach aim off by up to 15 degrees and half of them show one side only, so that learned pushes are off, too,
and each has a region of its own. Then the valley stands tilted by what a push straight down would just bear or just
not, where theory can be wrong. Nulls: whatever is tried converges, nothing does, and the region of a push straight
down, which knows of the valley and not of what was learned.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import degrees, radians
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.document.source import learned
from skillframe.execution.prepare import load_robot_model, load_world
from skillframe.extend.records import Document, LearnOptions, RowResult, RowRun
from skillframe.extend.registry import registry
from skillframe.frames import Float, rotate
from skillframe.teaching.sessions import record
from skillframe.teaching.teacher import TeacherSettings
from skillframe.world.plant import displacement
from skillframe.world.scene import Scene
from skillframe_papers.bars import ahead, counted, judged, together
from skillframe_papers.rows.blocks import Trials, successes
from skillframe_papers.rows.uneven import aimed

SEED = 71_000
SETS, QUICK_SETS = 10, 2
STARTS, QUICK_STARTS = 20, 10
SHARE, LONGEST_S = 0.9, 12.0
OFF_DEG, BESIDE_DEG = 15.0, 10.0
NEAR_M, FAR_M = 0.01, 0.06
SLOPE = radians(45.0)
DOWN = np.array([0.0, 0.0, -1.0])
ALL, NONE, STRAIGHT = "every start converges", "no start converges", "the region of a push straight down"


class Starts(NamedTuple):
    """Where trials start: the side of the valley (N,), +1 or -1, how it stands (N, 3, 3), and the quantities drawn."""

    side: Float
    turn: Float
    draws: dict[str, Float]


def starts(scene: Scene, limit: float, count: int, seed: int) -> Starts:
    """Starts above either slope of valleys that stand tilted by the limit [rad] of a push straight down, or near it."""
    rng = np.random.default_rng([seed, 1])
    side = np.where(np.arange(count) % 2 == 0, 1.0, -1.0)
    tilt = side * (limit + np.radians(rng.uniform(-BESIDE_DEG, BESIDE_DEG, count)))
    moved = displacement({"fixture.tilt_y": tilt}, "fixture", count)
    assert moved is not None
    away, nominal = side * rng.uniform(NEAR_M, FAR_M, count), np.array(scene.start_tip)
    seen = np.stack([away, np.zeros(count), nominal[2] + np.abs(away) * np.tan(SLOPE)], axis=-1)
    offset = rotate(moved.rotation, seen) - nominal
    offset[:, 2] -= scene.start_lift(offset, np.zeros_like(offset))
    draws = {"fixture.tilt_y": tilt} | {f"start.offset_{a}": offset[:, i] for i, a in enumerate("xyz")}
    return Starts(side, moved.rotation, draws)


def converges(push: Float, given: Starts, limit: float) -> NDArray[np.bool_]:
    """Which starts (N,) theory says a push (3,) in base brings to the bottom, with the limit of its tilt [rad]."""
    x, _, z = rotate(np.swapaxes(given.turn, -1, -2), np.broadcast_to(push, (len(given.side), 3))).T
    borne: NDArray[np.bool_] = np.arctan2(given.side * x, -z) < limit
    return borne


def _learned(job: RowRun, scene: Scene, seed: int) -> Document:
    off = radians(np.random.default_rng([seed, 0]).uniform(-OFF_DEG, OFF_DEG))
    person = TeacherSettings(aim_noise=radians(job.settings["teacher.aim_noise_deg"]))
    told = aimed(scene, np.array([np.sin(off), 0.0, -np.cos(off)]), scene.task.starts)
    each = 1 + seed % 2
    shown = record(load_robot_model("free_tool"), told, person, count=each, seed=seed).demonstrations
    return learned(registry().skill("lmc"), list(shown), LearnOptions())


class Tried(NamedTuple):
    """One set: how far its push is off [rad], what each way of telling says of each start, and what happened (N,)."""

    off: float
    told: dict[str, NDArray[np.bool_]]
    success: NDArray[np.bool_]


OURS = "the learned push's own region"


def _tried(job: RowRun, scene: Scene) -> list[Tried]:
    limit, seeds = float(scene.analytic["largest_tilt_rad"]), _seeds(job)
    documents = [_learned(job, scene, seed) for seed in seeds]
    given = [starts(scene, limit, job.count(STARTS, QUICK_STARTS), seed) for seed in seeds]
    trials = [
        Trials(document, each.draws, [np.random.default_rng([seed, 2, k]) for k in range(len(each.side))])
        for document, each, seed in zip(documents, given, seeds, strict=True)
    ]
    done = successes(load_robot_model("free_tool"), scene, trials, duration_s=LONGEST_S)
    return [_one(job, *each, limit) for each in zip(documents, given, done, strict=True)]


def _seeds(job: RowRun) -> list[int]:
    return [SEED + 1000 * job.seed + i for i in range(job.count(SETS, QUICK_SETS))]


def _one(job: RowRun, document: Document, given: Starts, success: NDArray[np.bool_], limit: float) -> Tried:
    push = document["phases"][0]["translation"]["desired_direction"]
    nothing = np.zeros(len(given.side), dtype=bool)
    told = {
        OURS: nothing if push is None else converges(np.array(push), given, limit),
        STRAIGHT: converges(DOWN, given, limit), ALL: ~nothing, NONE: nothing,
    }  # fmt: skip
    off = np.nan if push is None else float(np.arctan2(push[0], -push[2]))
    job.tell(f"push {degrees(off):+.1f} degrees off, {int(success.sum())} of {len(success)} converge")
    return Tried(off, told, success)


def region(job: RowRun) -> RowResult:
    """Row 36: starts of which theory says rightly whether a learned push converges from them."""
    scene = load_world("valley", {"friction": job.settings["world.friction"], "tolerance": 0.002})
    found = _tried(job, scene)
    right = {name: sum(int((each.told[name] == each.success).sum()) for each in found) for name in found[0].told}
    return _told(job, right, found)


def _told(job: RowRun, right: Mapping[str, int], found: list[Tried]) -> RowResult:
    """The row, from how many starts each way of telling was right about."""
    count, ours = sum(len(each.success) for each in found), right[OURS]
    nulls = [name for name in right if name != OURS]
    beside = all(ahead(ours, right[name], count, quick=job.quick) for name in nulls)
    off = np.degrees(np.abs([each.off for each in found]))
    converged = sum(int(each.success.sum()) for each in found)
    return RowResult(
        ours=f"right about {counted(ours, count)} starts near the border; nulls: "
        + ", ".join(f"{name} {right[name]}" for name in nulls),
        verdict=together([judged(ours, count, SHARE, quick=job.quick)], beside), values={"share": ours / count},
        head=("what tells", "right about"), rows=[(name, counted(hits, count)) for name, hits in right.items()],
        difference=f"The valley is tilted up to {BESIDE_DEG:g} degrees more or less than a push straight down bears. "
        f"Starts are {1e3 * NEAR_M:g} to {1e3 * FAR_M:g} mm from its bottom, and {converged} converge. Learned "
        f"pushes are {np.nanmin(off):.1f} to {np.nanmax(off):.1f} degrees off, taught by people who aim off by up to "
        f"{OFF_DEG:g}, half of whom show one side only. Theory knows slopes and friction, the learner does not.",
    )  # fmt: skip

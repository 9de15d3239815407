"""Rows 15, 16 and 26: phases found in simulated demonstrations, by the phase model and by plain rules.

A true change is the interval from the teacher's instant change of stage to the tool's response, when the push has
turned and overcome friction. Tables move with the start, by 30 mm up or down.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache
from typing import NamedTuple

import numpy as np
from skillframe_teaching.teacher import HANDS

from skillframe.demonstration import Demonstration
from skillframe.extend import Document, Illustration, LearnOptions, RowResult, RowRun, registry
from skillframe.frames import Float, matrix_from_quaternion, rotation_vector
from skillframe_papers.bars import undecided
from skillframe_papers.rows.harness import SHARE, Key, Ran, compared, key_of, leads, shown, teacher, world

EACH = 3  # demonstrations of a group
NEAR_S = 0.30  # largest error of a change
SEED = 63_000
"""Seeds other than those on which the method was developed."""


class Staged(NamedTuple):
    """A world with two stages, and the second's direction of motion or turn."""

    world: str
    params: tuple[tuple[str, float], ...]
    way: tuple[float, float, float]
    turns: bool = False


TASKS = {
    "valley": Staged("valley", (("wall_distance", 0.05),), (0.0, 1.0, 0.0)),
    "corner": Staged("corner", (), (0.5**0.5, 0.5**0.5, 0.0)),
    "hose coupler": Staged("hose_coupler", (("interlock", 0.7),), (0.0, 0.0, 1.0), turns=True),
}


class Taught(NamedTuple):
    """A demonstration and the interval [s] in which its phase truly changes.

    Attributes:
        change: from the teacher's change of stage to the tool's first response by 1 mm or 1 degree.
        settled: its last response [s], after any sticking.
    """

    demonstration: Demonstration
    change: tuple[float, float]
    settled: float


@cache
def demonstrated(
    key: Key, seed: int, count: int, name: str, moved: float = 0.0, pace: float = 1.0
) -> tuple[Taught, ...]:
    """Demonstrations of a task, from its starts in turn, table and start raised [m], at a pace."""
    job, task = RowRun(settings=dict(key)), TASKS[name]
    scene = world(job, task.world, **dict(task.params))
    speed = None if pace == 1.0 else pace * HANDS[scene.task.hand].speed
    draws = {"fixture.offset_z": moved, "start.offset_z": moved} if moved else None
    found = shown(scene, teacher(job, speed=speed), count=count, seed=seed, draws=draws, duration_s=20.0)
    return tuple(timed(each, task) for each in found)


def timed(demonstration: Demonstration, task: Staged) -> Taught:
    """A demonstration with the interval in which its phase truly changes."""
    (start,) = demonstration.meta["stages"]
    first = int(np.searchsorted(demonstration.time, start))
    progress: Float
    if task.turns:
        rotation = matrix_from_quaternion(demonstration.quaternion[first:])
        progress = rotation_vector(rotation @ rotation[0].T) @ np.array(task.way) / np.radians(1.0)
    else:
        progress = (demonstration.position[first:] - demonstration.position[first]) @ np.array(task.way) / 1e-3
    time = demonstration.time[first:]
    followed, before = int(np.argmax(progress > 1.0)), np.flatnonzero(progress <= 1.0)
    settled = min(int(before[-1]) + 1, len(time) - 1)
    return Taught(demonstration, (float(start), float(time[followed])), float(time[settled]))


@cache
def policies_of(key: Key, seed: int, groups: int, name: str, segmenter: str = "wrench_hmm") -> tuple[Document, ...]:
    """A policy from each group of three demonstrations."""
    learn = registry().skill("policy").learn
    assert learn is not None
    given = [t.demonstration for t in demonstrated(key, seed, groups * EACH, name)]
    options = LearnOptions(settings={"segmenter": segmenter})
    return tuple(learn(given[EACH * i : EACH * (i + 1)], options) for i in range(groups))


def groups_of(job: RowRun) -> int:
    """Groups of demonstrations of a world."""
    return job.count(12, 2)


def late_by(time: float, change: tuple[float, float]) -> float:
    """Time from a true change [s]: negative before, zero within it."""
    return time - float(np.clip(time, *change))


class Found(NamedTuple):
    """Cuts found in a group.

    Attributes:
        phases: number; alike: the same ones in all demonstrations.
        off: largest error of a change [s], inf unless cut once; settled: the same against `Taught.settled`.
        mislabelled: share of the time.
    """

    phases: int
    alike: bool
    off: float
    settled: float
    mislabelled: float


def compared_to_truth(count: int, alike: bool, cuts: Sequence[float] | None, taught: Sequence[Taught]) -> Found:
    """A group's cuts, one a demonstration (else None), against the truth."""
    if cuts is None:
        return Found(count, alike, np.inf, np.inf, 1.0)
    off = [abs(late_by(cut, t.change)) for cut, t in zip(cuts, taught, strict=True)]
    settled = [abs(late_by(cut, (t.change[0], t.settled))) for cut, t in zip(cuts, taught, strict=True)]
    return Found(count, alike, max(off), max(settled), sum(off) / sum(t.demonstration.duration for t in taught))


def halved(taught: Sequence[Taught]) -> Found:
    """The null: every demonstration cut in its middle."""
    middle = [float(0.5 * (t.demonstration.time[0] + t.demonstration.time[-1])) for t in taught]
    return compared_to_truth(2, True, middle, taught)


def all_found(job: RowRun, name: str) -> tuple[list[Found], list[Found]]:
    """Cuts of every group by the phase model, and in the middle."""
    groups, found = groups_of(job), list[Found]()
    taught = demonstrated(key_of(job), SEED + job.seed, groups * EACH, name)
    each = [taught[EACH * i : EACH * (i + 1)] for i in range(groups)]
    for policy, group in zip(policies_of(key_of(job), SEED + job.seed, groups, name), each, strict=True):
        rows = policy["demonstrations"]
        alike = len({tuple(row["labels"]) for row in rows}) == 1
        cuts = [row["boundaries"][0] for row in rows] if all(len(row["boundaries"]) == 1 for row in rows) else None
        found.append(compared_to_truth(len(policy["phase_model"]["successors"]), alike, cuts, group))
    return found, [halved(t) for t in each]


def hose(job: RowRun) -> RowResult:
    """Row 15: the phases of the hose coupler."""
    words = "two phases and under 5 % mislabelled"
    return _segmented(job, "hose coupler", lambda f: f.phases == 2 and f.mislabelled < 0.05, words)


def valley(job: RowRun) -> RowResult:
    """Row 16: the phases of the valley."""
    words = "two phases, both sides alike, the change within 0.3 s"
    found, _ = all_found(job, "valley")
    alike = [f for f in found if f.phases == 2 and f.alike]
    result = _segmented(job, "valley", lambda f: f.phases == 2 and f.alike and f.off <= NEAR_S, words)
    settled = sum(f.settled <= NEAR_S for f in alike)
    told = (
        f"The phases alone, of which the paper gives no times, are right in {len(alike)} of {len(found)} groups; with "
        f"changes that last until the tool has moved on for good the threshold's count is {settled} of {len(found)}. "
    )
    return replace(result, difference=told + result.difference)


def _segmented(job: RowRun, name: str, right: Callable[[Found], bool], words: str) -> RowResult:
    found, halves = all_found(job, name)
    good, null = (Ran(np.array([right(each) for each in some])) for some in (found, halves))
    once = [f for f in found if np.isfinite(f.off)]
    counts = {k: sum(f.phases == k for f in found) for k in sorted({f.phases for f in found})}
    rows = [
        ("phases found", ", ".join(f"{k} in {count}" for k, count in counts.items())),
        ("all demonstrations through the same phases", str(Ran(np.array([f.alike for f in found])))),
        ("largest error of a change", f"{max((f.off for f in once), default=float('nan')):.2f} s"),
        ("mislabelled time", f"{100.0 * float(np.mean([f.mislabelled for f in found])):.1f} %"),
        ("the null's mislabelled time", f"{100.0 * float(np.mean([f.mislabelled for f in halves])):.1f} %"),
    ]  # fmt: skip
    return RowResult(
        ours=f"{words} in {good} groups of {EACH}; cut in the middle, {null.hits}", head=("", "ours"),
        rows=rows, verdict=compared(job, [good], leads(job, good, null)),
        values={"share": good.share, "null": null.share},
        difference="Null: every demonstration cut in its middle. "
        f"{undecided(good.hits, good.trials, SHARE, quick=job.quick)}",
        pictures=[_picture(job, name)],
    )  # fmt: skip


class Rule(NamedTuple):
    """Changes found within 0.3 s, and cuts elsewhere."""

    near: Ran
    false: int


def rule(boundaries: Sequence[Sequence[float]], taught: Sequence[Taught]) -> Rule:
    """Cuts of demonstrations against their changes."""
    off = [[abs(late_by(t, each.change)) for t in cuts] for cuts, each in zip(boundaries, taught, strict=True)]
    near = Ran(np.array([min(each, default=np.inf) <= NEAR_S for each in off]))
    return Rule(near, sum(o > NEAR_S for each in off for o in each))


def rules(job: RowRun) -> RowResult:
    """Row 26: changes found by the phase model and by plain rules."""
    plain: dict[str, dict[str, float]] = {"stops": {}, "stops and a force of 5 N": {"force_n": 5.0}}
    fit, groups = registry().segmenter("zvc").fit, groups_of(job)
    rows, told, all_ours, beside = list[tuple[str, ...]](), list[str](), list[Ran](), True
    for name in TASKS:
        taught = demonstrated(key_of(job), SEED + job.seed, groups * EACH, name)
        shown = [t.demonstration for t in taught]
        cuts = {"phase model": policies_of(key_of(job), SEED + job.seed, groups, name)}
        for words, settings in plain.items():
            cuts[words] = tuple(fit(shown[EACH * i : EACH * (i + 1)], None, settings) for i in range(groups))
        found = {
            method: rule([row["boundaries"] for each in fits for row in each["demonstrations"]], taught)
            for method, fits in cuts.items()
        }
        rows += [(name, method, str(each.near), str(each.false)) for method, each in found.items()]
        (ours, _), *others = found.values()
        beside = beside and all(leads(job, ours, each.near) for each in others)
        all_ours.append(ours)
        told.append(f"{name} {ours.hits} of {ours.trials}, {' and '.join(str(o.near.hits) for o in others)}")
    return RowResult(
        ours=f"changes within 0.3 s, the phase model, then {' and '.join(plain)}: {'; '.join(told)}",
        verdict=compared(job, all_ours, beside), head=("world", "cut by", "within 0.3 s", "cuts elsewhere"), rows=rows,
        difference="The rules are the nulls. A simulated teacher does not stop between two stages; one who does is "
        "easier to cut.",
    )  # fmt: skip


def _picture(job: RowRun, name: str) -> Illustration:
    """Figure 17b: phases of two demonstrations over time, and their true changes."""
    from matplotlib.figure import Figure
    from skillframe_segmenter.drawing import BLUE, GREEN, INK, RED, svg

    key, groups = key_of(job), groups_of(job)
    taught = demonstrated(key, SEED + job.seed, groups * EACH, name)
    rows = policies_of(key, SEED + job.seed, groups, name)[0]["demonstrations"]
    figure = Figure(figsize=(7.4, 5.0))
    colours = ("#dbe8f6", "#f9dfd8", "#dff3e8", "#efe4f7")
    for canvas, row, each in zip(figure.subplots(2, 1), rows, taught, strict=False):
        time, start = each.demonstration.time, each.demonstration.time[0]
        edges = [float(start), *row["boundaries"], float(time[-1])]
        for i, label in enumerate(row["labels"]):
            canvas.axvspan(edges[i] - start, edges[i + 1] - start, color=colours[label % len(colours)], lw=0)
        canvas.axvspan(each.change[0] - start, each.change[1] - start, fill=False, hatch="////", ec=INK, lw=0.5)
        curves, unit = 1e3 * (each.demonstration.position - each.demonstration.position[0]), "position [mm]"
        if TASKS[name].turns:
            rotation = matrix_from_quaternion(each.demonstration.quaternion)
            curves, unit = np.degrees(rotation_vector(rotation @ rotation[0].T)), "turn [degrees]"
        for curve, colour, axis in zip(curves.T, (RED, GREEN, BLUE), "xyz", strict=True):
            canvas.plot(time - start, curve, color=colour, label=axis)
        canvas.set_ylabel(unit)
    figure.axes[0].legend(ncols=3, frameon=False, loc="lower center", bbox_to_anchor=(0.5, 1.0))
    figure.axes[1].set_xlabel("time [s]")
    caption = (
        "Motion from the start of two demonstrations; background: phases as found (one colour a phase); hatched: where "
        "the phase truly changes, from the hand's decision until the tool follows."
    )
    return Illustration(f"Phases of the {name} (Fig. 17b)", caption, svg(figure))

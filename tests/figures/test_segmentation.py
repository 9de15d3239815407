"""The acceptance figures of the segmenter over fresh seeds, beside all baselines. `pytest -s -m figures` prints them.

Boundaries are judged within windows of 50 ms: missed beyond 0.30 s, false beyond 0.35 s (see `tests.figures.phases`).
Seeds were used for nothing else. Thresholds that are called reachable are asserted; rows marked "hard" are shown.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache
from typing import NamedTuple

import numpy as np
import pytest
from skillframe_segmenter.model import from_document
from skillframe_segmenter.observer import follow
from skillframe_segmenter.windows import cut_all

from skillframe.demonstration.record import Demonstration
from skillframe.errors import InputError
from skillframe.extend.reading import read_demonstration
from skillframe.frames import Float
from tests.figures import quasistatic as made
from tests.figures import staged
from tests.figures.phase_baselines import BASELINES
from tests.figures.phases import NOTHING, Interval, Score, one_story, phases_of, policy, score
from tests.references import recordings_dir

pytestmark = [pytest.mark.figures, pytest.mark.needs_plugins]
TOUCH_N, TOUCHED_S = 1.5, 0.40
SEEDS = range(7000, 7012)
LATER = {"hose coupler": range(7100, 7112)}  # detours are joined by a rule that came when 7000 to 7011 had been seen
ASKEW = tuple(0.03 * np.array(s) for s in ((1.0, -1.0, 1.0), (-1.0, 1.0, -1.0)))  # where tables go [m], in turn
UPRIGHT = tuple(0.03 * np.array([0.0, 0.0, s]) for s in (1.0, -1.0))


class Taught(NamedTuple):
    """A demonstration and when its phases truly change."""

    demonstration: Demonstration
    changes: list[Interval]


def line(name: str, *cells: object) -> None:
    print(f"{name:<44}" + "".join(f"{cell!s:>16}" for cell in cells), flush=True)


@cache
def quasistatic(task: str, seed: int, count: int, noise: float, slope: float, new: bool) -> tuple[Taught, ...]:
    options = {"noise": noise} | ({"slope": slope} if task == "valley" else {})
    taught = made.demonstrations(task, seed, count, first=4 if new else 0, **options)
    return tuple(
        Taught(t.demonstration, [(c, c) for c in (t.changes[1:] if task == "valley" else t.changes)]) for t in taught
    )


@cache
def simulated(task: str, seed: int) -> tuple[Taught, ...]:
    """Six demonstrations from the contact simulation: three to learn from, three to follow."""
    taught, _ = staged.taught(staged.TASKS[task], count=6, seed=seed)
    return tuple(Taught(t.demonstration, [t.change]) for t in taught)


@cache
def learned(group: Callable[[int], Sequence[Taught]], seed: int, segmenter: str) -> dict:
    return policy([t.demonstration for t in group(seed)], segmenter=segmenter)


class Group:
    """Demonstrations of one kind by seed. Compares by what it makes, so that fits are kept."""

    def __init__(self, task: str, count: int = 3, noise: float = 8.0, slope: float = 45.0) -> None:
        self.task, self.count, self.noise, self.slope = task, count, noise, slope

    def __call__(self, seed: int) -> Sequence[Taught]:
        if self.task in staged.TASKS:
            return simulated(self.task, seed)[: self.count]
        return quasistatic(self.task, seed, self.count, self.noise, self.slope, False)

    def new(self, seed: int) -> Sequence[Taught]:
        if self.task in staged.TASKS:
            return simulated(self.task, seed)[3:]
        return quasistatic(self.task, seed, 3, self.noise, self.slope, True)


def seeds(task: str) -> range:
    return LATER.get(task, SEEDS)


class Row(NamedTuple):
    """A row of the offline table: right number of phases, one story, score of all, worst error of each seed."""

    right: int
    alike: int
    total: Score
    worst: list[float]


def offline(group: Group, phases: Sequence[int]) -> Row:
    right, alike, total, worst = 0, 0, NOTHING, list[float]()
    for seed in seeds(group.task):
        taught = group(seed)
        try:
            document = learned(group, seed, "wrench_hmm")
        except InputError as error:  # a refusal finds no change
            print(f"    seed {seed} refused: {error}")
            total += score([c for t in taught for c in t.changes], [])
            worst.append(np.inf)
            continue
        right += phases_of(document) in phases
        alike += one_story(document)
        rows = document["demonstrations"]
        one = sum((score(t.changes, r["boundaries"]) for t, r in zip(taught, rows, strict=True)), NOTHING)
        total += one
        worst.append(one.largest if one.missed == 0 else np.inf)
    return Row(right, alike, total, worst)


def show(name: str, row: Row) -> None:
    t, n = row.total, len(SEEDS)
    largest = f"{t.largest:.2f}"
    line(name, f"{row.right}/{n}", f"{row.alike}/{n}", f"{t.missed}/{t.changes}", t.false, largest)


HEAD = ("K right", "one story", "missed", "false", "largest [s]")


def test_boundaries_of_quasi_static_demonstrations():
    line("quasi-static, wrench_hmm", *HEAD)
    valley = {s: offline(Group("valley", slope=s), [2]) for s in (45.0, 30.0)}
    for slope, row in valley.items():
        show(f"valley {slope:.0f} degrees, 3 demonstrations", row)
    flat = {task: offline(Group(task), [2]) for task in ("ls", "hose")}
    for task, row in flat.items():
        show(f"{task}, 3 demonstrations", row)
    peg = offline(Group("peg"), [2, 3])
    show("peg, 3 demonstrations", peg)
    for task in ("valley", "ls", "hose", "peg"):
        show(
            f"hard: {task}, 15 degrees of aim noise", offline(Group(task, noise=15.0), [2, 3] if task == "peg" else [2])
        )
        show(f"hard: {task}, 2 demonstrations", offline(Group(task, count=2), [2, 3] if task == "peg" else [2]))
        show(f"hard: {task}, ONE demonstration", offline(Group(task, count=1), [2, 3] if task == "peg" else [2]))
    for row in valley.values():
        assert row.right >= 11 and row.alike == 12
        assert sum(e <= 0.10 for e in row.worst) >= 11
    for row in flat.values():
        assert row.right == 12 and row.total.false == 0 and max(row.worst) <= 0.15
    assert max(peg.worst) <= 0.20 and peg.total.false == 0


class Found(NamedTuple):
    """What docs/evidence/segmentation.md says of 12 groups of one task in contact simulation: never worse than that.

    Right number of phases, one story, changes missed, false boundaries, largest error [s], groups within 0.10 s.
    """

    right: int
    alike: int
    missed: int
    false: int
    largest: float
    quick: int


FOUND = {
    "valley 45": Found(12, 12, 0, 0, 0.11, 10),
    "valley 30": Found(12, 12, 0, 0, 0.05, 12),
    "corner": Found(12, 12, 0, 0, 0.15, 0),
    "hose coupler": Found(12, 11, 0, 1, 0.15, 0),
}


def test_boundaries_of_demonstrations_from_contact_simulation():
    line("contact simulation, wrench_hmm", *HEAD)
    rows = {}
    for task in staged.TASKS:
        rows[task] = offline(Group(task), [2])
        show(f"{task}, 3 demonstrations", rows[task])
    for task in staged.TASKS:
        show(f"hard: {task}, 2 demonstrations", offline(Group(task, count=2), [2]))
    for task, row in rows.items():
        bar(f"{task}: no change missed", row.total.missed == 0)
        bar(f"{task}: two phases in 11 of 12", row.right >= 11)
        bar(f"{task}: 0.10 s in 11 of 12", sum(e <= 0.1 for e in row.worst) >= 11)
        bar(f"{task}: largest error 0.15 s", row.total.largest <= 0.15)
        known = FOUND[task]  # each bar by itself: none hides what another has lost
        assert row.right >= known.right and row.alike >= known.alike, task
        assert row.total.missed <= known.missed and row.total.false <= known.false, task
        assert row.total.largest < known.largest + 0.005, task  # the page gives hundredths of a second
        assert sum(e <= 0.1 for e in row.worst) >= known.quick, task


def touched(demonstration: Demonstration) -> float:
    """When the tool first meets something [s]: the force of 50 ms exceeds 1.5 N and stays there for 50 ms more."""
    (cut,), _ = cut_all([demonstration], None, "base")
    loud = np.linalg.norm(cut.wrench[:, :3], axis=1) > TOUCH_N
    return cut.edges([int(np.argmax(loud[:-1] & loud[1:]))])[0]


@pytest.mark.parametrize("task", ["corner", "ls"])
def test_a_touch_down_on_a_table_is_found_in_one_demonstration(task):
    """The person lowers a box, or a tool, onto a table and goes on along it. Truth is the touch itself."""
    off, segments = [], []
    for seed in SEEDS:
        if task == "corner":
            one = staged.taught(staged.TASKS[task], count=1, seed=seed)[0][0].demonstration
        else:
            one = made.demonstrations(task, seed, 1)[0].demonstration
        (row,) = policy([one])["demonstrations"]
        off.append(min((abs(b - touched(one)) for b in row["boundaries"]), default=np.inf))
        segments.append(len(row["labels"]))
    near = sum(e <= TOUCHED_S for e in off)
    line(f"touch-down, {task}, ONE demonstration", f"{near}/{len(off)} in 0.4 s", *(f"{e:.2f}" for e in sorted(off)))
    line("    segments", *segments)
    bar(f"touch-down, {task}: all within 0.4 s", near == len(off))
    assert near >= len(off) - 1  # one demonstration of a short task may hold too little to pay for a second phase


FAMILIES = {"quasi-static": ("valley", "ls", "hose", "peg"), "contact simulation": tuple(staged.TASKS)}


@pytest.mark.parametrize("family", FAMILIES)
def test_baselines_on_the_same_demonstrations(family):
    line("baselines (missed, false of all changes)", "ours", *(name[:15] for name in BASELINES))
    misses = {}
    for task in FAMILIES[family]:
        group, ours, others = Group(task), NOTHING, dict.fromkeys(BASELINES, NOTHING)
        for seed in seeds(task):
            taught = group(seed)
            rows = learned(group, seed, "wrench_hmm")["demonstrations"]
            ours += sum((score(t.changes, r["boundaries"]) for t, r in zip(taught, rows, strict=True)), NOTHING)
            for name, cut in BASELINES.items():
                found = cut([t.demonstration for t in taught], 3 if task == "peg" else 2)
                others[name] += sum((score(t.changes, f) for t, f in zip(taught, found, strict=True)), NOTHING)
        cells = [f"{s.missed}, {s.false}" for s in (ours, *others.values())]
        line(f"{task} (of {ours.changes})", *cells)
        misses[task] = ours.missed + ours.false, {name: s.missed + s.false for name, s in others.items()}
    for baseline in set(BASELINES) - {"Gaussian HMM, K given"}:  # it is told what the others have to find
        assert sum(m[1][baseline] for m in misses.values()) > sum(m[0] for m in misses.values()), baseline


def online(group: Group, segmenter: str, by: str, moves: Sequence[Float] = ()) -> Score:
    total = NOTHING
    for seed in seeds(group.task):
        model = from_document(learned(group, seed, segmenter)["phase_model"])
        for i, (demonstration, changes) in enumerate(group.new(seed)):
            if moves:
                demonstration = replace(demonstration, position=demonstration.position + moves[i % 2])
            total += score(changes, [time for time, _ in follow(model, demonstration, by)[1:]])
    return total


FOLLOWED = {
    "valley": ((36, 0), (36, 0)), "ls": ((36, 0), (36, 0)), "hose": ((36, 0), (36, 0)), "peg": ((72, 0), (72, 0)),
    "valley 45": ((35, 1), (34, 2)), "valley 30": ((34, 0), (35, 1)), "corner": ((36, 0), (36, 0)),
    "hose coupler": ((36, 0), (30, 7)),
}  # fmt: skip
"""By docs/evidence/segmentation.md, of the filter and of the wrench gate with tables askew: changes within 0.3 s, and
switches elsewhere. Never worse than that, task by task."""


def told(s: Score) -> str:
    return f"{s.near}/{s.changes}, {s.false} f, {s.percentile(95):.2f} s"


@pytest.mark.parametrize("family", FAMILIES)
def test_following_new_demonstrations_and_the_gate_where_tables_have_moved(family):
    columns = ("filter", "wrench gate, tables askew", "pose gate, askew", "pose gate, up or down")
    print(f"{'online: within 0.3 s, false, p95':<34}" + "".join(f"{c:>28}" for c in columns))
    rows = {}
    for task in FAMILIES[family]:
        group = Group(task)
        rows[task] = (
            online(group, "wrench_hmm", "filter"), online(group, "wrench_hmm", "gate", ASKEW),
            online(group, "pose_hmm", "gate", ASKEW), online(group, "pose_hmm", "gate", UPRIGHT),
        )  # fmt: skip
        print(f"{task:<34}" + "".join(f"{told(s):>28}" for s in rows[task]), flush=True)
    gated = [rows[t] for t in ("valley", "ls", "hose") if t in rows] or list(rows.values())
    for task, (watched, wrench, pose, upright) in rows.items():
        bar(f"{task}: filter, 95 % near", watched.near >= 0.95 * watched.changes)
        bar(f"{task}: wrench gate, 90 % near", wrench.near >= 0.9 * wrench.changes)
        bar(f"{task}: filter, none false", watched.false == 0)
        for seen, (near, false) in zip((watched, wrench), FOLLOWED[task], strict=True):
            assert seen.near >= near and seen.false <= false, task
        bar(f"{task}: pose gate, askew, under 20 % near", pose.near < 0.2 * pose.changes)
        bar(f"{task}: pose gate, up or down, under 20 % near", upright.near < 0.2 * upright.changes)
    for column in (2, 3):  # all worlds together; of one world alone, a dozen seeds may be lucky
        assert sum(row[column].near for row in gated) < 0.2 * sum(row[column].changes for row in gated)


def bar(what: str, met: bool) -> bool:
    print(f"    {what}: {'met' if met else 'MISSED'}", flush=True)
    return met


HIRO = {"02": (7.08, 16.33), "10": (7.065, 16.32), "22": (5.235, 11.95)}  # contact and mating, by R_State.dat [s]


def hiro(trial: str) -> Demonstration:
    base = recordings_dir()
    if base is None or not (base / "hiro_snap_assembly").is_dir():
        pytest.skip("SKILLFRAME_RECORDINGS does not hold hiro_snap_assembly")
    folder = base / "hiro_snap_assembly" / trial
    return read_demonstration(
        folder / "R_CartPos.dat", columns="t,px,py,pz,roll,pitch,yaw", euler="xyz", wrench=folder / "worldforce.dat",
        wrench_columns="t,fx,fy,fz,tx,ty,tz",
    )  # fmt: skip


def test_the_real_snap_assembly():
    demonstrations = {trial: hiro(trial) for trial in HIRO}
    given = list(demonstrations.values())
    ours = [row["boundaries"] for row in policy(given)["demonstrations"]]
    line("snap assembly, 3 trials (missed, false)", "ours", *(name[:15] for name in BASELINES))
    cuts = [ours, *(cut(given, 5) for cut in BASELINES.values())]
    for i, (trial, changes) in enumerate(HIRO.items()):
        scores = [score([(c, c) for c in changes], found[i]) for found in cuts]
        line(f"trial {trial}", *(f"{s.missed}, {s.false}" for s in scores))
        # extra cuts that are true by the definition of an LMC: one bend in the approach, one retract that has no label
        assert scores[0].missed == 0 and scores[0].false <= (1 if trial == "22" else 3)
    model = from_document(policy([demonstrations["02"], demonstrations["22"]])["phase_model"])
    switches = follow(model, demonstrations["10"])
    line("trial 10 followed, learned from 02 and 22", *(f"{t:.2f} s: {k + 1}" for t, k in switches))
    late = [t - c for (t, _), c in zip(switches[1:], HIRO["10"], strict=True)]
    assert max(late) <= 0.45 and min(late) > 0.0  # a chatter would be a third switch


def test_the_real_wiping_is_one_phase_alike_in_all_and_no_lmc():
    base = recordings_dir()
    if base is None or not (base / "icsc_wiping").is_dir():
        pytest.skip("SKILLFRAME_RECORDINGS does not hold icsc_wiping")
    names = ("px", "py", "pz", "qx", "qy", "qz", "qw", "fx", "fy", "fz", "tx", "ty", "tz")
    w_first = {"qw": "qx", "qx": "qy", "qy": "qz", "qz": "qw"}  # what the pad's normal says that the columns hold
    for reading, order, frame in (("as labelled", {}, "base"), ("w-first, tool's axes", w_first, "tool")):
        columns = "t=t," + ",".join(f"{n}={order.get(n, n.removeprefix('p'))}" for n in names)
        wipes = [
            read_demonstration(base / "icsc_wiping" / f"rim{i}.csv", columns=columns, wrench_frame=frame)
            for i in range(3)
        ]
        document = policy(wipes)
        turning = document["phase_model"]["round"]
        for i, (one, row) in enumerate(zip(wipes, document["demonstrations"], strict=True)):
            lines = (base / "icsc_wiping" / f"rim{i}.labels.csv").read_text().split()
            by_hand = [float(one.time[int(text.split(",")[0])]) for text in lines[2:4]]
            edges = [row["start"], *row["boundaries"], row["end"]]
            (k,) = (k for k, label in enumerate(row["labels"]) if label == turning)
            found = f"{edges[k]:.2f} to {edges[k + 1]:.2f} s", f"{by_hand[0]:.2f} to {by_hand[1]:.2f} s"
            line(f"rim{i}, {reading}", "".join(str(n + 1) for n in row["labels"]), *found)
            assert edges[k] < by_hand[0] + 0.5 and edges[k + 1] > by_hand[1] - 0.5  # hand labels lead contact by that


@pytest.mark.parametrize("noise", [8.0, 15.0])
def test_wipes_of_all_kinds_are_one_phase_and_nothing_else_is(noise):
    alike, total, stray = 0, NOTHING, 0
    for seed in range(7300, 7312):
        taught = made.demonstrations("wipe", seed, noise=noise)
        document = policy([t.demonstration for t in taught])
        turning, rows = document["phase_model"].get("round"), document["demonstrations"]
        alike += all(row["labels"].count(turning) == 1 for row in rows)
        for one, row in zip(taught, rows, strict=True):
            total += score([(c, c) for c in one.changes], row["boundaries"])
        for task in ("valley", "ls", "hose", "peg"):
            one_task = made.demonstrations(task, seed, noise=noise)
            stray += "round" in policy([t.demonstration for t in one_task])["phase_model"]
    missed = f"{total.missed}/{total.changes}"
    line(f"wipes, {noise:.0f} degrees", f"{alike}/12", missed, total.false, f"{total.largest:.2f}")
    line("    other tasks with a round", f"{stray}/48")
    assert alike >= 11 and stray == 0

"""The acceptance figures of the segmenter over fresh seeds, beside all baselines; `pytest -s -m figures` prints them.

Boundaries are judged within windows of 50 ms: missed beyond 0.30 s, false beyond 0.35 s (see `tests.figures.phases`).
Seeds were used for nothing else. What is asserted are the bars that are called reachable; rows marked "hard" are shown.
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

from skillframe.demonstration.files import read_demonstration
from skillframe.demonstration.record import Demonstration
from skillframe.errors import InputError
from skillframe.paths import recordings_dir
from tests.figures import quasistatic as made
from tests.figures import staged
from tests.figures.phase_baselines import BASELINES
from tests.figures.phases import NOTHING, Interval, Score, one_story, phases_of, policy, score

pytestmark = [pytest.mark.figures, pytest.mark.needs_plugins]
SEEDS = range(3000, 3012)
MOVES = tuple(0.03 * np.array(s) for s in ((1.0, -1.0, 1.0), (-1.0, 1.0, -1.0)))


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
    """Demonstrations of one kind by seed; compares by what it makes, so that fits are kept."""

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


class Row(NamedTuple):
    """A row of the offline table: right number of phases, one story, score of all, worst error of each seed."""

    right: int
    alike: int
    total: Score
    worst: list[float]


def offline(group: Group, phases: Sequence[int]) -> Row:
    right, alike, total, worst = 0, 0, NOTHING, list[float]()
    for seed in SEEDS:
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


def test_boundaries_of_demonstrations_from_contact_simulation():
    line("contact simulation, wrench_hmm", *HEAD)
    rows = {}
    for task in staged.TASKS:
        rows[task] = offline(Group(task), [2])
        show(f"{task}, 3 demonstrations", rows[task])
    for task in staged.TASKS:
        show(f"hard: {task}, 2 demonstrations", offline(Group(task, count=2), [2]))
    touch = offline(Group("corner", count=1), [2])
    show("touch-down on a table, ONE demonstration", touch)
    for task in ("valley 45", "valley 30"):
        assert rows[task].right >= 11 and rows[task].total.missed == 0
        assert sum(e <= 0.10 for e in rows[task].worst) >= 11
    # 12 of 12 without a false one is met by the quasi-static tasks; here one seed in twelve may show a phase more
    for task in ("corner", "hose coupler"):
        assert rows[task].right >= 10 and rows[task].total.missed == 0 and rows[task].total.largest <= 0.15
    assert sum(e <= 0.40 for e in touch.worst) >= 11


FAMILIES = {"quasi-static": ("valley", "ls", "hose", "peg"), "contact simulation": tuple(staged.TASKS)}


@pytest.mark.parametrize("family", FAMILIES)
def test_baselines_on_the_same_demonstrations(family):
    line("baselines (missed, false of all changes)", "ours", *(name[:15] for name in BASELINES))
    misses = {}
    for task in FAMILIES[family]:
        group, ours, others = Group(task), NOTHING, dict.fromkeys(BASELINES, NOTHING)
        for seed in SEEDS:
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


def online(group: Group, segmenter: str, by: str, moved: bool) -> Score:
    total = NOTHING
    for seed in SEEDS:
        model = from_document(learned(group, seed, segmenter)["phase_model"])
        for i, (demonstration, changes) in enumerate(group.new(seed)):
            if moved:
                demonstration = replace(demonstration, position=demonstration.position + MOVES[i % 2])
            total += score(changes, [time for time, _ in follow(model, demonstration, by)[1:]])
    return total


def told(s: Score) -> str:
    return f"{s.near}/{s.changes}, {s.false} f, {s.percentile(95):.2f} s"


@pytest.mark.parametrize("family", FAMILIES)
def test_following_new_demonstrations_and_the_gate_where_tables_have_moved(family):
    line("online: within 0.3 s, false, p95", "filter", "wrench gate", "pose gate")
    rows = {}
    for task in FAMILIES[family]:
        group = Group(task)
        rows[task] = (
            online(group, "wrench_hmm", "filter", False), online(group, "wrench_hmm", "gate", True),
            online(group, "pose_hmm", "gate", True),
        )  # fmt: skip
        print(f"{task:<24}" + "".join(f"{told(s):>26}" for s in rows[task]), flush=True)
    gated = [rows[t] for t in ("valley", "ls", "hose") if t in rows] or list(rows.values())
    for task, (watched, wrench, pose) in rows.items():
        bar(f"{task}: filter, 95 % near and none false", watched.near >= 0.95 * watched.changes and watched.false == 0)
        bar(f"{task}: wrench gate, 90 % near", wrench.near >= 0.9 * wrench.changes)
        bar(f"{task}: pose gate, under 20 % near", pose.near < 0.2 * pose.changes)
    for watched, wrench, _ in gated:
        assert watched.near >= 0.95 * watched.changes
        assert wrench.near >= 0.9 * wrench.changes
    # the turn of the coupler is a change of pose itself, wherever the coupler stands: by itself it may exceed 20 %
    assert sum(pose.near for *_, pose in gated) < 0.2 * sum(pose.changes for *_, pose in gated)


def bar(what: str, met: bool) -> None:
    print(f"    {what}: {'met' if met else 'MISSED'}", flush=True)


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


def test_the_real_wiping_is_shown_and_not_gated():
    base = recordings_dir()
    if base is None or not (base / "icsc_wiping").is_dir():
        pytest.skip("SKILLFRAME_RECORDINGS does not hold icsc_wiping")
    names = ("px", "py", "pz", "qx", "qy", "qz", "qw", "fx", "fy", "fz", "tx", "ty", "tz")
    columns = "t=t," + ",".join(f"{n}={n.removeprefix('p')}" for n in names)
    wipes = [read_demonstration(base / "icsc_wiping" / f"rim{i}.csv", columns=columns) for i in range(3)]
    for phases in (None, 6):
        for i, row in enumerate(policy(wipes, phases=phases)["demonstrations"]):
            line(f"wiping rim{i}, phases {phases or 'found'}", "".join(str(k + 1) for k in row["labels"]))

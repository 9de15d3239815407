"""Rows 17 and 18 of the papers' results: phases followed online in new demonstrations, beside poses and a clock.

Like against like: wrench and pose each drive the gate as a softmax or as normal densities, and each drive the filter,
which takes the motion as evidence, too. The null is a clock: the phase changes as long after the start as it did in the
demonstrations, in the mean. Changes of one policy stand or fall together, so counts are of policies.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from skillframe_segmenter import gate, pose_gate
from skillframe_segmenter.model import PhaseModel, from_document
from skillframe_segmenter.observer import drive_of, follow
from skillframe_segmenter.settings import WINDOW_S
from skillframe_segmenter.windows import windows

from skillframe.extend.records import Document, RowResult, RowRun, Verdict
from skillframe.frames import Float
from skillframe_papers.bars import ahead, counted, judged, together, undecided
from skillframe_papers.rows.phases import (
    EACH,
    MOST,
    NEAR_S,
    SEED,
    TASKS,
    Key,
    Taught,
    demonstrated,
    groups_of,
    key_of,
    late_by,
    policies_of,
)

FAR_S = 0.35
QUICK_MOVED, QUICK_PACED = ("corner",), ("hose coupler",)
CLOCK = "a clock"
SLOW, FAST = 0.75, 1.5
"""Pace of the people who show what is followed in row 18 over that of those who taught, so that no clock can do it."""


class Followed(NamedTuple):
    """What became of new demonstrations, by policy: all followed within 0.3 s without a switch elsewhere?

    Attributes:
        whole: by policy.
        near: changes followed within 0.3 s; changes: of how many; false: switches elsewhere.
        delays: of those followed [s].
    """

    whole: list[bool]
    near: int
    changes: int
    false: int
    delays: list[float]

    @property
    def good(self) -> int:
        """Policies that made no mistake."""
        return sum(self.whole)


def _followed(times: Sequence[Sequence[Sequence[float]]], taught: Sequence[Taught]) -> Followed:
    """Times of switches, by policy and demonstration, against the true changes."""
    whole, near, false, delays = [], 0, 0, list[float]()
    for i, policy in enumerate(times):
        mistakes = 0
        for switches, each in zip(policy, taught[EACH * i : EACH * (i + 1)], strict=True):
            off = [late_by(time, each.change) for time in switches]
            nearest = min(off, key=abs, default=np.inf)
            if abs(nearest) <= NEAR_S:
                near += 1
                delays.append(nearest)
            elsewhere = sum(abs(o) > FAR_S for o in off)
            false, mistakes = false + elsewhere, mistakes + elsewhere + (abs(nearest) > NEAR_S)
        whole.append(mistakes == 0)
    return Followed(whole, near, EACH * len(times), false, delays)


def _switches(models: Sequence[PhaseModel], taught: Sequence[Taught], by: str) -> list[list[list[float]]]:
    return [
        [[time for time, _ in follow(model, t.demonstration, by)[1:]] for t in taught[EACH * i : EACH * (i + 1)]]
        for i, model in enumerate(models)
    ]


def _clock(given: Sequence[Taught], taught: Sequence[Taught]) -> list[list[list[float]]]:
    """As long after the start as the change was in a policy's own demonstrations, in the mean."""
    found = []
    for i in range(len(given) // EACH):
        own, new = given[EACH * i : EACH * (i + 1)], taught[EACH * i : EACH * (i + 1)]
        after = float(np.mean([np.mean(t.change) - t.demonstration.time[0] for t in own]))
        found.append([[float(t.demonstration.time[0]) + after] for t in new])
    return found


def _otherwise(policy: Document, given: Sequence[Taught]) -> PhaseModel:
    """The policy's model with its gate of the other kind: densities of poses, or a softmax of wrenches."""
    model = from_document(policy["phase_model"])
    drive, posterior, paths = list[Float](), list[Float](), []
    for row, each in zip(policy["demonstrations"], given, strict=True):
        cut = windows(each.demonstration, model.at, model.axes)
        middle = cut.start + WINDOW_S * (np.arange(cut.size) + 0.5)
        path = np.array(row["labels"])[np.searchsorted(row["boundaries"], middle)].astype(np.intp)
        drive.append(drive_of(model, cut))
        posterior.append(np.eye(model.count)[path])
        paths.append(path)
    kind = pose_gate if model.origin is None else gate
    first = np.eye(model.count)[int(paths[0][0])]
    return replace(
        model, phase_of=np.arange(model.count), initial=first, gate=kind.fit(drive, np.concatenate(posterior), paths)
    )


class Gates(NamedTuple):
    """Models of a world's policies, by what drives them and how."""

    wrench: list[PhaseModel]
    wrench_softmax: list[PhaseModel]
    pose: list[PhaseModel]
    pose_densities: list[PhaseModel]


def _gates(key: Key, seed: int, groups: int, name: str) -> Gates:
    given = demonstrated(key, seed, groups * EACH, name)
    shares = [given[EACH * i : EACH * (i + 1)] for i in range(groups)]
    wrench, pose = (policies_of(key, seed, groups, name, kind) for kind in ("wrench_hmm", "pose_hmm"))
    plain = [[from_document(p["phase_model"]) for p in policies] for policies in (wrench, pose)]
    other = [[_otherwise(p, s) for p, s in zip(policies, shares, strict=True)] for policies in (wrench, pose)]
    return Gates(plain[0], other[0], plain[1], other[1])


def _half(job: RowRun, groups: int) -> int:
    """How many new demonstrations are of the first kind: half of them, in a quick run none."""
    return 0 if job.quick else EACH * ((groups + 1) // 2)


def moved(job: RowRun) -> RowResult:
    """Row 17: transitions when the table has moved."""
    groups, key, seed = groups_of(job), key_of(job), SEED + job.seed
    shift, rows, told = float(job.settings["table.moved"]), list[tuple[str, ...]](), list[str]()
    shares, beside = list[Verdict](), True
    for name in QUICK_MOVED if job.quick else TASKS:
        half = _half(job, groups)
        up = demonstrated(key, seed + 1, half, name, shift)
        new = [*up, *demonstrated(key, seed + 2, groups * EACH - half, name, -shift)]
        gates = _gates(key, seed, groups, name)
        found = {
            "wrench, densities (ours)": _followed(_switches(gates.wrench, new, "gate"), new),
            "wrench, softmax": _followed(_switches(gates.wrench_softmax, new, "gate"), new),
            "pose, densities": _followed(_switches(gates.pose_densities, new, "gate"), new),
            "pose, softmax (as published)": _followed(_switches(gates.pose, new, "gate"), new),
            "wrench and motion": _followed(_switches(gates.wrench, new, "filter"), new),
            "pose and motion": _followed(_switches(gates.pose, new, "filter"), new),
            CLOCK: _followed(_clock(demonstrated(key, seed, groups * EACH, name), new), new),
        }
        ours, *_ = found.values()
        others = [found[n] for n in ("pose, densities", "pose, softmax (as published)")]
        beside = beside and all(ahead(ours.near, o.near, ours.changes, quick=job.quick) for o in others)
        shares.append(judged(ours.near, ours.changes, MOST, quick=job.quick))
        rows += [(name, drive, counted(f.near, f.changes), str(f.false), f"{f.good} of {len(f.whole)}")
                 for drive, f in found.items()]  # fmt: skip
        told.append(f"{name} {ours.near} of {ours.changes}, pose {others[0].near} and {others[1].near}")
        job.tell(told[-1])
    return RowResult(
        ours=f"within 0.3 s, wrench, then pose with densities and softmax: {'; '.join(told)}",
        verdict=together(shares, beside), rows=rows,
        head=("world", "transitions driven by", "within 0.3 s", "switches elsewhere", "policies without a mistake"),
        difference="Nulls: the pose with either evidence; a clock is shown. Where the motion is evidence, too, the "
        "pose does as the table says. While a robot runs a policy its motion is no evidence: the phase chooses it. The "
        "coupler is held at its flange by a hand that is soft in rotation, so its wrench is the hand's push.",
    )  # fmt: skip


def online(job: RowRun) -> RowResult:
    """Row 18: phases followed online."""
    groups, key, seed = groups_of(job), key_of(job), SEED + job.seed
    rows, all_of, clock = list[tuple[str, ...]](), list[Followed](), 0
    for name in QUICK_PACED if job.quick else TASKS:
        half = _half(job, groups)
        new = demonstrated(key, seed + 3, half, name, 0.0, SLOW)
        new = (*new, *demonstrated(key, seed + 4, groups * EACH - half, name, 0.0, FAST))
        models = [from_document(p["phase_model"]) for p in policies_of(key, seed, groups, name)]
        done = _followed(_switches(models, new, "filter"), new)
        null = _followed(_clock(demonstrated(key, seed, groups * EACH, name), new), new)
        all_of, clock = [*all_of, done], clock + null.good
        for drive, f in (("the filter", done), (CLOCK, null)):
            late = f"{np.percentile(f.delays, 95):.2f} s" if f.delays else "-"
            rows.append((name, drive, f"{f.good} of {len(f.whole)}", counted(f.near, f.changes), late, str(f.false)))
    good, count = sum(f.good for f in all_of), sum(len(f.whole) for f in all_of)
    near, changes, false = (sum(values) for values in zip(*((f.near, f.changes, f.false) for f in all_of), strict=True))
    return RowResult(
        ours=f"{counted(good, count)} policies without a mistake; {near} of {changes} changes within 0.3 s, {false} "
        f"switches elsewhere; a clock: {clock} of {count} policies",
        verdict=together([judged(good, count, MOST, quick=job.quick)], ahead(good, clock, count, quick=job.quick)),
        rows=rows,
        head=("world", "followed by", "policies without a mistake", "changes within 0.3 s", "95 % are at most late by",
              "switches elsewhere"),
        difference=f"Null: a clock. New people are {SLOW:g} or {FAST:g} times as fast (quick: {FAST:g}). "
        + undecided(good, count, MOST, quick=job.quick),
        values={"share": good / count, "elsewhere": float(false)},
    )  # fmt: skip

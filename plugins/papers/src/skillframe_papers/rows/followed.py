"""Rows 17 and 18: phases followed online in new demonstrations, against poses and a clock.

Wrench and pose each drive the gate, as a softmax or as normal densities, and the filter, which also uses motion. The
null is a clock: mean time of the change in the demonstrations. Changes of one policy are correlated, so policies are
counted.
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

from skillframe.extend import Document, RowResult, RowRun
from skillframe.frames import Float
from skillframe_papers.bars import undecided
from skillframe_papers.rows.harness import SHARE, Ran, compared, key_of, leads
from skillframe_papers.rows.phases import (
    EACH,
    NEAR_S,
    SEED,
    TASKS,
    Taught,
    demonstrated,
    groups_of,
    late_by,
    policies_of,
)

CLOCK = "a clock"
SLOW, FAST = 0.75, 1.5
"""Paces of the followed teachers in row 18 over the demonstrated one, which no clock can follow."""


class Followed(NamedTuple):
    """Result of new demonstrations by policy.

    Attributes:
        whole: by policy, whether all were followed within 0.3 s without a switch elsewhere.
        near: by change, whether it was followed within 0.3 s; false: switches elsewhere.
        delays: of those followed [s].
    """

    whole: Ran
    near: Ran
    false: int
    delays: list[float]


def compared_to_truth(times: Sequence[Sequence[Sequence[float]]], taught: Sequence[Taught]) -> Followed:
    """Switches by policy and demonstration against the true changes, where more than 0.35 s off is elsewhere."""
    whole, near, false, delays = list[bool](), list[bool](), 0, list[float]()
    for i, policy in enumerate(times):
        mistakes = 0
        for switches, each in zip(policy, taught[EACH * i : EACH * (i + 1)], strict=True):
            off = [late_by(time, each.change) for time in switches]
            nearest = min(off, key=abs, default=np.inf)
            near.append(abs(nearest) <= NEAR_S)
            delays += [nearest] * near[-1]
            elsewhere = sum(abs(o) > 0.35 for o in off)
            false, mistakes = false + elsewhere, mistakes + elsewhere + (not near[-1])
        whole.append(mistakes == 0)
    return Followed(Ran(np.array(whole)), Ran(np.array(near)), false, delays)


def _switches(models: Sequence[PhaseModel], taught: Sequence[Taught], by: str) -> list[list[list[float]]]:
    return [
        [[time for time, _ in follow(model, t.demonstration, by)[1:]] for t in taught[EACH * i : EACH * (i + 1)]]
        for i, model in enumerate(models)
    ]


def clock(given: Sequence[Taught], taught: Sequence[Taught]) -> list[list[list[float]]]:
    """Switches of the null, as long after the start as the mean change in a policy's own demonstrations."""
    found = []
    for i in range(len(given) // EACH):
        own, new = given[EACH * i : EACH * (i + 1)], taught[EACH * i : EACH * (i + 1)]
        after = float(np.mean([np.mean(t.change) - t.demonstration.time[0] for t in own]))
        found.append([[float(t.demonstration.time[0]) + after] for t in new])
    return found


def _otherwise(policy: Document, given: Sequence[Taught]) -> PhaseModel:
    """The policy's model with the other kind of gate: densities of poses, or a softmax of wrenches."""
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
    """Models of a world's policies, by driving signal and form."""

    wrench: list[PhaseModel]
    wrench_softmax: list[PhaseModel]
    pose: list[PhaseModel]
    pose_densities: list[PhaseModel]


def _half(job: RowRun, groups: int) -> int:
    """New demonstrations of the first kind: half, none in a quick run."""
    return 0 if job.quick else EACH * ((groups + 1) // 2)


def moved(job: RowRun) -> RowResult:
    """Row 17: transitions when the table has moved."""
    groups, key, seed = groups_of(job), key_of(job), SEED + job.seed
    shift, rows, told = float(job.settings["table.moved"]), list[tuple[str, ...]](), list[str]()
    all_ours, beside = list[Ran](), True
    for name in ("corner",) if job.quick else TASKS:
        half = _half(job, groups)
        up = demonstrated(key, seed + 1, half, name, shift)
        new = [*up, *demonstrated(key, seed + 2, groups * EACH - half, name, -shift)]
        given = demonstrated(key, seed, groups * EACH, name)
        shares = [given[EACH * i : EACH * (i + 1)] for i in range(groups)]
        wrench, pose = (policies_of(key, seed, groups, name, kind) for kind in ("wrench_hmm", "pose_hmm"))
        plain = [[from_document(p["phase_model"]) for p in policies] for policies in (wrench, pose)]
        other = [[_otherwise(p, s) for p, s in zip(policies, shares, strict=True)] for policies in (wrench, pose)]
        gates = Gates(plain[0], other[0], plain[1], other[1])
        found = {
            "wrench, densities (ours)": compared_to_truth(_switches(gates.wrench, new, "gate"), new),
            "wrench, softmax": compared_to_truth(_switches(gates.wrench_softmax, new, "gate"), new),
            "pose, densities": compared_to_truth(_switches(gates.pose_densities, new, "gate"), new),
            "pose, softmax (as published)": compared_to_truth(_switches(gates.pose, new, "gate"), new),
            "wrench and motion": compared_to_truth(_switches(gates.wrench, new, "filter"), new),
            "pose and motion": compared_to_truth(_switches(gates.pose, new, "filter"), new),
            CLOCK: compared_to_truth(clock(demonstrated(key, seed, groups * EACH, name), new), new),
        }
        ours = found["wrench, densities (ours)"].near
        others = [found[n].near for n in ("pose, densities", "pose, softmax (as published)")]
        beside = beside and all(leads(job, ours, other) for other in others)
        all_ours.append(ours)
        rows += [(name, drive, str(f.near), str(f.false), f"{f.whole.hits} of {f.whole.trials}")
                 for drive, f in found.items()]  # fmt: skip
        told.append(f"{name} {ours.hits} of {ours.trials}, pose {others[0].hits} and {others[1].hits}")
        job.tell(told[-1])
    return RowResult(
        ours=f"within 0.3 s, wrench, then pose with densities and softmax: {'; '.join(told)}",
        verdict=compared(job, all_ours, beside), rows=rows,
        head=("world", "transitions driven by", "within 0.3 s", "switches elsewhere", "policies without a mistake"),
        difference="Nulls: the pose with either evidence; a clock is shown. Where the motion is evidence, too, the "
        "pose does as the table says. While a robot runs a policy its motion is no evidence: the phase chooses it. The "
        "coupler is held at its flange by a hand that is soft in rotation, so its wrench is the hand's push.",
    )  # fmt: skip


def online(job: RowRun) -> RowResult:
    """Row 18: phases followed online."""
    groups, key, seed = groups_of(job), key_of(job), SEED + job.seed
    rows, done, null = list[tuple[str, ...]](), list[Followed](), 0
    for name in ("hose coupler",) if job.quick else TASKS:
        half = _half(job, groups)
        new = demonstrated(key, seed + 3, half, name, 0.0, SLOW)
        new = (*new, *demonstrated(key, seed + 4, groups * EACH - half, name, 0.0, FAST))
        models = [from_document(p["phase_model"]) for p in policies_of(key, seed, groups, name)]
        done.append(compared_to_truth(_switches(models, new, "filter"), new))
        by_clock = compared_to_truth(clock(demonstrated(key, seed, groups * EACH, name), new), new)
        null += by_clock.whole.hits
        for drive, f in (("the filter", done[-1]), (CLOCK, by_clock)):
            late = f"{np.percentile(f.delays, 95):.2f} s" if f.delays else "-"
            whole = f"{f.whole.hits} of {f.whole.trials}"
            rows.append((name, drive, whole, str(f.near), late, str(f.false)))
    good, near = (Ran(np.concatenate([getattr(f, part).success for f in done])) for part in ("whole", "near"))
    false = sum(f.false for f in done)
    return RowResult(
        ours=f"{good} policies without a mistake; {near.hits} of {near.trials} changes within 0.3 s, {false} "
        f"switches elsewhere; a clock: {null} of {good.trials} policies",
        verdict=compared(job, [good], leads(job, good, Ran.of(null, good.trials))),
        rows=rows,
        head=("world", "followed by", "policies without a mistake", "changes within 0.3 s", "95 % are at most late by",
              "switches elsewhere"),
        difference=f"Null: a clock. New people are {SLOW:g} or {FAST:g} times as fast (quick: {FAST:g}). "
        + undecided(good.hits, good.trials, SHARE, quick=job.quick),
        values={"share": good.share, "elsewhere": float(false)},
    )  # fmt: skip

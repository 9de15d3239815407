"""Row 26 of the papers' results: changes of phase cut by the phase model, by stops and by a threshold of force."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from skillframe.extend.records import Document, RowResult, RowRun, Verdict
from skillframe.extend.registry import registry
from skillframe_papers.bars import ahead, counted, judged, together
from skillframe_papers.rows.phases import (
    EACH,
    MOST,
    NEAR_S,
    SEED,
    TASKS,
    Taught,
    demonstrated,
    groups_of,
    key_of,
    late_by,
    policies_of,
)


class Rule(NamedTuple):
    """What a way of cutting finds: changes within 0.3 s, of how many, and cuts elsewhere."""

    near: int
    changes: int
    false: int


def _cut(groups: Sequence[Sequence[Taught]], segmenter: str, **settings: float) -> Rule:
    """Changes that a segmenter finds."""
    fit = registry().segmenter(segmenter).fit
    near = changes = false = 0
    for group in groups:
        rows = fit([t.demonstration for t in group], None, settings)["demonstrations"]
        for row, each in zip(rows, group, strict=True):
            off = [abs(late_by(time, each.change)) for time in row["boundaries"]]
            near += min(off, default=np.inf) <= NEAR_S
            false += sum(o > NEAR_S for o in off)
            changes += 1
    return Rule(near, changes, false)


def _ours(policies: Sequence[Document], taught: Sequence[Taught]) -> Rule:
    """Changes that policies found in their own demonstrations."""
    rows = [row for policy in policies for row in policy["demonstrations"]]
    off = [[abs(late_by(t, each.change)) for t in row["boundaries"]] for row, each in zip(rows, taught, strict=True)]
    near = sum(min(each, default=np.inf) <= NEAR_S for each in off)
    return Rule(near, len(off), sum(o > NEAR_S for each in off for o in each))


RULES: dict[str, dict[str, float]] = {"stops": {}, "stops and a force of 5 N": {"force_n": 5.0}}


def rules(job: RowRun) -> RowResult:
    """Row 26: changes found by the phase model and by plain rules."""
    rows, told, shares, beside = list[tuple[str, ...]](), list[str](), list[Verdict](), True
    for name in TASKS:
        taught = demonstrated(key_of(job), SEED + job.seed, groups_of(job) * EACH, name)
        groups = [taught[EACH * i : EACH * (i + 1)] for i in range(groups_of(job))]
        ours = _ours(policies_of(key_of(job), SEED + job.seed, groups_of(job), name), taught)
        others = {rule: _cut(groups, "zvc", **settings) for rule, settings in RULES.items()}
        for method, each in {"phase model": ours, **others}.items():
            rows.append((name, method, counted(each.near, each.changes), str(each.false)))
        beside = beside and all(ahead(ours.near, each.near, each.changes, quick=job.quick) for each in others.values())
        shares.append(judged(ours.near, ours.changes, MOST, quick=job.quick))
        told.append(f"{name} {ours.near} of {ours.changes}, {' and '.join(str(o.near) for o in others.values())}")
    return RowResult(
        ours=f"changes within 0.3 s, the phase model, then {' and '.join(RULES)}: {'; '.join(told)}",
        verdict=together(shares, beside), head=("world", "cut by", "within 0.3 s", "cuts elsewhere"), rows=rows,
        difference="The rules are the nulls. A simulated person does not stop between two stages; one who does is "
        "easier to cut.",
    )  # fmt: skip

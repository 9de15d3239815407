"""Row 14: how many blind demonstrations a search needs.

Five teachers know that the hole lies 6 mm from the start, each in another direction, which only their demonstrations
show. Searches from few and from ten demonstrations of a teacher get the same goals, planned for 7 s. Null: taught by
somebody who believes that the hole is at the start.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import cos, pi, sin

import numpy as np
from skillframe_search.trials import NOBODY_KNEW, Task, demonstrations, document, goals

from skillframe.extend import RowResult, RowRun
from skillframe_papers.bars import together
from skillframe_papers.rows.harness import Ran, compared, leads
from skillframe_papers.rows.search import EARLY_S, SHIFT, off_centre, searched

PEOPLE, GOALS = 5, 16
FEW, MANY = 3, 10  # demonstrations
NULL = f"from {FEW} of a teacher who does not know"


def _task(job: RowRun, centre: tuple[float, float, float]) -> Task:
    params = (("fillet", job.settings["world.fillet"]), ("friction", job.settings["world.friction"]))
    return Task("peg_in_hole", params, (0.004, 0.004, 0.0), centre)


def believed(index: int) -> tuple[float, float, float]:
    """Hole believed by teacher `index`, from the start [m, m, rad], the first as in row 23."""
    angle = 2.0 * pi * index / PEOPLE
    return (SHIFT[0] * cos(angle), SHIFT[0] * sin(angle), 0.0)


def few(job: RowRun) -> RowResult:
    """Row 14: goals found, over the number of demonstrations."""
    if job.quick:  # the first teacher's three demonstrations alone, on the goals of row 23
        done = off_centre(job)
        few_shown, unknown = done["samples, tour"].seconds, done["not given"].seconds
        hits = {f"from {FEW}": [int((few_shown <= EARLY_S).sum())], NULL: [int((unknown <= EARLY_S).sum())]}
        return result(job, hits, len(unknown))
    counts, seed, time = (1, FEW, MANY), 1 + job.seed, min(EARLY_S, float(job.settings["time"]))
    settings = {key: job.settings[key] for key in ("push", "speed", "stiffness")}
    unknowing = demonstrations(_task(job, NOBODY_KNEW), FEW * PEOPLE, seed)
    found = {name: list[int]() for name in (*(f"from {n}" for n in counts), NULL)}
    for k in range(PEOPLE):
        task = _task(job, believed(k))
        own, where = demonstrations(task, MANY, seed), goals(GOALS, task, 66_000 + 1000 * job.seed + k)
        taught = [*(own[:n] for n in counts), unknowing[FEW * k : FEW * (k + 1)]]
        learned = [document(task, each, time=time, algorithm="sampling", **settings) for each in taught]
        seconds = searched(task.scene, [(each, where) for each in learned], duration_s=time, seed=5 + job.seed)
        for hits_of_one, each in zip(found.values(), seconds, strict=True):
            hits_of_one.append(int(np.isfinite(each).sum()))
        job.tell(f"person {k}: {', '.join(f'{name} {hits[-1]}' for name, hits in found.items())} of {GOALS}")
    return result(job, found, GOALS * PEOPLE)


def result(job: RowRun, found: Mapping[str, list[int]], count: int) -> RowResult:
    """Row 14 of goals found by every teacher's search, by number of demonstrations."""
    hits = {name: Ran.of(sum(values), count) for name, values in found.items()}
    ours, null, many = hits[f"from {FEW}"], hits[NULL], hits.get(f"from {MANY}")
    beside = leads(job, ours, null)  # few must find 0.9 of the goals that many find
    return RowResult(
        ours=f"{ours} holes found in {EARLY_S:g} s from {FEW} demonstrations"
        + ("" if many is None else f", {many.hits} from {MANY}")
        + f"; null, from {FEW} of a teacher who does not know: {null.hits}",
        verdict=together([], beside) if many is None else compared(job, [ours], beside, 0.9 * many.hits / count),
        head=("search learned", f"found in {EARLY_S:g} s", "by teacher"),
        rows=[(name, str(hits[name]), ", ".join(map(str, each))) for name, each in found.items()],
        difference="The paper gives no number. Each number of demonstrations is one choice of "
        "them a teacher, the first ones, so that counts of one teacher are less apart than their intervals say.",
        values={name.replace(" ", "_"): each.share for name, each in hits.items() if name != NULL}
        | {"null": null.share},
    )  # fmt: skip

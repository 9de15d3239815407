"""Row 14 of the papers' results: how many blind demonstrations a search needs.

Five people believe that the hole lies 6 mm from where a search starts, each in a direction of his own, and it does.
Nothing but their demonstrations tells the direction. Searches learned from a few of one person's demonstrations stand
beside those learned from ten of the same person, on the same goals, planned for 7 s. The null is the same method,
taught as often by somebody who believes that the hole lies at the start.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import cos, pi, sin
from typing import NamedTuple

import numpy as np
from skillframe_search.trials import NOBODY_KNEW, Task, demonstrations, document, goals

from skillframe.demonstration.record import Demonstration
from skillframe.extend.records import RowResult, RowRun
from skillframe.frames import Float
from skillframe_papers.bars import ahead, counted, judged, together
from skillframe_papers.rows.search import EARLY_S, SHIFT, off_centre, searched

PEOPLE, GOALS = 5, 16
ONE, FEW, MANY = 1, 3, 10
GOAL_SEED = 66_000
KEPT = 0.9
"""Of what many demonstrations find, a few must find as much."""
NULL = f"from {FEW} of somebody who does not know"


class Given(NamedTuple):
    """A person's task, his demonstrations, and as many as a few of somebody who does not know."""

    task: Task
    own: tuple[Demonstration, ...]
    unknowing: tuple[Demonstration, ...]


def _task(job: RowRun, centre: tuple[float, float, float]) -> Task:
    params = (("fillet", job.settings["world.fillet"]), ("friction", job.settings["world.friction"]))
    return Task("peg_in_hole", params, (0.004, 0.004, 0.0), centre)


def believed(index: int) -> tuple[float, float, float]:
    """Where person `index` believes the hole to be, from the start [m, m, rad]: the first where row 23's does."""
    angle = 2.0 * pi * index / PEOPLE
    return (SHIFT[0] * cos(angle), SHIFT[0] * sin(angle), 0.0)


def _people(job: RowRun) -> list[Given]:
    seed = 1 + job.seed
    unknowing = demonstrations(_task(job, NOBODY_KNEW), FEW * PEOPLE, seed)
    tasks = [_task(job, believed(k)) for k in range(PEOPLE)]
    return [
        Given(task, demonstrations(task, MANY, seed), unknowing[FEW * k : FEW * (k + 1)])
        for k, task in enumerate(tasks)
    ]


def _found(job: RowRun, given: Given, taught: Sequence[tuple[Demonstration, ...]], where: Float) -> list[int]:
    """Goals that searches find in time, each learned from some demonstrations."""
    settings = {key: job.settings[key] for key in ("push", "speed", "stiffness")}
    time = min(EARLY_S, float(job.settings["time"]))
    learned = [document("search", given.task, each, time=time, algorithm="sampling", **settings) for each in taught]
    found = searched(given.task.scene, [(each, where) for each in learned], duration_s=time, seed=5 + job.seed)
    return [int(np.isfinite(seconds).sum()) for seconds in found]


def few(job: RowRun) -> RowResult:
    """Row 14: goals found, over the number of demonstrations."""
    if job.quick:
        return _quick(job)
    counts = (ONE, FEW, MANY)
    found = {name: list[int]() for name in (*(f"from {n}" for n in counts), NULL)}
    for k, given in enumerate(_people(job)):
        where = goals(GOALS, given.task, GOAL_SEED + 1000 * job.seed + k)
        hits = _found(job, given, [*(given.own[:n] for n in counts), given.unknowing], where)
        for own, each_found in zip(found.values(), hits, strict=True):
            own.append(each_found)
        job.tell(f"person {k}: {', '.join(f'{name} {hits[-1]}' for name, hits in found.items())} of {GOALS}")
    return _told(job, found, MANY, GOALS * PEOPLE)


def _quick(job: RowRun) -> RowResult:
    """The first person's three demonstrations alone, on the goals of row 23, whose searches these are."""
    done = off_centre(job)
    found = {f"from {FEW}": done["samples, tour"], NULL: done["not told"]}
    hits = {name: [int((each.seconds <= EARLY_S).sum())] for name, each in found.items()}
    return _told(job, hits, None, len(done["not told"].seconds))


def _told(job: RowRun, found: Mapping[str, list[int]], most: int | None, count: int) -> RowResult:
    """The row, from goals found by each person's searches. `most`: demonstrations that a few are beside, if any are."""
    hits = {name: sum(values) for name, values in found.items()}
    ours, null = hits[f"from {FEW}"], hits[NULL]
    many = None if most is None else hits[f"from {most}"]
    enough = [] if many is None else [judged(ours, count, KEPT * many / count, quick=job.quick)]
    return RowResult(
        ours=f"{counted(ours, count)} holes found in {EARLY_S:g} s from {FEW} demonstrations"
        + ("" if many is None else f", {many} from {most}")
        + f"; null, from {FEW} of somebody who does not know: {null}",
        verdict=together(enough, ahead(ours, null, count, quick=job.quick)),
        head=("search learned", f"found in {EARLY_S:g} s", "by person"),
        rows=[(name, counted(hits[name], count), ", ".join(map(str, each))) for name, each in found.items()],
        difference="The paper gives no number. Each number of demonstrations is one choice of "
        "them a person, the first ones, so that counts of one person are less apart than their intervals say.",
        values={name.replace(" ", "_"): value / count for name, value in hits.items() if name != NULL}
        | {"null": null / count},
    )  # fmt: skip

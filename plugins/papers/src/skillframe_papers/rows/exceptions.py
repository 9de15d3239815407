"""Row 35 of the papers' results: a search that was learned from blind demonstrations runs where a learned push stalls.

The push is learned from pegs that were shown, the search from a person who has felt for the hole, and `seat` makes one
skill of both. Then the fixture stands 3 to 5 mm beside where it was shown. The null is the same skill without its
search. Beside them stands the search that nobody has taught, a spiral.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import radians
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from skillframe_search.trials import Task, demonstrations

from skillframe.demonstration.npz import write_npz
from skillframe.demonstration.record import Demonstration
from skillframe.document.source import learned
from skillframe.execution.prepare import load_robot_model, load_world
from skillframe.extend.records import Document, LearnOptions, RowResult, RowRun
from skillframe.extend.registry import registry
from skillframe.frames import Float
from skillframe.teaching.sessions import record
from skillframe.teaching.teacher import TeacherSettings
from skillframe_papers.bars import ahead, counted, judged, together
from skillframe_papers.rows.blocks import Trials, ran
from skillframe_papers.rows.search import shown_by
from skillframe_papers.rows.skills import Ran

SEED, EACH = 69_000, 2
BLIND = 5
SETS, QUICK_SETS = 2, 1
STARTS, QUICK_STARTS = 12, 2
SHARE, LONGEST_S, QUICK_LONGEST_S = 0.9, 45.0, 10.0
BESIDE_M, BELIEVED_M = (0.003, 0.005), 0.004
OURS, NULL, SPIRAL = "push, learned search on a stall", "the push alone", "push, untaught spiral on a stall"


def _documents(shown: list[Demonstration], blind: tuple[Demonstration, ...], quick: bool) -> dict[str, Document]:
    """By method, a skill of one set."""
    common: dict[str, Any] = {"shift": BESIDE_M[1]}
    with TemporaryDirectory() as folder:
        files = [str(Path(folder) / f"blind{i}.npz") for i in range(len(blind))]
        for each, file in zip(blind, files, strict=True):
            write_npz(each, Path(file))
        ways: dict[str, dict[str, Any]] = {OURS: {"blind": files}, NULL: {"search": False}}
        if not quick:
            ways[SPIRAL] = {"exception": "spiral"}
        return {
            name: learned(registry().skill("seat"), shown, LearnOptions(settings={**common, **own}))
            for name, own in ways.items()
        }


def draws(count: int, seed: int) -> dict[str, Float]:
    """Where the fixture stands, 3 to 5 mm off in any direction."""
    rng = np.random.default_rng([seed, 1])
    off, angle = rng.uniform(*BESIDE_M, count), rng.uniform(0.0, 2.0 * np.pi, count)
    return {"fixture.offset_x": off * np.cos(angle), "fixture.offset_y": off * np.sin(angle)}


def exception(job: RowRun) -> RowResult:
    """Row 35: pegs inserted where the fixture stands beside its place."""
    params = {"fillet": job.settings["world.fillet"], "friction": job.settings["world.friction"]}
    scene, felt = (
        load_world("peg_in_hole", params),
        Task("peg_in_hole", tuple(params.items()), (BELIEVED_M,) * 2 + (0,)),
    )
    person = TeacherSettings(aim_noise=radians(job.settings["teacher.aim_noise_deg"]))
    sets, count = job.count(SETS, QUICK_SETS), job.count(STARTS, QUICK_STARTS)
    longest = QUICK_LONGEST_S if job.quick else LONGEST_S
    documents, trials = list[dict[str, Document]](), list[Trials]()
    for i in range(sets):
        seed = SEED + 1000 * job.seed + i
        shown = record(load_robot_model("free_tool"), scene, person, count=EACH, seed=seed).demonstrations
        # a quick run's person is the one of rows 13 to 41, whose searches are recorded once
        blind = shown_by(job, felt) if job.quick else demonstrations(felt, BLIND, seed)
        documents.append(_documents(list(shown), blind, job.quick))
        trials += [
            Trials(each, draws(count, seed), [np.random.default_rng([seed, 2, k]) for k in range(count)])
            for each in documents[-1].values()
        ]
    done = iter(ran(load_robot_model("free_tool"), scene, trials, duration_s=longest))
    won, seconds = dict[str, list[list[bool]]](), dict[str, list[float]]()
    for i, ways in enumerate(documents):
        for name in ways:
            ended = next(done)
            won.setdefault(name, []).append(ended.success.tolist())
            seconds.setdefault(name, []).extend(ended.seconds[ended.success].tolist())
        job.tell(f"set {i}: {', '.join(f'{name} {sum(hits[-1])}' for name, hits in won.items())} of {count}")
    return _told(job, {name: Ran(np.array(hits)) for name, hits in won.items()}, seconds)


def _told(job: RowRun, found: Mapping[str, Ran], seconds: Mapping[str, list[float]]) -> RowResult:
    """The row, from successes by method and the time that each took."""
    ours, null = found[OURS], found[NULL]
    longest = QUICK_LONGEST_S if job.quick else LONGEST_S
    share = judged(ours.hits, ours.trials, SHARE, quick=job.quick)
    beside = ahead(ours.hits, null.hits, ours.trials, quick=job.quick)
    said = ""
    if SPIRAL in found:
        lead = ahead(ours.hits, found[SPIRAL].hits, ours.trials, quick=job.quick)
        said = f" The untaught spiral is {'' if lead else 'not '}behind by 95 % intervals."
    return RowResult(
        ours=f"{counted(ours.hits, ours.trials)} pegs inserted 3 to 5 mm beside the place; null: {NULL}, {null.hits}"
        + (f"; with an untaught spiral {found[SPIRAL].hits}" if SPIRAL in found else ""),
        verdict=together([share], beside), values={"share": ours.hits / ours.trials},
        head=("skill", "trials", "sets without a failure", "median time"),
        rows=[
            (name, counted(each.hits, each.trials), each.sets,
             f"{np.median(seconds[name]):.1f} s" if seconds.get(name) else "-")
            for name, each in found.items()
        ],
        difference=f"A run may take {longest:g} s, and the person believes the hole within {1e3 * BELIEVED_M:g} mm "
        f"(standard deviation); both are ours.{said}",
    )  # fmt: skip

"""Row 31: one arm is taught by teleoperation while the other stands still.

Two demonstrations a set, tilted to either side, learned at the tip in the tool's orientation at the start (two-arm
paper). Null: a connection of 100 ms, too late to follow the force.
"""

from __future__ import annotations

import numpy as np
from skillframe_teaching.sessions import record
from skillframe_teaching.teacher import TeacherSettings

from skillframe.execution import load_robot_model
from skillframe.extend import Document, RowResult, RowRun
from skillframe_papers.rows.harness import Ran, X, Y, Z, compared, leads, lmc_if_any, one_axis, world

FACTS = ("push within 10 degrees of z", "no direction of turning", "one axis, along x", "one axis of turning, about y")


def told(document: Document) -> tuple[bool, ...]:
    """Which of `FACTS` a learned phase shows."""
    push, turn = (document["phases"][0][part] for part in ("translation", "rotation"))
    way = push["desired_direction"]
    return (
        way is not None and bool(np.dot(way, Z) > np.cos(np.radians(10.0))),
        turn["desired_direction"] is None and not turn["fully_compliant"],
        one_axis(push, X),
        one_axis(turn, Y),
    )


def _sets(job: RowRun, delay_s: float) -> list[tuple[bool, ...]]:
    person, count = TeacherSettings(kind="teleoperation", delay_s=delay_s), job.count(10, 2)
    robot, scene = load_robot_model("dual_panda"), world(job, "dual_peg")
    taught = record(robot, scene, person, count=2 * count, seed=65_000 + job.seed)
    job.tell(f"{1e3 * delay_s:g} ms: {len(taught.rejected)} demonstrations redrawn")
    pairs = [taught.demonstrations[2 * i : 2 * (i + 1)] for i in range(count)]
    documents = [lmc_if_any(pair, at="tip", axes="phase_start") for pair in pairs]
    return [(False,) * len(FACTS) if each is None else told(each) for each in documents]


def taught(job: RowRun) -> RowResult:
    """Row 31: sets that teach the published result, without and with delay."""
    delays = [float(job.settings[f"teacher.{name}"]) for name in ("delay_s", "late_s")]
    found = [np.array(_sets(job, delay)) for delay in delays]
    ours, null = (Ran(np.array([bool(each.all()) for each in sets])) for sets in found)
    return RowResult(
        ours=f"as published in {ours} sets of 2; null: {1e3 * delays[1]:g} ms late, {null.hits}",
        verdict=compared(job, [ours], leads(job, ours, null)), values={"share": ours.share, "null": null.share},
        head=("", *(f"{1e3 * delay:g} ms" for delay in delays)),
        rows=[(fact, *(str(Ran(sets[:, i])) for sets in found)) for i, fact in enumerate(FACTS)],
        difference="The teacher's force and delay are ours. Null: the same teacher, who feels the contact later.",
    )  # fmt: skip

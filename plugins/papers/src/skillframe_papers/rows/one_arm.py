"""Row 31 of the papers' results: one arm is led by teleoperation, the other stands still, and what that teaches both.

Two demonstrations a set, tilted to either side, learned at the tip in the tool's attitude at the start, as the two-arm
paper has it. The null is the same person behind a connection of 100 ms, whose force is felt too late to be followed.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from skillframe.demonstration.record import Demonstration
from skillframe.document.source import learned
from skillframe.errors import InputError
from skillframe.execution.prepare import load_robot_model, load_world
from skillframe.extend.records import Document, LearnOptions, RowResult, RowRun
from skillframe.extend.registry import registry
from skillframe.teaching.sessions import record
from skillframe.teaching.teacher import TeacherSettings
from skillframe_papers.bars import ahead, counted, judged, together

SEED = 65_000
SETS, QUICK_SETS, EACH = 10, 2, 2
SHARE = 0.9
PUSH_DEG, AXIS_DEG = 10.0, 20.0
X, Y, Z = np.eye(3)
FACTS = ("push within 10 degrees of z", "no direction of turning", "one axis, along x", "one axis of turning, about y")


def _near(axis: Sequence[float], wanted: np.ndarray, most_deg: float) -> bool:
    return bool(abs(float(np.dot(axis, wanted))) > np.cos(np.radians(most_deg)))


def told(document: Document) -> tuple[bool, ...]:
    """Which of `FACTS` a learned phase says."""
    push, turn = (document["phases"][0][part] for part in ("translation", "rotation"))
    along, about = push["compliant_axes"], turn["compliant_axes"]
    return (
        push["desired_direction"] is not None
        and float(np.dot(push["desired_direction"], Z)) > np.cos(np.radians(PUSH_DEG)),
        turn["desired_direction"] is None and not turn["fully_compliant"],
        len(along) == 1 and _near(along[0], X, AXIS_DEG),
        len(about) == 1 and _near(about[0], Y, AXIS_DEG),
    )


def _learned(given: Sequence[Demonstration]) -> tuple[bool, ...]:
    try:
        document = learned(registry().skill("lmc"), list(given), LearnOptions(at="tip", axes="phase_start"))
    except InputError:  # a refusal teaches nothing
        return (False,) * len(FACTS)
    return told(document)


def _sets(job: RowRun, delay_s: float) -> list[tuple[bool, ...]]:
    """By set of demonstrations: which facts it teaches."""
    person = TeacherSettings(kind="teleoperation", delay_s=delay_s)
    scene = load_world("dual_peg", {"friction": job.settings["world.friction"]})
    count = job.count(SETS, QUICK_SETS)
    shown = record(load_robot_model("dual_panda"), scene, person, count=EACH * count, seed=SEED + job.seed)
    job.tell(f"{1e3 * delay_s:g} ms: {len(shown.rejected)} demonstrations redrawn")
    return [_learned(shown.demonstrations[EACH * i : EACH * (i + 1)]) for i in range(count)]


def taught(job: RowRun) -> RowResult:
    """Row 31: sets that teach what the paper learned, with a hand that feels in time and with one that does not."""
    delays = {name: float(job.settings[f"teacher.{name}"]) for name in ("delay_s", "late_s")}
    found, late = (_sets(job, delay) for delay in delays.values())
    good, null, count = sum(map(all, found)), sum(map(all, late)), len(found)
    share, beside = judged(good, count, SHARE, quick=job.quick), ahead(good, null, count, quick=job.quick)
    return RowResult(
        ours=f"as published in {counted(good, count)} sets of {EACH}; null: {1e3 * delays['late_s']:g} ms late, {null}",
        verdict=together([share], beside), values={"share": good / count, "null": null / count},
        head=("", *(f"{1e3 * delay:g} ms" for delay in delays.values())),
        rows=[
            (fact, *(counted(sum(each[i] for each in sets), count) for sets in (found, late)))
            for i, fact in enumerate(FACTS)
        ],
        difference="The person's force and delay are ours. Null: the same person, who feels the contact later.",
    )  # fmt: skip

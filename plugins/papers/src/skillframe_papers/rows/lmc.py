"""Rows 1, 2 and 4 to 6 of the papers' results: what LMC learns from demonstrations in simulated contact, and does.

Demonstrations come from the simulated teacher, `free_tool` holds the part, and each group of demonstrations has a seed
of its own. The aim noise, the friction and the geometry are ours; the papers print none of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import atan, degrees, radians
from typing import Any

import numpy as np

from skillframe.demonstration.record import Demonstration
from skillframe.document.file import new_document
from skillframe.document.frame import frame_at
from skillframe.document.source import learned
from skillframe.execution.executor import simulate
from skillframe.execution.prepare import load_robot_model, load_world, prepare
from skillframe.extend.records import Document, Illustration, LearnOptions, RowResult, RowRun
from skillframe.extend.registry import registry
from skillframe.frames import Float
from skillframe.teaching.sessions import record
from skillframe.teaching.teacher import TeacherSettings
from skillframe_papers.bars import reached

DOWN, X, Y = np.array([0.0, 0.0, -1.0]), np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])
SHARE = 0.95
REDRAWN = "demonstrations that failed and were redrawn"
START_DEG = 8.0
FACE_M, LEVER_M = 0.030, 0.150
LEVER = (
    "The verdict takes the flange, where the paper has its tool point and centre of compliance. Ours lies 150 mm "
    "behind a face of 30 mm radius: from 8 degrees the edge touches only 9 mm beside the line of the push, so that a "
    f"learned push {degrees(atan(FACE_M / LEVER_M)) - START_DEG:.1f} degrees off to that side tips the coupler over "
    "instead of flush; two demonstrations with this "
    "noise of the aim leave more than that in some pairs. Steered at the tip, the push has its full lever."
)


def _taught(
    job: RowRun, world: str, params: dict[str, Any], pairs: int, each: int = 2, noise_deg: float | None = None
) -> tuple[list[list[Demonstration]], str]:
    """Groups of demonstrations, and how many failed on the way."""
    noise = float(job.settings["teacher.aim_noise_deg"] if noise_deg is None else noise_deg)
    settings = TeacherSettings(aim_noise=radians(noise))
    scene = load_world(world, params)
    seed = 1000 + job.seed
    recording = record(load_robot_model("free_tool"), scene, settings, count=pairs * each, seed=seed)
    groups = [recording.demonstrations[each * i : each * (i + 1)] for i in range(pairs)]
    return groups, str(len(recording.rejected))


def _documents(groups: Sequence[Sequence[Demonstration]]) -> list[Document]:
    kind = registry().skill("lmc")
    return [learned(kind, group, LearnOptions()) for group in groups]


def _parts(documents: Sequence[Document], name: str) -> list[dict[str, Any]]:
    return [document["phases"][0][name] for document in documents]


def _angle(a: Any, b: Float) -> float:
    """Between two directions [degrees]. 180 where there is none."""
    return 180.0 if a is None else degrees(np.arccos(np.clip(np.dot(a, b), -1.0, 1.0)))


def _along(part: dict[str, Any], axis: Float) -> bool:
    """Exactly one compliant axis, within 20 degrees of the published one."""
    axes = part["compliant_axes"]
    return len(axes) == 1 and abs(np.dot(axes[0], axis)) > np.cos(radians(20.0))


def pictures(document: Document) -> list[Illustration]:
    """Figures 13 and 14, and who did the work, drawn from the skill file."""
    from skillframe_lmc.explain import explain

    figures = {"Which": "Fig. 13: ", "Along": "Fig. 14: "}
    return [d._replace(title=figures.get(d.title.split()[0], "") + d.title) for d in explain(document)]


def sector_width(job: RowRun) -> RowResult:
    """Row 1: width of the sector of feasible pushes over friction."""

    from skillframe_lmc.intervals import track, translation
    from skillframe_lmc.sectors import sectors
    from skillframe_lmc.settings import Settings

    middle, rows, worst = float(job.settings["world.friction"]), [], 0.0
    for friction in (0.5 * middle, middle, 2.0 * middle):
        groups, _ = _taught(job, "valley", {"friction": friction}, job.count(20, 3), each=1)
        widths = []
        for (demonstration,) in groups:
            point = np.array(demonstration.meta["frames"]["tip"])
            given = sectors(translation(track(demonstration, point, point, "base"), Settings()))
            widths.append(degrees(float(np.median(given.width[given.contact]))))
        theory, ours = 90.0 - degrees(atan(friction)), float(np.median(widths))
        worst = max(worst, abs(ours - theory))
        rows.append((f"{friction:g}", f"{theory:.1f}", f"{ours:.1f}", f"{min(widths):.1f} to {max(widths):.1f}"))
    return RowResult(
        ours=", ".join(f"{row[2]} at friction {row[0]}" for row in rows) + " degrees",
        verdict="pass" if worst <= 1.0 else "fail", values={"largest_difference_deg": worst},
        head=("friction", "90 - atan(friction) [degrees]", "median width [degrees]", "over demonstrations [degrees]"),
        rows=rows,
    )  # fmt: skip


def _tilted_push() -> Document:
    """An LMC document: push along the tool's axis, free across it in the valley's plane, stop where it stalls."""

    def part(direction: Any, axes: list[list[float]], stiffness: Float, speed: float) -> dict[str, Any]:
        return {
            "desired_direction": direction, "speed": speed, "compliant_axes": axes, "fully_compliant": False,
            "stiffness": np.diag(stiffness).tolist(), "damping": np.eye(3).tolist(), "evidence": {},
        }  # fmt: skip

    tip = list(load_world("valley", {}).tool.frames["tip"])
    phase = {
        "translation": part([0.0, 0.0, 1.0], [[1.0, 0.0, 0.0]], np.array([0.0, 1000.0, 1000.0]), 0.03),
        "rotation": part(None, [], np.full(3, 20.0), 0.0), "pitch": None, "stop": {"stall_s": 0.6},
    }  # fmt: skip
    return new_document(registry().skill("lmc"), {"frame": frame_at(tip, axes="phase_start"), "phases": [phase]})


def _slides(job: RowRun, slope: float, friction: Float, tilt: Float, side: Float) -> np.ndarray:
    """Which trials reach the bottom, for pushes tilted against the slope they start on [rad]."""
    params = {"slope": slope, "tolerance": 0.002}
    skill, setup = prepare(load_robot_model("free_tool"), load_world("valley", params), _tilted_push())
    draws = {"start.offset_x": 0.015 * side, "start.tilt_y": -side * tilt, "world.friction": friction}
    rngs = [np.random.default_rng([job.seed, i]) for i in range(len(tilt))]
    return simulate(skill, setup, draws, rngs, duration_s=8.0).success


def valley_boundary(job: RowRun) -> RowResult:
    """Row 2: the largest tilt of a push that slides to the bottom."""
    slope, middle = radians(float(job.settings["world.slope_deg"])), float(job.settings["world.friction"])
    beyond = np.arange(-4.0, 4.5, job.count(1, 2))
    friction, over, side = np.meshgrid([0.5 * middle, middle, 2.0 * middle], beyond, [1.0, -1.0], indexing="ij")
    limit = slope - np.arctan(friction)
    slid = _slides(job, slope, friction.ravel(), (limit + np.radians(over)).ravel(), side.ravel()).reshape(over.shape)
    rows, worst = [], 0.0
    for i in range(3):
        theory = degrees(limit[i, 0, 0])
        found = [theory + (beyond[slid[i, :, j]].max() if slid[i, :, j].any() else -90.0) for j in range(2)]
        worst = max(worst, *(abs(f - theory) for f in found))
        rows.append((f"{friction[i, 0, 0]:g}", f"{theory:.1f}", *(f"{f:.1f}" for f in found)))
    return RowResult(
        ours=f"largest tilt {rows[1][2]} and {rows[1][3]} degrees, theory {rows[1][1]}",
        verdict="pass" if worst <= 2.0 else "fail", values={"largest_difference_deg": worst},
        head=("friction", "slope - atan(friction) [degrees]", "from one side [degrees]", "from the other [degrees]"),
        rows=rows,
    )  # fmt: skip


def hose(job: RowRun) -> RowResult:
    """Row 4: what is learned for the hose coupler, and whether it aligns."""
    params, pairs = {"friction": job.settings["world.friction"]}, job.count(20, 4)
    groups, failed = _taught(job, "hose_coupler", params, pairs)
    documents = _documents(groups)
    pushes, turns = _parts(documents, "translation"), _parts(documents, "rotation")
    as_told = sum(
        p["desired_direction"] is not None and t["desired_direction"] is None
        and len(p["compliant_axes"]) == len(t["compliant_axes"]) == 1
        for p, t in zip(pushes, turns, strict=True)
    )  # fmt: skip
    run = documents[: job.count(12, 3)]
    both = {coc: sum(all(_align(job, params, document, coc)) for document in run) for coc in (None, "tip")}
    passed = reached(as_told, pairs, SHARE, quick=job.quick) and both[None] == len(run)
    rows = [
        ("flags and counts as published", f"{as_told} of {pairs} pairs"),
        ("aligned from +8 and -8 degrees, steered at the flange as in the paper", f"{both[None]} of {len(run)} pairs"),
        ("the same skills, steered at the tip (its face)", f"{both['tip']} of {len(run)} pairs"),
        (REDRAWN, failed),
    ]
    return RowResult(
        ours=f"as published in {as_told} of {pairs} pairs; both starts aligned with {both[None]} of {len(run)} steered "
        f"at the flange, {both['tip']} at the tip",
        verdict="pass" if passed else "fail", head=("", "ours"), rows=rows, pictures=pictures(documents[0]),
        difference="" if both[None] == len(run) else LEVER,
        values={"as_published": as_told / pairs, "aligned": both[None] / len(run), "tip": both["tip"] / len(run)},
    )  # fmt: skip


def _align(job: RowRun, params: dict[str, Any], document: Document, coc: str | None) -> list[bool]:
    """Whether the coupler lies flush, from both starts, steered where it was learned or about another point."""
    skill, setup = prepare(load_robot_model("free_tool"), load_world("hose_coupler", params), document, coc)
    draws = {"start.tilt_y": np.radians([START_DEG, -START_DEG])}
    rngs = [np.random.default_rng([job.seed, i]) for i in range(2)]
    return [bool(good) for good in simulate(skill, setup, draws, rngs, duration_s=15.0).success]


def peg(job: RowRun) -> RowResult:
    """Row 5: what is learned for the peg."""
    pairs = job.count(20, 4)
    groups, failed = _taught(job, "peg_in_hole", {"friction": job.settings["world.friction"]}, pairs)
    documents = _documents(groups)
    pushes, turns = _parts(documents, "translation"), _parts(documents, "rotation")
    errors = [_angle(part["desired_direction"], DOWN) for part in pushes]
    facts = [
        ("push within 10 degrees of z", [e <= 10.0 for e in errors]),
        ("no direction of turning", [t["desired_direction"] is None and not t["fully_compliant"] for t in turns]),
        ("one axis, along x", [_along(p, X) for p in pushes]),
        ("one axis of turning, about y", [_along(t, Y) for t in turns]),
    ]
    together = sum(all(each) for each in zip(*(values for _, values in facts), strict=True))
    return RowResult(
        ours=f"identical in {together} of {pairs} pairs; push {np.median(errors):.1f} degrees from z (median)",
        verdict="pass" if reached(together, pairs, SHARE, quick=job.quick) else "fail",
        pictures=pictures(documents[0]), head=("", "ours"),
        rows=[*((text, f"{sum(values)} of {pairs}") for text, values in facts), (REDRAWN, failed)],
        values={"identical_share": together / pairs, "median_error_deg": float(np.median(errors))},
    )  # fmt: skip


def levering(job: RowRun) -> RowResult:
    """Row 6: who does the work in levering."""
    count = job.count(20, 4)
    groups, failed = _taught(job, "edge", {"friction": job.settings["world.friction"]}, count, each=1)
    documents = _documents(groups)
    pushes, turns = _parts(documents, "translation"), _parts(documents, "rotation")
    good = sum(p["fully_compliant"] and not t["fully_compliant"] for p, t in zip(pushes, turns, strict=True))
    work = [[_mean(parts, key) for key in ("work_environment_j", "work_teacher_j")] for parts in (pushes, turns)]
    return RowResult(
        ours=f"translation fully compliant and rotation not in {good} of {count}",
        verdict="pass" if good == count else "fail", values={"share": good / count},
        head=("", "by the environment [J]", "by the teacher [J]"),
        rows=[(name, *(f"{w:.2f}" for w in each)) for name, each in zip(("translation", "rotation"), work, strict=True)]
        + [(REDRAWN, failed, "")], pictures=pictures(documents[0]),
    )  # fmt: skip


def _mean(parts: Sequence[dict[str, Any]], key: str) -> float:
    return float(np.mean([part["evidence"][key] for part in parts]))

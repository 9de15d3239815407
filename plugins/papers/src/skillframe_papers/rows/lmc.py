"""Rows 1, 2, 4 and 6 of the papers' results: what LMC learns in simulated contact, and what it does.

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
from skillframe_papers.bars import counted, reached
from skillframe_papers.rows.blocks import ran_made
from skillframe_papers.rows.skills import STIFF_TURN_NM_RAD, WRIST, by_hand, stiff

DOWN, X, Y = np.array([0.0, 0.0, -1.0]), np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])
SHARE = 0.95
REDRAWN = "demonstrations that failed and were redrawn"
START_DEG = 8.0
FACE_M, LEVER_M = 0.030, 0.150


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
        difference="Null: a sector of 90 degrees, which knows of no friction, is off by up to "
        f"{degrees(atan(2.0 * middle)):.1f} degrees.",
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
        difference="Null: the slope itself, which knows of no friction, is off by up to "
        f"{degrees(atan(2.0 * middle)):.1f} degrees.",
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
    rigid_ones = [stiff(each, "rotation", STIFF_TURN_NM_RAD) for each in documents]
    given: dict[str, tuple[list[Document], str | None]] = {
        "learned, steered at the flange as in the paper": (documents, None),
        "learned, steered at the tip": (documents, "tip"),
        "the same, stiff in rotation, at the flange": (rigid_ones, None),
        "by hand: straight down, free along x, turning about y": ([by_hand(turn="y", at=WRIST)], "wrist"),
    }  # fmt: skip
    done = iter(_flush(job, params, [(d, coc) for made, coc in given.values() for d in made]))
    flush = {name: [next(done) for _ in made] for name, (made, _) in given.items()}
    flange, tip, rigid, straight = flush.values()
    passed = reached(as_told, pairs, SHARE, quick=job.quick) and all(flange) and not all(rigid)
    rows = [("flags and counts as published", counted(as_told, pairs))]
    rows += [(f"aligned from +8 and -8 degrees: {name}", counted(sum(f), len(f))) for name, f in flush.items()]
    return RowResult(
        ours=f"as published in {counted(as_told, pairs)} pairs; both starts aligned with {counted(sum(flange), pairs)} "
        f"steered at the flange, {sum(tip)} at the tip",
        verdict="pass" if passed else "fail", head=("", "pairs"), rows=[*rows, (REDRAWN, failed)],
        pictures=pictures(documents[0]),
        difference=f"{_lever(pushes, flange)} Nulls, both starts aligned: stiff in rotation {sum(rigid)} of {pairs}; a "
        f"push by hand {'yes' if straight[0] else 'no'}.",
        values={"as_published": as_told / pairs, "aligned": sum(flange) / pairs, "tip": sum(tip) / pairs},
    )  # fmt: skip


def _lever(pushes: Sequence[dict[str, Any]], flush: Sequence[bool]) -> str:
    """How far the pushes of pairs that align are off, and of those that do not, in the plane of the tilt."""
    push = np.array([p["desired_direction"] or (np.nan,) * 3 for p in pushes])
    off, good = np.abs(np.degrees(np.arctan2(push[:, 0], -push[:, 2]))), np.array(flush)
    told = [
        f"{what} {off[which].min():.1f} to {off[which].max():.1f}"
        for what, which in (("align", good), ("do not", ~good)) if which.any()
    ]  # fmt: skip
    most = degrees(atan(FACE_M / LEVER_M))
    return (
        f"Pushes are off by so many degrees in the plane of the tilt where starts {', where they '.join(told)}. The "
        f"flange lies {1e3 * LEVER_M:g} mm behind a face of {1e3 * FACE_M:g} mm radius, so that a push rights the "
        f"coupler up to {most:.1f} degrees, of which {START_DEG:g} are the start's: {most - START_DEG:.1f} are left."
    )


def _flush(job: RowRun, params: dict[str, Any], given: Sequence[tuple[Document, str | None]]) -> list[bool]:
    """Which skills put the coupler flush from both starts, each steered where it was learned or about another point."""
    robot, scene = load_robot_model("free_tool"), load_world("hose_coupler", params)
    draws = {"start.tilt_y": np.radians([START_DEG, -START_DEG])}
    rngs = [[np.random.default_rng([job.seed, i]) for i in range(2)] for _ in given]
    made = [prepare(robot, scene, document, coc) for document, coc in given]
    return [bool(each.success.all()) for each in ran_made(made, [(draws, each) for each in rngs], duration_s=15.0)]


def levering(job: RowRun) -> RowResult:
    """Row 6: who does the work in levering."""
    count = job.count(20, 4)
    groups, failed = _taught(job, "edge", {"friction": job.settings["world.friction"]}, count, each=1)
    documents = _documents(groups)
    pushes, turns = _parts(documents, "translation"), _parts(documents, "rotation")
    good = sum(p["fully_compliant"] and not t["fully_compliant"] for p, t in zip(pushes, turns, strict=True))
    pushed, _ = _taught(job, "valley", {"friction": job.settings["world.friction"]}, count, each=1)
    null = sum(part["fully_compliant"] for part in _parts(_documents(pushed), "translation"))
    work = [[_mean(parts, key) for key in ("work_environment_j", "work_teacher_j")] for parts in (pushes, turns)]
    return RowResult(
        ours=f"translation fully compliant and rotation not in {counted(good, count)}; where the person pushes, in "
        f"{counted(null, count)}",
        verdict="pass" if good == count and null == 0 else "fail", values={"share": good / count},
        difference="Null: to say so of every demonstration. The person pushes in the valley.",
        head=("", "by the environment [J]", "by the teacher [J]"),
        rows=[(name, *(f"{w:.2f}" for w in each)) for name, each in zip(("translation", "rotation"), work, strict=True)]
        + [(REDRAWN, failed, "")], pictures=pictures(documents[0]),
    )  # fmt: skip


def _mean(parts: Sequence[dict[str, Any]], key: str) -> float:
    return float(np.mean([part["evidence"][key] for part in parts]))

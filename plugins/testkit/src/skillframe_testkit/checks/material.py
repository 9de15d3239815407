"""Inputs for checks of exporters, scores and sections: phases, traces, and a campaign's folder.

They are synthetic, with real names, columns and units: a tool slides down a plane, as in
`skillframe_testkit.checks.examples`.
"""

from __future__ import annotations

import csv
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from skillframe.campaign import JUDGED, OUTCOME, cell
from skillframe.execution import Trace
from skillframe.extend import MovingImpedance
from skillframe_testkit.checks.examples import DOWN, FRICTION, NORMAL_FORCE, SPEED


def example_phase(**changes: Any) -> MovingImpedance:
    """A push along -z, free along x and about y, with gains along the axes as read-only arrays.

    `changes` are fields with other values.
    """
    given: dict[str, Any] = {
        "axes": "base", "center": np.array([0.0, 0.0, 0.12]), "twist": np.array([0.0, 0.0, -0.02, 0.0, 0.0, 0.0]),
        "stiffness": np.diag([0.0, 800.0, 800.0, 20.0, 0.0, 20.0]),
        "damping": np.diag([40.0, 80.0, 80.0, 2.0, 1.0, 2.0]), "lead_force": 20.0, "lead_torque": 2.0,
        "stop": {"lead_force_n": 20.0, "lead_torque_nm": 2.0, "time_limit_s": 20.0}, **changes,
    }  # fmt: skip
    for value in given.values():
        if isinstance(value, np.ndarray):
            value.setflags(write=False)
    return MovingImpedance(**given)


def example_trace(*, success: bool = True, duration_s: float = 4.0, diverged: bool = False, trial: int = 0) -> Trace:
    """A trial that slides along a plane to its end, or sticks half way, with read-only arrays.

    Args:
        success: whether it reached its goal.
        duration_s: of the trial; 0 for one sample.
        diverged: the last quarter is NaN.
        trial: its number, the seed of its noise.
    """
    rng = np.random.default_rng([21, trial])
    rate, approach = 100.0, 0.4  # Hz, s
    time = np.arange(round(duration_s * rate) + 1) / rate
    touching = np.maximum(time - approach, 0.0)
    way = SPEED * (np.minimum(time, approach) + (touching if success else np.minimum(touching, 0.3 * duration_s)))
    position = np.array([0.4, 0.0, 0.2]) + way[:, None] * np.array([0.6, 0.0, -0.8])
    force = np.where(touching > 0.0, NORMAL_FORCE * (1.0 if success else 3.0), 0.0)[:, None]
    wrench = np.concatenate([force * [0.8 - 0.6 * FRICTION, 0.0, 0.6 + 0.8 * FRICTION], 0.0 * position], axis=1)
    speed = np.gradient(position, 1.0 / rate, axis=0) if len(position) > 1 else np.zeros_like(position)
    arrays: dict[str, Any] = {
        "time": time, "position": position, "quaternion": np.tile(DOWN, (len(time), 1)),
        "twist": np.concatenate([speed, 0.0 * position], axis=1),
        "wrench": wrench + rng.normal(size=wrench.shape) * np.repeat([0.05, 0.002], 3), "wrench_true": wrench,
        "desired_position": position - np.array([0.0, 0.0, 0.005]), "desired_quaternion": np.tile(DOWN, (len(time), 1)),
        "command_wrench": -wrench, "q": np.zeros((len(time), 7)), "body_position": np.zeros((len(time), 0, 3)),
        "body_quaternion": np.zeros((len(time), 0, 4)),
    }  # fmt: skip
    if diverged:
        for name in ("position", "twist", "wrench", "wrench_true", "command_wrench"):
            arrays[name][3 * len(time) // 4 :] = np.nan
    for array in arrays.values():
        array.setflags(write=False)
    meta = {
        "robot": "panda", "world": "valley", "params": {"slope": 0.8}, "seed": 7, "trial": trial,
        "skill": "slide.skill.json", "draws": {"start.offset_x": 0.001 * trial},
        **_outcome(success, float(time[-1]), float(np.abs(force).max())),
        "status": "SUCCESS" if success else "FAILURE", "reason": "reached the goal" if success else "stuck",
        "center_of_compliance": [0.0, 0.0, 0.12], "events": [[approach, "touched"]], "bodies": [], "progress": None,
        "limits": {"force_n": 80.0},
    }  # fmt: skip
    return Trace(meta=meta, **arrays)


def _outcome(success: bool, duration_s: float, force: float) -> dict[str, Any]:
    return {
        "success": success, "failure": "" if success else "stuck", "duration_s": duration_s, "peak_force_n": force,
        "final_error_m": 0.0005 if success else 0.04, "final_error_rad": 0.001, "peak_force_filtered_n": force,
        "peak_torque_share": 0.3, "peak_speed_share": 0.1, "ended_by": "skill",
        "peak_force_10ms_n": force, "peak_range_share": 0.6, "peak_torque_joint": "joint2",
        "peak_speed_joint": "joint6", "peak_range_joint": "joint4", "goal_reached": success, "ended_itself": True,
        "distance_to_collision_m": 0.06,
    }  # fmt: skip


TOML = """name = "slide"
seed = 7
trials = 8
robot = "panda"
world = "valley"
skills = ["slide.skill.json", "replay:slide.npz"]
[vary]
"start.offset_x" = { uniform = [-0.01, 0.01] }
"""


def example_campaign(folder: Path) -> Mapping[str, Path]:
    """Write a campaign's folder: campaign.toml, results.csv, summary.json and two traces. Returns files by name."""
    (folder / "traces").mkdir(parents=True)
    (folder / "campaign.toml").write_text(TOML, encoding="utf-8")
    skills = ("slide.skill.json", "replay:slide.npz")
    rows = [(trial, skill, trial % 3 != 0 or i == 0) for trial in range(8) for i, skill in enumerate(skills)]
    with (folder / "results.csv").open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(["trial", "skill", "seed", "start.offset_x", *OUTCOME, *JUDGED])
        for trial, skill, success in rows:
            given = _outcome(success, 4.0 + 0.1 * trial, 8.0 + trial)
            cells = [trial, skill, 7, 0.001 * trial, *(given[name] for name in (*OUTCOME, *JUDGED))]
            table.writerow([cell(value) for value in cells])
    rates = {s: {"trials": 8, "successes": sum(row[2] for row in rows if row[1] == s)} for s in skills}
    summary = {"format": "skillframe.campaign", "version": 1, "name": "slide", "complete": True, "skills": rates}
    (folder / "summary.json").write_text(json.dumps(summary, sort_keys=True), encoding="utf-8")
    for trial, success in ((0, False), (1, True)):
        example_trace(success=success, trial=trial).save(folder / "traces" / f"{trial:06d}.npz")
    return {p.relative_to(folder).as_posix(): p for p in sorted(folder.rglob("*")) if p.is_file()}

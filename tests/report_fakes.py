"""Made-up results with the shape of real ones: a peg pushed into a hole by an arm of capsules, and a campaign of it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from skillframe.execution.trace import Trace
from skillframe.frames import quaternion_from_matrix, rotation_matrix

RADIUS, LENGTH, DEPTH, HOLE = 0.0165, 0.08, 0.06, 0.01675
PLACE = np.array([0.5, 0.0, 0.1])
IDENTITY = [0.0, 0.0, 0.0, 1.0]


def peg_mesh(segments: int = 48) -> dict[str, Any]:
    """A peg along z with its fillet at the bottom, as a convex mesh."""
    arc = np.linspace(0.0, np.pi / 2, 6)
    profile = [(RADIUS - 0.005 * (1 - np.sin(a)), 0.005 * (1 - np.cos(a))) for a in arc] + [(RADIUS, LENGTH)]
    angle = 2 * np.pi * np.arange(segments) / segments
    vertices = [[r * np.cos(a), r * np.sin(a), z] for r, z in profile for a in angle] + [[0, 0, 0], [0, 0, LENGTH]]
    faces, top = [], (len(profile) - 1) * segments
    for i in range(segments):
        j = (i + 1) % segments
        for row in range(len(profile) - 1):
            a, b = row * segments, (row + 1) * segments
            faces += [[a + i, a + j, b + j], [a + i, b + j, b + i]]
        faces += [[j, i, len(vertices) - 2], [top + i, top + j, len(vertices) - 1]]
    return {"kind": "mesh", "size": [], "position": [0, 0, 0], "quaternion": IDENTITY, "rgba": [0.85, 0.45, 0.2, 1.0],
            "vertices": np.array(vertices).tolist(), "faces": faces}  # fmt: skip


def ring(boxes: int = 32) -> list[dict[str, Any]]:
    """Boxes around a hole along z, its mouth at the origin."""
    geoms, wall = [], 0.02
    half = (HOLE + 2 * wall) * np.tan(np.pi / boxes)
    for i in range(boxes):
        a = 2 * np.pi * i / boxes
        r = HOLE + wall
        geoms.append({"kind": "box", "size": [wall, half, DEPTH / 2], "rgba": [0.55, 0.62, 0.7, 1.0],
                      "position": [r * np.cos(a), r * np.sin(a), -DEPTH / 2],
                      "quaternion": [0.0, 0.0, float(np.sin(a / 2)), float(np.cos(a / 2))]})  # fmt: skip
    plate = {"kind": "box", "size": [0.1, 0.1, 0.01], "position": [0.0, 0.0, -DEPTH - 0.01], "quaternion": IDENTITY,
             "rgba": [0.4, 0.44, 0.5, 1.0]}  # fmt: skip
    return [*geoms, plate]


def capsule(radius: float, length: float) -> dict[str, Any]:
    """A link along z from its origin."""
    return {"kind": "capsule", "size": [radius, length / 2], "position": [0, 0, length / 2], "quaternion": IDENTITY,
            "rgba": [0.9, 0.9, 0.92, 1.0]}  # fmt: skip


def _aim(start: np.ndarray, end: np.ndarray) -> np.ndarray:
    z = (end - start) / np.linalg.norm(end - start, axis=-1, keepdims=True)
    x = np.cross(np.array([0.0, 1.0, 0.0]), z)
    x /= np.linalg.norm(x, axis=-1, keepdims=True)
    return np.stack([x, np.cross(z, x), z], axis=-1)


def trace(
    *, success: bool = True, seed: int = 0, skill: str = "peg.skill.json", samples: int = 800, **meta: Any
) -> Trace:
    """A peg that slides in from a tilt of 8 degrees, or jams half way."""
    rng = np.random.default_rng(seed)
    time = np.linspace(0.0, 4.0, samples)
    depth = np.clip(0.012 * time, 0, 0.055 if success else 0.019)
    tilt = np.radians(8.0) * np.exp(-2.0 * time) if success else np.radians(8.0) - np.radians(2.0) * (1 - np.exp(-time))
    rotation = rotation_matrix(np.stack([0 * time, tilt, 0 * time], axis=-1))
    tip = PLACE + np.stack([0.002 * np.exp(-2 * time), 0 * time, 0.001 - depth], axis=-1)
    wrist = tip + rotation @ np.array([0.0, 0.0, LENGTH + 0.08])
    shoulder, base = np.array([0.0, 0.0, 0.33]), np.zeros(3)
    middle = 0.5 * (shoulder + wrist) + np.array([-0.05, 0.0, 0.22])
    push = (6.0 if success else 10.0 * np.clip(time - 1.5, 0, 5)) + 9.0 * np.exp(-(((time - 0.8) / 0.2) ** 2))
    wrench = np.stack([2 * np.exp(-time), 0 * time, push, 0 * time, 0.15 * np.exp(-time), 0 * time], axis=-1)
    noisy = wrench + rng.normal(0, [0.3, 0.3, 0.5, 0.01, 0.01, 0.01], (samples, 6))
    starts = [PLACE + 0 * tip, tip, np.broadcast_to(base, tip.shape), np.broadcast_to(shoulder, tip.shape), middle]
    turns = [np.broadcast_to(np.eye(3), rotation.shape), rotation, np.broadcast_to(np.eye(3), rotation.shape),
             _aim(np.broadcast_to(shoulder, middle.shape), middle), _aim(middle, wrist)]  # fmt: skip
    span = float(np.linalg.norm(middle[0] - shoulder)), float(np.linalg.norm(wrist[0] - middle[0]))
    shank = {"kind": "cylinder", "size": [0.012, 0.04], "position": [0, 0, LENGTH + 0.04], "quaternion": IDENTITY,
             "rgba": [0.3, 0.33, 0.38, 1.0]}  # fmt: skip
    bodies = [
        {"name": "fixture", "geoms": ring()},
        {"name": "tool", "geoms": [peg_mesh(), shank]},
        {"name": "link0", "geoms": [{**capsule(0.07, 0.33), "kind": "cylinder", "size": [0.07, 0.165]}]},
        {"name": "link1", "geoms": [capsule(0.055, span[0])]},
        {"name": "link2", "geoms": [capsule(0.045, span[1])]},
    ]
    desired = PLACE + np.stack([0 * time, 0 * time, 0.001 - 0.014 * time], axis=-1)
    events = [[0.4, "first contact"], [3.9, "goal reached"]] if success else [[0.4, "first contact"], [3.9, "stalled"]]
    information = {
        "robot": "panda", "world": "peg_in_hole", "params": {"friction": 0.2}, "seed": seed, "trial": seed,
        "draws": {"fixture.tilt_y": 0.14, "fixture.offset_x": 0.002}, "success": success,
        "failure": "" if success else "stalled", "status": "SUCCESS" if success else "FAILURE",
        "reason": "the goal was reached" if success else "no motion for 0.5 s", "duration_s": 4.0,
        "peak_force_n": float(np.abs(noisy[:, :3]).max()), "final_error_m": 0.0005, "final_error_rad": 0.001,
        "center_of_compliance": [0.0, 0.0, 0.16], "skill": skill, "events": events, "bodies": bodies,
        "limits": {"force_n": 80.0}, **meta,
    }  # fmt: skip
    return Trace(
        time=time, position=tip, quaternion=quaternion_from_matrix(rotation),
        twist=np.gradient(np.hstack([tip, tip]), time, axis=0),
        wrench=noisy, wrench_true=wrench, desired_position=desired, desired_quaternion=np.tile(IDENTITY, (samples, 1)),
        command_wrench=-wrench, q=np.zeros((samples, 7)), body_position=np.stack(starts, axis=1),
        body_quaternion=np.stack([quaternion_from_matrix(r) for r in turns], axis=1), meta=information,
    )  # fmt: skip


def skill_document(kind: str = "lmc") -> dict[str, Any]:
    """A skill file with the contract's keys."""
    part = {
        "desired_direction": [0.02, 0.0, -0.9998], "speed": 0.02, "compliant_axes": [[1.0, 0.0, 0.0]],
        "fully_compliant": False,
        "stiffness": [[0, 0, 0], [0, 1000, 0], [0, 0, 1000]], "damping": [[60, 0, 0], [0, 80, 0], [0, 0, 80]],
        "evidence": {"explained": 0.97, "feasible_solid_angle_sr": 0.31,
                     "work_teacher_j": 0.52, "work_environment_j": 0.03, "criterion": [9.1, 4.2, 8.0]},
    }  # fmt: skip
    turn = {**part, "desired_direction": None, "speed": 0.0, "compliant_axes": [[0.0, 1.0, 0.0]],
            "stiffness": [[40, 0, 0], [0, 0, 0], [0, 0, 40]], "damping": [[2, 0, 0], [0, 1, 0], [0, 0, 2]]}  # fmt: skip
    return {
        "format": "skillframe.skill", "version": 1, "type": kind, "created_by": {"skillframe": "0.2.0"},
        "learned_from": [{"file": "demo1.npz", "sha256": "ab" * 32}, {"file": "demo2.npz", "sha256": "cd" * 32}],
        "frame": {"work_at": [0, 0, 0.06], "learned_at": [0, 0, 0], "center_of_compliance": [0, 0, 0], "axes": "base"},
        "phases": [{"translation": part, "rotation": turn, "pitch": None, "stop": {"stall_s": 0.5}}],
    }  # fmt: skip


COLUMNS = ["trial", "skill", "seed", "fixture.tilt_y", "fixture.offset_x", "success", "failure", "duration_s",
           "peak_force_n", "final_error_m", "final_error_rad"]  # fmt: skip


def rows(trials: int = 120, axes: int = 2, failure: str = "stalled") -> list[list[Any]]:
    """Results of a skill that tolerates tilts and of a replay that does not."""
    rng, table = np.random.default_rng(5), []
    for trial in range(trials):
        tilt, offset = rng.uniform(-0.3, 0.3), rng.uniform(-0.004, 0.004)
        for skill, widest, narrow in (("peg.skill.json", 0.24, 0.006), ("replay:demo1.npz", 0.08, 0.001)):
            good = (tilt / widest) ** 2 + (offset / narrow) ** 2 + rng.normal(0, 0.08) < 1.0
            force = float(rng.gamma(6.0, 2.5 if good else 8.0))
            varied = [tilt, offset, rng.uniform(0.1, 0.3)][:axes]
            cause = "" if good else (failure if rng.uniform() < 0.7 else "force limit 80 N")
            table.append([trial, skill, 7, *varied, int(good), cause, 3.0 + rng.uniform(), force, 0.001, 0.01])
    return table


def write_csv(path: Path, table: list[list[Any]], columns: list[str] = COLUMNS) -> None:
    """A results table."""
    import csv

    with path.open("w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows([columns, *table])


SPEC = """name = "peg, fixture tilted and moved"
seed = 7
trials = 120
robot = "panda"
world = "peg_in_hole"
skills = ["peg.skill.json", "replay:demo1.npz"]
[vary]
"fixture.tilt_y" = { uniform = [-0.3, 0.3] }
"fixture.offset_x" = { uniform = [-0.004, 0.004] }
"""


def campaign(folder: Path, *, failure: str = "stalled", skill: str = "lmc") -> Path:
    """A campaign's folder as the contract describes it."""
    for name in ("skills", "traces", "demonstrations"):
        (folder / name).mkdir(parents=True, exist_ok=True)
    (folder / "campaign.toml").write_text(SPEC, encoding="utf-8")
    table = rows(failure=failure)
    write_csv(folder / "results.csv", table)
    (folder / "skills" / "peg.skill.json").write_text(json.dumps(skill_document(skill)), encoding="utf-8")
    scene = {
        "name": "peg_in_hole",
        "analytic": {"largest_tilt_rad": 0.244},
        "params": {"clearance": 0.00025, "friction": 0.2},
    }
    (folder / "scene.json").write_text(json.dumps(scene), encoding="utf-8")
    summary = {
        "skills": {}, "wall_s": 41.3, "workers": 2, "versions": {"skillframe": "0.2.0", "mujoco": "4.0.0"},
        "hashes": {"scene": "ef" * 32},
    }  # fmt: skip
    (folder / "summary.json").write_text(json.dumps(summary), encoding="utf-8")
    trace(seed=3).save(folder / "traces" / "trial_00003_peg.npz")
    trace(success=False, seed=9, skill="replay:demo1.npz", failure=failure).save(
        folder / "traces" / "trial_00009_replay.npz"
    )
    return folder

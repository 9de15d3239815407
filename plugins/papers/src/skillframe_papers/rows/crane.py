"""Rows 20 to 22: results of the crane's model, and of its control loop.

Holding forces follow from gravity at rest, F = J_p^-T g(z), and pressures from F = p_a A_a - p_b A_b. Runs
(`crane_runs`) have cylinders as FMUs, force from pressures, and friction and payload identified in the air.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from skillframe.execution import Result
from skillframe.extend import RowResult, RowRun
from skillframe.frames import Float
from skillframe.robot import ClosedChain, load_model, load_robot, with_payload
from skillframe_papers.rows import crane_runs

START = (math.pi / 4, -math.pi / 2, 0.5)
ERRORS = ((1.0, 1.0), (0.9, 0.8), (1.1, 1.2), (0.9, 1.2), (1.1, 0.8))
"""Mass and friction of the plant over the controller's, the first exact."""
LOADS = ((1.0, 1.0), (0.9, 0.8), (1.1, 1.2), (0.9, 1.2))
DATA_SET = {
    "robot.mass_scale": (0.9,),
    "actuator.bulk_scale": (0.95, 1.05, 1.1),
    "actuator.valve_scale": (0.97, 1.05, 1.0),
    "actuator.friction_scale": (0.9, 1.1, 0.9),
}
"""Published factors of the data set by cylinder, read as the controller's value over the true one."""
LATE_S = 0.05


def _draws(errors: Any, factors: Sequence[float] = ()) -> dict[str, Float]:
    """Mass and friction of each trial, then a trial for each power of the data set's factors."""
    mass, friction = np.array(errors).T
    draws = {"robot.mass_scale": mass, "actuator.friction_scale": friction}
    for power in factors:
        values = {
            name if len(each) == 1 else f"{name}_{i + 1}": value**power
            for name, each in DATA_SET.items() for i, value in enumerate(each)
        }  # fmt: skip
        count = len(next(iter(draws.values())))
        draws = {
            name: np.append(draws.get(name, np.ones(count)), values.get(name, 1.0)) for name in {**draws, **values}
        }
    return draws


def _stopped(result: Result, seconds: float) -> str:
    short = [i for i, time in enumerate(result.duration_s) if time < seconds - 0.01]
    return str(result.failure[short[0]] or result.reason[short[0]]) if short else ""


def late_mm() -> float:
    """Null of row 22: largest error of a tool that is `LATE_S` late [mm]."""
    times = np.arange(LATE_S, 30.0, 0.01)
    here, before = (np.array([crane_runs.diamond(t)[0] for t in at]) for at in (times, times - LATE_S))
    return float(1e3 * np.linalg.norm(here - before, axis=1).max())


def diamond(job: RowRun) -> RowResult:
    """Row 22: error of the tool on the published path."""
    seconds = min(float(job.settings["duration"]), job.count(30, 5))
    errors, factors = ERRORS[: job.count(len(ERRORS), 2)], (-1.0, 1.0)[: job.count(2, 1)]
    where = crane_runs.scene(crane_runs.CORNERS[0], plate=False)
    result = crane_runs.run(
        crane_runs.diamond, crane_runs.MOVING, where, _draws(errors, factors), seconds=seconds, seed=job.seed
    )  # fmt: skip
    assert result.traces is not None
    off = [1e3 * np.hypot(*(t.position - t.desired_position)[:, [0, 2]].T) for t in result.traces]
    figures = [(float(np.sqrt(np.mean(e**2))), float(e.max())) for e in off]
    names = [f"mass {mass:g}, friction {friction:g}" for mass, friction in errors]
    names += [
        "truth over belief: the data set's factors " + ("inverted" if f < 0.0 else "as they are") for f in factors
    ]
    rows = [(name, f"{rms:.1f} mm", f"{most:.1f} mm") for name, (rms, most) in zip(names, figures, strict=True)]
    stopped, plain, theirs = _stopped(result, seconds), figures[: len(errors)], figures[len(errors) :]
    most, late = max(f[1] for f in figures), late_mm()
    return RowResult(
        ours=f"largest error {max(f[1] for f in plain):.1f} mm with masses and friction off, "
        f"{max(f[1] for f in theirs):.1f} mm with the data set's factors, {plain[0][1]:.1f} mm with the exact model "
        f"(rms {plain[0][0]:.1f} mm) in {seconds:g} s",
        verdict="fail" if stopped or most > 10.0 else "pass", rows=rows,  # mm
        values={"largest_mm": most, "data_set_mm": max(f[1] for f in theirs), "null_mm": late},
        head=("plant over model", "rms", "largest"),
        difference=(f"A trial stopped: {stopped}. " if stopped else "As the filtered encoders see the tool. ")
        + f"Null: a tool that is {1e3 * LATE_S:g} ms late is off by up to {late:.1f} mm.",
    )  # fmt: skip


def force(job: RowRun) -> RowResult:
    """Row 20: estimated against true contact force while the tool slides along a plate."""
    seconds = min(float(job.settings["duration"]), job.count(60, 12))  # from 10.8 s on a light tilt pulls all it can
    errors = LOADS[: job.count(len(LOADS), 2)]
    where = crane_runs.scene(np.array([crane_runs.FIXTURE[0], 0.0, crane_runs.ABOVE]), plate=True)
    path = crane_runs.press_and_slide(float(job.settings["press.depth"]))
    result = crane_runs.run(path, crane_runs.PRESSING, where, _draws(errors), seconds=seconds, seed=job.seed)
    assert result.traces is not None
    rows, worst, load, null = [], 0.0, 0.0, 0.0
    for (mass, friction), trace in zip(errors, result.traces, strict=True):
        speed = np.abs(np.gradient(trace.position[:, 0], trace.time))
        chosen = (trace.time > 7.0) & (speed > 0.6 * crane_runs.SPEED)  # contact has settled, and the tool slides
        true, seen = trace.wrench_true[chosen][:, [0, 2]], trace.wrench[chosen][:, [0, 2]]
        load = float(np.hypot(*true.T).mean()) if chosen.any() else math.nan
        off = 100.0 * np.hypot(*(seen - true).T) / load
        still = 100.0 * np.hypot(*(true.mean(axis=0) - true).T) / load
        null = max(null, float(still.max())) if chosen.any() else null
        rms, most = (float(np.sqrt(np.mean(off**2))), float(off.max())) if chosen.any() else (math.inf, math.inf)
        worst = max(worst, most)
        rows.append((f"{mass:g}", f"{friction:g}", f"{load:.0f} N", f"{rms:.1f} %", f"{most:.1f} %"))
    stopped = _stopped(result, seconds)
    return RowResult(
        ours=f"largest error {worst:.1f} % at {load:.0f} N; rms {rows[0][3]} with the exact model",
        verdict="pass" if worst <= 4.1 and not stopped else "fail", rows=rows,  # as published
        head=("mass over model", "friction over model", "load", "rms", "largest"),
        difference=f"A trial stopped: {stopped}" if stopped else
        "The paper's crane and surface are others, and what its 4.1 % is the largest of is not known to us; here it is "
        "every sample at more than 0.11 m/s. Where a cylinder reverses, some 400 N stay open. "
        f"Null: the mean of the true force, which is off by up to {null:.1f} %.",
    )  # fmt: skip


def holding(job: RowRun) -> RowResult:
    """Row 21: net piston forces at rest against those of the published pressures."""
    bore, rod, payload = (float(job.settings[k]) for k in ("cylinder.bore", "cylinder.rod", "robot.payload"))
    area_a = math.pi / 4.0 * bore**2
    area_b = area_a - math.pi / 4.0 * rod**2
    mine, empty = (
        ClosedChain(load_model(with_payload(load_robot("hiab_xs031"), mass))).at(np.array(START), np.zeros(3))
        for mass in (payload, 0.0)
    )
    rows, off, light = [], list[float](), list[float]()
    pressures = {"lift": (130.0e5, 30.9148e5), "tilt": (90.0e5, 35.7169e5)}  # [Pa], published start values
    for ours, null, (name, (a, b)) in zip(mine.holding_force(), empty.holding_force(), pressures.items(), strict=False):
        theirs = a * area_a - b * area_b
        off.append(float(ours) / theirs - 1.0)
        light.append(float(null) / theirs - 1.0)
        rows.append((name, f"{theirs / 1e3:.2f} kN", f"{ours / 1e3:.2f} kN", f"{100.0 * off[-1]:+.1f} %"))
    worst = max(abs(x) for x in off)
    return RowResult(
        ours=", ".join(f"{row[0]} {row[2]} ({row[3]})" for row in rows), verdict="pass" if worst <= 0.02 else "fail",
        difference="The published pressures are start values of a simulation, not an equilibrium. Null: the crane "
        f"without its payload is off by {', '.join(f'{100.0 * each:+.0f} %' for each in light)}.",
        values={"lift_off": off[0], "tilt_off": off[1]}, head=("cylinder", "published", "ours", "off"), rows=rows,
    )  # fmt: skip

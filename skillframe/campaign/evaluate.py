"""Simulates a chunk of a campaign: samples, set-up, simulation, rows.

World parameters shape the scene, except `world.friction`. Trials of equal scenes are simulated together; the grouping
does not change a trial's row.

`setup` of scene.json: the robot of a campaign's trials, so that reports need not load it.

limits    of the robot; `transient`: factor by which a peak of one tick may exceed `force_n` in simulation
control   rate and interface
drive     "servo", the name of a plug-in's drive, or "" for ideal torques
driven    a plug-in's drive in words: `by` what, under which control `law`, measured with which `sensors`
base      "fixed" or "free"
sensors   standard deviations of their noise
encoders  of the joints in words, or "" for exact positions and velocities
nominal   nominal values of the quantities that this kind of robot has
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from skillframe.campaign.driver import needed
from skillframe.campaign.jobs import report_progress
from skillframe.campaign.rows import (
    EXTRA,
    JUDGED,
    OUTCOME,
    SCORE,
    SECOND,
    TRACE,
    ChunkJob,
    Row,
    is_trial,
    plain_value,
    refused,
    rows_of,
)
from skillframe.campaign.sampling import Value, draws, trial_rngs
from skillframe.campaign.spec import CampaignSpec
from skillframe.control.contact import TRANSIENT
from skillframe.control.motors import unstated
from skillframe.document.file import load_skill
from skillframe.errors import InputError
from skillframe.execution.drive import Setup
from skillframe.execution.executor import INSIDE, begin, simulate, starts_inside
from skillframe.execution.prepare import load_robot_model, load_world, prepare
from skillframe.execution.recorder import geom_json
from skillframe.execution.trace import ScoreFailed, score_notes, scores_of
from skillframe.extend.drives import check_quantities, drive_of, lacks, quantities
from skillframe.extend.registry import registry
from skillframe.frames import Float
from skillframe.robot.model import RobotModel
from skillframe.robot.spec import RobotSpec
from skillframe.skill import Skill
from skillframe.world.scene import Scene

TAIL = 3.0
"""Standard deviations of a normal axis that must stay in range (0.27 % of samples lie beyond)."""


def evaluate(job: ChunkJob) -> list[Row]:
    """Simulate a chunk and return rows in the order of its trials.

    Raises:
        Unusable: the skill, the robot or the world cannot be loaded here.
        SkillframeError: a sample cannot be used.
    """
    spec = CampaignSpec.from_plain(job.spec, Path(job.folder))
    rows: dict[int, Row] = {}
    for scene, trials in _by_scene(spec, job.trials).items():
        tell = partial(_report, len(rows), len(trials), len(job.trials), spec.duration_s)
        found = _simulate(spec, job, tuple(trials), dict(scene), tell)
        rows |= {row["trial"]: row for row in found}
    return [rows[trial] for trial in job.trials]


def starts(spec: CampaignSpec) -> list[str]:
    """For each trial of the first skill, which bodies penetrate at the start, "" for none."""
    trials = range(spec.trials)
    told = [""] * spec.trials
    for scene, some in _by_scene(spec, trials).items():
        skill, setup, drawn = _ready(spec, 0, tuple(some), dict(scene))
        loop = begin(skill, setup, drawn, trial_rngs(spec.seed, tuple(some)))
        for each in starts_inside(loop.plant, loop.collisions):
            told[some[each.row]] = each.cause.removeprefix(INSIDE)
    return told


def _by_scene(spec: CampaignSpec, trials: Sequence[int]) -> dict[tuple[tuple[str, Value], ...], list[int]]:
    drawn = draws(spec, trials)
    scenes = [name for name in drawn if name.startswith("world.") and name != "world.friction"]
    groups: dict[tuple[tuple[str, Value], ...], list[int]] = {}
    for i, trial in enumerate(trials):
        groups.setdefault(tuple((name, plain_value(drawn[name][i])) for name in scenes), []).append(trial)
    return groups


def describe(spec: CampaignSpec) -> dict[str, Any]:
    """The nominal scene as JSON values for scene.json.

    Raises:
        SkillframeError: a skill, the robot, or a quantity at one of its declared values cannot be used.
    """
    robot = load_robot_model(str(spec.folder / spec.robot))
    scene = _scene(spec, {})
    for text in spec.skills:
        _, setup = prepare(robot, scene, load_skill(text, spec.folder)[1], spec.coc)
    for name, axis in spec.vary.items():
        for value in axis.numbers[:1] if axis.kind == "normal" else dict.fromkeys(axis.numbers):
            if name.startswith("world."):
                _scene(spec, {name: value})
            _check_quantity(robot, name, value)
    for name, axis in spec.vary.items():
        if axis.kind != "normal":
            continue
        mean, deviation = (float(number) for number in axis.numbers)
        for value in (mean - TAIL * deviation, mean + TAIL * deviation):
            try:
                if name.startswith("world."):
                    _scene(spec, {name: value})
                _check_quantity(robot, name, value)
            except InputError as error:
                reached = f"reaches {value:.6g} at {TAIL:g} standard deviations: {error.problem}"
                fix = "give a smaller standard deviation, with its unit if it is not in SI, or a uniform axis"
                raise InputError(f"vary.{name}.normal", reached, fix) from None
    for name, value in spec.fixed.items():
        _check_quantity(robot, name, value)
    tool = {
        "geoms": [geom_json(g) for g in scene.tool.geoms],
        "frames": {k: list(v) for k, v in scene.tool.frames.items()},
    }
    result = {}
    for name, axis in spec.vary.items():
        if name.startswith("world.") and axis.kind in ("uniform", "sobol") and _scene(spec, {}).analytic:
            values = [float(v) for v in np.linspace(float(axis.numbers[0]), float(axis.numbers[1]), 33)]
            figures = [_scene(spec, {name: value}).analytic for value in values]
            result[name] = {"values": values} | {key: [f[key] for f in figures] for key in figures[0]}
    return {
        "world": scene.name, "params": scene.params, "analytic": scene.analytic, "friction": scene.friction,
        "analytic_over": result,
        "interface": robot.spec.control.figures(),
        "fixture": [geom_json(g) for g in (*scene.fixture, *(g for part in scene.sprung for g in part.geoms))],
        "tool": tool, "setup": setup_notes(setup),
        **({"notes": notes} if not robot.spec.own_law and (notes := unstated(robot)) else {}),
    }  # fmt: skip


def _check_quantity(robot: RobotModel, name: str, value: Value) -> None:
    if name in quantities():
        check_quantities({name: np.array([value], dtype=float)}, robot)


def _scene(spec: CampaignSpec, varied: Mapping[str, Value]) -> Scene:
    settings = {**spec.fixed, **varied}
    return load_world(
        spec.world_place, {n.removeprefix("world."): v for n, v in settings.items() if n.startswith("world.")}
    )


def _report(before: int, group: int, trials: int, duration_s: float, now: float) -> None:
    report_progress((before + group * min(now / duration_s, 1.0)) / trials)


def _simulate(
    spec: CampaignSpec, job: ChunkJob, trials: tuple[int, ...], scene: Mapping[str, Value],
    progress: Callable[[float], None],
) -> list[Row]:  # fmt: skip
    skill, setup, drawn = _ready(spec, job.skill, trials, scene)
    result = simulate(
        skill, setup, drawn, trial_rngs(spec.seed, trials), duration_s=spec.duration_s,
        trace_hz=100.0 if job.traces or spec.scores else None, progress=progress,
    )  # fmt: skip
    if result.interrupted:  # cut short by Ctrl-C: no outcome
        raise KeyboardInterrupt
    outcomes = {name: getattr(result, name) for name in (*OUTCOME, *JUDGED, *EXTRA)}
    outcomes |= {SECOND + name: moved for name, moved in result.second.items()}
    rows = [row if is_trial(row) else refused(row) for row in rows_of(spec, job.skill, trials, outcomes)]
    for row, trace in zip(rows, result.traces or [], strict=job.traces or bool(spec.scores)):
        drawn = {name: row[name] for name in spec.vary}
        trace.meta.update({"seed": row["seed"], "trial": row["trial"], "skill": row["skill"], "draws": drawn})
        scores = dict.fromkeys(spec.scores, math.nan)
        if spec.scores and is_trial(row):
            try:
                scores = scores_of(trace, spec.scores)
            except ScoreFailed as error:
                raise ScoreFailed(f"trial {row['trial']}: {error}") from error
            trace.meta["scores"] = score_notes(scores)
        row |= {SCORE + name: value for name, value in scores.items()}
        if job.traces:
            with tempfile.TemporaryDirectory() as folder:
                trace.save(Path(folder) / "trace.npz")
                row[TRACE] = (Path(folder) / "trace.npz").read_bytes()
    return rows


def _ready(
    spec: CampaignSpec, skill: int, trials: tuple[int, ...], scene: Mapping[str, Value]
) -> tuple[Skill, Setup, dict[str, Float]]:  # fmt: skip
    with needed("the robot"):
        robot = load_robot_model(str(spec.folder / spec.robot))
    with needed(f"the skill {spec.labels[skill]}"):
        _, document = load_skill(spec.skills[skill], spec.folder)
    with needed(f"the world {spec.world}"):
        registry().world(spec.world_place)
    # a sampled scene may be refused; the nominal one was accepted before
    with nullcontext() if scene else needed("the scene or the skill"):
        runnable, setup = prepare(robot, _scene(spec, scene), document, spec.coc)
    constant = {n: np.full(len(trials), v) for n, v in spec.fixed.items() if not n.startswith("world.")}
    varied = {name: values for name, values in draws(spec, trials).items() if name not in scene}
    return runnable, setup, {**constant, **varied}


def setup_notes(setup: Setup) -> dict[str, Any]:
    """The set-up of a campaign's trials as JSON values."""
    robot = setup.robot.spec
    own = drive_of(robot)
    sensors = setup.sensors if own is None or own.noise is None else own.noise(robot)
    nominal = {each.name: each.nominal for each in quantities().values() if not lacks(each.name, robot)}
    return {
        "limits": {**asdict(setup.limits), "transient": TRANSIENT}, "control": asdict(robot.control),
        "drive": drive_name(robot),
        "driven": {} if own is None else {"by": own.summary, "law": own.law, "sensors": own.sensors},
        "base": robot.base, "sensors": asdict(sensors),
        "encoders": "" if robot.encoders is None else str(robot.encoders),
        "nominal": {name: value for name, value in nominal.items() if value is not None},
    }  # fmt: skip


def drive_name(robot: RobotSpec) -> str:
    """Name of the drive between controller and joints, "" for ideal torques."""
    own = drive_of(robot)
    return own.name if own is not None else "servo" if robot.servo else ""

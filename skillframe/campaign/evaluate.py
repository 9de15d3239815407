"""A chunk of a campaign through the executor: draws, set-up, simulation, rows.

World parameters shape the scene, so trials that differ in one (all but `world.friction`, which the plant takes per
trial) are simulated in groups of equal scenes; a trial's row is the same in whatever group it runs.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import nullcontext
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from skillframe.campaign.axes import Value
from skillframe.campaign.chunk_progress import report_progress
from skillframe.campaign.noted import setup_notes
from skillframe.campaign.rows import EXTRA, JUDGED, OUTCOME, SCORE, SECOND, TRACE, ChunkJob, Row, plain_value, rows_of
from skillframe.campaign.sampling import draws, trial_rngs
from skillframe.campaign.spec import CampaignSpec
from skillframe.campaign.trouble import needed
from skillframe.control.motors import unstated
from skillframe.document.source import load_skill
from skillframe.errors import InputError
from skillframe.execution.executor import QUANTITIES, simulate
from skillframe.execution.prepare import load_robot_model, load_world, prepare
from skillframe.execution.scores import ScoreFailed, score_notes, scores_of
from skillframe.execution.trace import Trace
from skillframe.extend.registry import registry
from skillframe.robot.model import RobotModel
from skillframe.robot.payload import with_payload
from skillframe.world.drawing import geom_json
from skillframe.world.placement import check_quantities
from skillframe.world.scene import Scene

TRACE_HZ = 100.0
ANALYTIC_SAMPLES = 33
TAIL = 3.0
"""Of a normal axis one draw in 370 lies further out than so many standard deviations (ours)."""


def evaluate(job: ChunkJob) -> list[Row]:
    """Simulate a chunk. Rows are in the order of its trials.

    Raises:
        Unusable: the skill, the robot or the world cannot be loaded here.
        SkillframeError: a draw that cannot be used.
    """
    spec = CampaignSpec.from_plain(job.spec, Path(job.folder))
    drawn = draws(spec, job.trials)
    scenes = [name for name in drawn if _shapes_scene(name)]
    groups: dict[tuple[Value, ...], list[int]] = {}
    for i, trial in enumerate(job.trials):
        groups.setdefault(tuple(plain_value(drawn[name][i]) for name in scenes), []).append(trial)
    rows: dict[int, Row] = {}
    for values, trials in groups.items():
        tell = partial(_report, len(rows), len(trials), len(job.trials), spec.duration_s)
        found = _simulate(spec, job, tuple(trials), dict(zip(scenes, values, strict=True)), tell)
        rows |= {row["trial"]: row for row in found}
    return [rows[trial] for trial in job.trials]


def describe(spec: CampaignSpec) -> dict[str, Any]:
    """The nominal scene as plain JSON values for scene.json. Refuses what would not run.

    Raises:
        SkillframeError: a skill, the robot, or a quantity at one of its declared values cannot be used.
    """
    robot = load_robot_model(str(spec.folder / spec.robot))
    scene = _scene(spec, {})
    for text in spec.skills:
        _, setup = prepare(robot, scene, load_skill(text, spec.folder)[1], spec.coc)
    for name, value in _declared_values(spec):
        if name.startswith("world."):
            _scene(spec, {name: value})
        _check_quantity(robot, name, value)
    _check_tails(spec, robot)
    for name, value in spec.fixed.items():
        _check_quantity(robot, name, value)
    tool = {
        "geoms": [geom_json(g) for g in scene.tool.geoms],
        "frames": {k: list(v) for k, v in scene.tool.frames.items()},
    }
    return {
        "world": scene.name, "params": scene.params, "analytic": scene.analytic, "friction": scene.friction,
        "analytic_over": _analytic_over(spec),
        "interface": robot.spec.control.figures(),
        "fixture": [geom_json(g) for g in (*scene.fixture, *(g for part in scene.sprung for g in part.geoms))],
        "tool": tool, "setup": setup_notes(setup),
        **({"notes": notes} if (notes := _robot_notes(robot)) else {}),
    }  # fmt: skip


def _robot_notes(robot: RobotModel) -> list[str]:
    """Sentences on what the robot's description leaves out. What drives of machines and plug-ins say is theirs."""
    return [] if robot.spec.hydraulic or robot.spec.other_drive else unstated(robot)


def _analytic_over(spec: CampaignSpec) -> dict[str, dict[str, list[float]]]:
    """The analytic figures along each world parameter that varies between two numbers, for the report's map."""
    result = {}
    for name, axis in spec.vary.items():
        if name.startswith("world.") and axis.kind in ("uniform", "sobol") and _scene(spec, {}).analytic:
            values = [float(v) for v in np.linspace(float(axis.numbers[0]), float(axis.numbers[1]), ANALYTIC_SAMPLES)]
            figures = [_scene(spec, {name: value}).analytic for value in values]
            result[name] = {"values": values} | {key: [f[key] for f in figures] for key in figures[0]}
    return result


def _shapes_scene(name: str) -> bool:
    return name.startswith("world.") and name != "world.friction"


def _declared_values(spec: CampaignSpec) -> Iterator[tuple[str, Value]]:
    """Ends, means and listed values of what varies."""
    for name, axis in spec.vary.items():
        numbers = axis.numbers[:1] if axis.kind == "normal" else tuple(dict.fromkeys(axis.numbers))
        yield from ((name, value) for value in numbers)


def _check_tails(spec: CampaignSpec, robot: RobotModel) -> None:
    """Refuse a normal axis that leaves its quantity's range within `TAIL` deviations: trials there could not run."""
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


def _check_quantity(robot: RobotModel, name: str, value: Value) -> None:
    """Refuse a value that no trial of this robot could run with."""
    if name in ("robot.payload", "robot.nominal_payload"):
        with_payload(robot.spec, float(value))
    if name in QUANTITIES:
        check_quantities({name: np.array([value], dtype=float)}, robot)


def _scene(spec: CampaignSpec, varied: Mapping[str, Value]) -> Scene:
    settings = {**spec.fixed, **varied}
    return load_world(
        spec.world_place, {n.removeprefix("world."): v for n, v in settings.items() if n.startswith("world.")}
    )


def _report(before: int, group: int, trials: int, duration_s: float, now: float) -> None:
    """Say how far the chunk is: whole groups of trials, and the simulated time of one."""
    report_progress((before + group * min(now / duration_s, 1.0)) / trials)


def _simulate(
    spec: CampaignSpec, job: ChunkJob, trials: tuple[int, ...], scene: Mapping[str, Value],
    progress: Callable[[float], None],
) -> list[Row]:  # fmt: skip
    """Rows of trials that share a scene."""
    with needed("the robot"):
        robot = load_robot_model(str(spec.folder / spec.robot))
    with needed(f"the skill {spec.labels[job.skill]}"):
        _, document = load_skill(spec.skills[job.skill], spec.folder)
    with needed(f"the world {spec.world}"):
        registry().world(spec.world_place)
    # a drawn scene may be one that the world or the skill refuses; the nominal one was accepted before the campaign
    with nullcontext() if scene else needed("the scene or the skill"):
        skill, setup = prepare(robot, _scene(spec, scene), document, spec.coc)
    constant = {n: np.full(len(trials), v) for n, v in spec.fixed.items() if not n.startswith("world.")}
    varied = {name: values for name, values in draws(spec, trials).items() if name not in scene}
    result = simulate(
        skill, setup, {**constant, **varied}, trial_rngs(spec.seed, trials), duration_s=spec.duration_s,
        trace_hz=TRACE_HZ if job.traces or spec.scores else None, progress=progress,
    )  # fmt: skip
    if result.interrupted:  # rows that a Ctrl-C cut short are no outcome
        raise KeyboardInterrupt
    outcomes = {name: getattr(result, name) for name in (*OUTCOME, *JUDGED, *EXTRA)}
    outcomes |= {SECOND + name: moved for name, moved in result.second.items()}
    rows = rows_of(spec, job.skill, trials, outcomes)
    for row, trace in zip(rows, result.traces or [], strict=job.traces or bool(spec.scores)):
        drawn = {name: row[name] for name in spec.vary}
        trace.meta.update({"seed": row["seed"], "trial": row["trial"], "skill": row["skill"], "draws": drawn})
        row |= {SCORE + name: value for name, value in _scores(spec, trace).items()}
        row |= {TRACE: _trace_bytes(trace)} if job.traces else {}
    return rows


def _scores(spec: CampaignSpec, trace: Trace) -> dict[str, float]:
    """The scores that the campaign asks for, noted in the trace too.

    Raises:
        ScoreFailed: names the trial too.
    """
    if not spec.scores:
        return {}
    try:
        values = scores_of(trace, spec.scores)
    except ScoreFailed as error:
        raise ScoreFailed(f"trial {trace.meta['trial']}: {error}") from error
    trace.meta["scores"] = score_notes(values)
    return values


def _trace_bytes(trace: Trace) -> bytes:
    """The trace as the content of its file."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "trace.npz"
        trace.save(path)
        return path.read_bytes()

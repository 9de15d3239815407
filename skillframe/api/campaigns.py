"""`Campaign` and `CampaignResults`: skills run many times over declared uncertainty, and the results."""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
import weakref
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.api.inputs import File, Robot
from skillframe.api.learning import LearnedSkill, Skills, skill_of
from skillframe.api.running import SingleRun
from skillframe.campaign import evaluate
from skillframe.campaign.folder import campaign_hash, load, prepare
from skillframe.campaign.rows import LEFT_OUT, absent, columns, is_trial
from skillframe.campaign.runner import Options, Progress, pick_label, run_campaign, trace_path
from skillframe.campaign.spec import CampaignSpec, place_of
from skillframe.campaign.store import ordered, read_content
from skillframe.campaign.summary import read_summary
from skillframe.config import read_toml
from skillframe.document.file import parse_source, save
from skillframe.errors import InputError
from skillframe.extend.registry import registry
from skillframe.robot.model import RobotModel
from skillframe.robot.spec import RobotSpec, load_robot

DEFAULTS: Mapping[str, Any] = {"robot": "panda", "trials": 100, "seed": 0}
"""Defaults of a plan without a file."""
PLAN = Path("campaign")
"""Name of a plan without a file in errors."""


class SkillRate(NamedTuple):
    """How often a skill succeeded.

    Attributes:
        trials, successes: counts.
        rate: successes over trials; None without a trial.
        interval_95: bounds of the success probability; None where no interval holds, for the reason in `method`.
        method: of the interval, in words.
        left_out_after: trials after which a race left the skill out, or None.
        refused: starts in penetration, which are no trials and in none of the counts.
    """

    trials: int
    successes: int
    rate: float | None
    interval_95: tuple[float, float] | None
    method: str
    left_out_after: int | None = None
    refused: int = 0


class CampaignResults:
    """The results of a campaign, read from its folder.

    Attributes:
        folder: of the campaign, as `skillframe campaign` and `skillframe report` take it.
        summary: content of summary.json.
        rows: a dict per trial and skill, with the columns of results.csv.

    Args:
        folder: of a campaign that ran.

    Raises:
        InputError: not a campaign's folder, or damaged or changed rows.
    """

    def __init__(self, folder: File) -> None:
        self.folder = Path(folder)
        self.spec = load(self.folder)
        self.summary = read_summary(self.folder)
        done = read_content(self.folder, campaign_hash(self.spec), self.spec).done
        told = self.summary["skills"]
        left = {label: told[label][LEFT_OUT] for label in told if LEFT_OUT in told[label]}
        self.rows = list(ordered(self.spec, done, self.summary["stopped_after_trial"], left))

    @property
    def skills(self) -> dict[str, SkillRate]:
        """Rate and interval of each skill, by its label."""
        return {label: _rate(self.summary["skills"][label]) for label in self.spec.labels}

    @property
    def comparisons(self) -> list[dict[str, Any]]:
        """Every pair of skills on the trials that both ran, as in summary.json: `only_first`, `p_value` ..."""
        compared: list[dict[str, Any]] = self.summary["comparisons"]
        return compared

    def table(self, skill: str | None = None) -> dict[str, NDArray[Any]]:
        """The columns of results.csv as arrays (trials,), for one skill, in the order of the trials.

        Refused starts are left out.

        Args:
            skill: its label or the label's beginning; None for the first.

        Raises:
            UnknownName: no such skill.
        """
        label = pick_label(self.spec.labels, skill)
        mine = [row for row in self.rows if row["skill"] == label and is_trial(row)]
        return {name: np.array([row.get(name, absent(name)) for row in mine]) for name in columns(self.spec, self.rows)}

    def run_of(self, trial: int, skill: str | None = None) -> SingleRun:
        """A trial that left a trace: of each skill the first two, the typical success and the first failures.

        Raises:
            InputError: it left none. UnknownName: no such skill.
        """
        path = trace_path(self.folder, trial, pick_label(self.spec.labels, skill))
        if not path.is_file():
            again = f"type skillframe campaign replay {self.folder} {trial} --out trial.npz"
            raise InputError(path, f"trial {trial} left no trace", again)
        return SingleRun.load(path)

    def __repr__(self) -> str:
        lines = [f"  {label}: {_said(rate)}" for label, rate in self.skills.items()]
        where = f"{self.spec.name}, {self.spec.robot_name} in {self.spec.world_name}"
        return "\n".join([f"CampaignResults({where})", *lines])


def _rate(found: Mapping[str, Any]) -> SkillRate:
    interval = found["interval_95"]
    bounds = None if interval is None else (float(interval[0]), float(interval[1]))
    left = found.get(LEFT_OUT)
    refused = int(found.get("refused", 0))
    return SkillRate(found["trials"], found["successes"], found["rate"], bounds, found["method"], left, refused)


def _said(rate: SkillRate) -> str:
    if rate.rate is None:
        return "no trial yet"
    text = f"{rate.successes} of {rate.trials}, rate {rate.rate:.3f}"
    text += f", {rate.refused} starts refused" if rate.refused else ""
    text += "" if rate.interval_95 is None else f" ({rate.interval_95[0]:.3f} to {rate.interval_95[1]:.3f})"
    return text if rate.left_out_after is None else f"{text}, left out after {rate.left_out_after} trials"


class Campaign:
    """A plan of what runs, how often, and what varies.

    The plan is a campaign.toml, a dict with its keys, or keywords, which override the file or dict. Relative paths
    start in the file's folder, those of a dict and of keywords in the working directory.

    Attributes:
        spec: the checked plan.

    Args:
        plan: a campaign.toml, or a dict with its keys; None for keywords alone.
        world: a world's name, or its fixture file.
        skills: learned skills, skill files, "TYPE:DEMONSTRATION", or a dict of these by their names in results.
        **keys: the other keys of campaign.toml: `robot` ("panda" by default), `trials` (100), `seed` (0), `vary`
            {"fixture.tilt_y": {"uniform": [-0.1, 0.1]}}, `set`, `coc`, `duration_s`, `stop`, `race`, `expect`, `name`.

    Raises:
        InputError: a key or value that cannot be used; names it.
        UnknownName: no such world, quantity, distribution or key.
    """

    def __init__(
        self, plan: File | Mapping[str, Any] | None = None, *, world: File | None = None,
        skills: Skills | Sequence[Skills] | Mapping[str, Skills] | None = None, robot: Robot | None = None, **keys: Any,
    ) -> None:  # fmt: skip
        given: dict[str, Any] = {"world": world, "skills": skills, "robot": robot, **keys}
        given = {key: value for key, value in given.items() if value is not None}
        if world is not None:
            given["world"] = place_of(os.fspath(world), Path.cwd())
        if isinstance(plan, str | os.PathLike) and not given:
            self.spec = CampaignSpec.from_toml(Path(plan))
            return
        self._stage = Path(tempfile.mkdtemp(prefix="skillframe-"))
        weakref.finalize(self, shutil.rmtree, self._stage, ignore_errors=True)
        table: dict[str, Any] = {**_table(plan), **given}
        if "skills" in given or isinstance(plan, Mapping):
            table["skills"] = self._entries(table.get("skills", ()))
        table["robot"] = _robot_entry(table["robot"])
        name = Path(plan) if isinstance(plan, str | os.PathLike) else PLAN
        self.spec = CampaignSpec.from_table(table, name)

    def _entries(self, skills: Skills | Sequence[Skills] | Mapping[str, Skills]) -> list[str]:
        """The entries of `skills`, with absolute paths. Skills in memory are written into a temporary folder."""
        if isinstance(skills, Mapping) and "format" not in skills:
            return [self._written(skill_of(skill), name) for name, skill in skills.items()]
        alone = isinstance(skills, str | os.PathLike | LearnedSkill | Mapping)
        several: Sequence[Any] = [skills] if alone else skills  # type: ignore[assignment, list-item]
        entries = []
        for skill in several:
            if isinstance(skill, str | os.PathLike):
                entries.append(_absolute(os.fspath(skill), Path.cwd()))
            else:
                learned = skill_of(skill)
                entries.append(self._written(learned, learned.name))
        return entries

    def _written(self, skill: LearnedSkill, name: str) -> str:
        path = self._stage / f"{name}.skill.json"
        if path.exists():
            raise InputError("campaign: skills", f"two are called {name!r}", 'name them: skills={"a": ..., "b": ...}')
        save(skill.document, path)
        return str(path)

    def prepare(self, out: File) -> Path:
        """Make the campaign's folder, with copies of its files, without running a trial.

        Raises:
            InputError: the folder is not empty, or skill, robot and world do not fit together.
        """
        prepare(self.spec, Path(out), evaluate.describe, registry().world(self.spec.world_place).params)
        return Path(out)

    def run(
        self, out: File | None = None, *, workers: int | None = None, traces: int = 8,
        progress: Callable[[Progress], None] | None = None,
    ) -> CampaignResults:  # fmt: skip
        """Run it.

        Args:
            out: folder for the results, absent or empty; None for a temporary one that lives as long as the results.
            workers: processes on this machine; None for this one alone. Rows do not depend on it.
            traces: how many trials per skill leave a trace.
            progress: called after every chunk of trials, and now and then within one.

        Raises:
            InputError: the folder is not empty, or skill, robot and world do not fit together.
            CampaignError: trouble of the environment stopped it; finished rows are kept in `out`.
            KeyboardInterrupt: Ctrl-C; likewise.
        """
        parent = Path(tempfile.mkdtemp(prefix="skillframe-")) if out is None else None
        try:
            folder = self.prepare(parent / "results" if parent is not None else Path(os.fspath(out or "")))
            with _script_unseen():
                run_campaign(folder, evaluate.evaluate, Options(workers=workers, traces=traces), progress)
            results = CampaignResults(folder)
        except BaseException:
            if parent is not None:
                shutil.rmtree(parent, ignore_errors=True)
            raise
        if parent is not None:
            weakref.finalize(results, shutil.rmtree, parent, ignore_errors=True)
        return results

    def __repr__(self) -> str:
        spec = self.spec
        where = f"{spec.robot_name} in {spec.world_name}"
        return f"Campaign({spec.name}: {', '.join(spec.labels)}; {spec.trials} trials, {where})"


@contextmanager
def _script_unseen() -> Iterator[None]:
    """While open, worker processes do not run the user's script again.

    `multiprocessing` imports the main module in every process that it spawns, so that a script without a
    `__name__ == "__main__"` guard would start again in each.
    """
    main = sys.modules["__main__"]
    kept = {name: getattr(main, name) for name in ("__file__", "__spec__") if hasattr(main, name)}
    try:
        main.__spec__ = None
        main.__dict__.pop("__file__", None)
        yield
    finally:
        for name, value in kept.items():
            setattr(main, name, value)


def _table(plan: File | Mapping[str, Any] | None) -> dict[str, Any]:
    """The keys of a plan. Those of a file have absolute paths."""
    if plan is None or isinstance(plan, Mapping):
        return {**DEFAULTS, **(plan or {})}
    table, folder = read_toml(Path(plan)), Path(plan).absolute().parent
    if isinstance(table.get("skills"), list):
        table["skills"] = [_absolute(text, folder) if isinstance(text, str) else text for text in table["skills"]]
    robot, world = table.get("robot"), table.get("world")
    if isinstance(robot, str) and (folder / robot).exists():
        table["robot"] = str(folder / robot)
    if isinstance(world, str):
        table["world"] = place_of(world, folder)
    return table


def _absolute(entry: str, folder: Path) -> str:
    return parse_source(entry, folder).moved(lambda file: str(folder / file)).text


def _robot_entry(robot: object) -> object:
    """A robot as a campaign file names it. Other values are left to the plan's check."""
    if isinstance(robot, RobotModel | RobotSpec):
        spec = robot.spec if isinstance(robot, RobotModel) else robot
        file = spec.folder / "robot.toml"
        if not file.is_file() or load_robot(file) != replace(spec):
            fix = "write what differs into a robot.toml and give that"
            raise InputError(f"robot {spec.name}", f"differs from {file}, which a campaign copies", fix)
        return str(file)
    if isinstance(robot, str | os.PathLike):
        text = os.fspath(robot)
        return str(Path(text).absolute()) if Path(text).exists() else text
    return robot
